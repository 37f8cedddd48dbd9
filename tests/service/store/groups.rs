//! Priorities, deadlines, filters, sweeps, and changes of many jobs at once.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicI64, Ordering};

use gridfall_service::store::{Filter, Job, JobStore, NewJob, NewSweep, Outcome, Status, Submission, Sweep};
use jiff::{SignedDuration, Timestamp};

use super::{accept, new_job, on_both};

on_both!(
    higher_priorities_run_first_and_equal_ones_in_order,
    a_job_that_was_not_started_by_its_deadline_fails,
    a_job_that_is_late_when_it_is_claimed_is_not_started,
    lists_are_filtered_by_everything_at_once,
    a_name_is_found_among_many_and_among_few,
    a_sweep_is_accepted_as_a_whole_or_not_at_all,
    many_jobs_are_canceled_and_deleted_by_a_filter,
    a_finished_job_is_found_by_its_scene,
    jobs_that_ended_long_ago_are_deleted,
);

async fn submit(store: &JobStore, new: NewJob) -> Job {
    match store.submit(&new, 100).await.unwrap() {
        Submission::Accepted(job) => job,
        other => panic!("{other:?}"),
    }
}

fn names(jobs: &[Job]) -> Vec<&str> {
    jobs.iter().map(|job| job.name.as_str()).collect()
}

async fn higher_priorities_run_first_and_equal_ones_in_order(store: JobStore) {
    for (name, priority) in [("a", 0), ("b", 5), ("c", -1), ("d", 5)] {
        submit(&store, NewJob { priority, ..new_job(name) }).await;
    }
    let listed = store.list(&Filter::default(), None, 10).await.unwrap();
    let places: Vec<_> = listed.iter().map(|job| (job.name.as_str(), job.queue_position.unwrap())).collect();
    assert_eq!(places, [("d", 2), ("c", 4), ("b", 1), ("a", 3)]);
    for job in &listed {
        assert_eq!(store.get(job.id).await.unwrap().unwrap(), *job);
    }
    for name in ["b", "d", "a", "c"] {
        let claim = store.claim("me").await.unwrap().unwrap();
        assert_eq!(store.get(claim.id).await.unwrap().unwrap().name, name);
    }
}

async fn a_job_that_was_not_started_by_its_deadline_fails(store: JobStore) {
    let now = Timestamp::now();
    let late = submit(&store, NewJob { deadline: Some(now - SignedDuration::from_secs(1)), ..new_job("late") }).await;
    let in_time =
        submit(&store, NewJob { deadline: Some(now + SignedDuration::from_secs(3600)), ..new_job("in time") }).await;
    assert_eq!(store.claim("me").await.unwrap().unwrap().id, in_time.id);
    let late = store.get(late.id).await.unwrap().unwrap();
    assert_eq!((late.status, late.failure.unwrap().code.as_str()), (Status::Failed, "deadline"));
    assert!(late.finished_at.is_some());
    // A job that was started and put back is not late.
    let store = store.with_clock(move || (now + SignedDuration::from_secs(7200)).as_microsecond());
    store.put_back(in_time.id, 1).await.unwrap();
    assert_eq!(store.claim("me").await.unwrap().unwrap().id, in_time.id);
}

async fn a_job_that_is_late_when_it_is_claimed_is_not_started(store: JobStore) {
    const SECOND: i64 = 1_000_000;
    for half_seconds in 0..16 {
        // A second goes by between any two looks at the clock: jobs become late while one is claimed.
        let ticks = AtomicI64::new(0);
        let start = 1_000_000 * SECOND;
        let store = store.clone().with_clock(move || start + SECOND * ticks.fetch_add(1, Ordering::Relaxed));
        let deadline = Timestamp::from_microsecond(start + half_seconds * SECOND / 2).unwrap();
        let job = submit(&store, NewJob { deadline: Some(deadline), ..new_job("hurry") }).await;
        let claimed = store.claim("me").await.unwrap().is_some();
        let job = store.get(job.id).await.unwrap().unwrap();
        assert_eq!(claimed, job.started_at.is_some_and(|started| started <= deadline), "{job:?}");
        if claimed {
            store.finish(job.id, 1, &Outcome::Succeeded).await.unwrap();
        } else {
            assert!(store.claim("me").await.unwrap().is_none());
            assert_eq!(store.get(job.id).await.unwrap().unwrap().status, Status::Failed);
        }
    }
}

async fn lists_are_filtered_by_everything_at_once(store: JobStore) {
    let day = |n: i64| move || n * 86_400_000_000;
    let at = |n: i64| Timestamp::from_microsecond(n * 86_400_000_000).unwrap();
    let jobs: [(i64, &str, &[&str]); 5] = [
        (1, "dam", &["wet"]),
        (2, "dam break", &["wet", "quick"]),
        (3, "sand", &["quick"]),
        (4, "dam break", &[]),
        (5, "Dam%", &["wet", "quick"]),
    ];
    for (n, name, tags) in jobs {
        let tags = tags.iter().map(|tag| (*tag).to_owned()).collect();
        submit(&store.clone().with_clock(day(n)), NewJob { tags, ..new_job(name) }).await;
    }
    let claim = store.claim("me").await.unwrap().unwrap();
    store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap();
    store.claim("me").await.unwrap().unwrap();

    let tags = |tags: &[&str]| tags.iter().map(|tag| (*tag).to_owned()).collect::<Vec<_>>();
    let all = Filter::default;
    for (filter, expected) in [
        (all(), vec!["Dam%", "dam break", "sand", "dam break", "dam"]),
        (Filter { statuses: vec![Status::Queued], ..all() }, vec!["Dam%", "dam break", "sand"]),
        (Filter { statuses: vec![Status::Succeeded, Status::Running], ..all() }, vec!["dam break", "dam"]),
        (Filter { statuses: vec![Status::Failed], ..all() }, vec![]),
        (Filter { tags: tags(&["wet"]), ..all() }, vec!["Dam%", "dam break", "dam"]),
        (Filter { tags: tags(&["wet", "quick"]), ..all() }, vec!["Dam%", "dam break"]),
        (
            Filter { tags: tags(&["wet"]), statuses: vec![Status::Queued, Status::Succeeded], ..all() },
            vec!["Dam%", "dam"],
        ),
        (Filter { name: Some("dam".into()), ..all() }, vec!["dam"]),
        (Filter { name: Some("dam*".into()), ..all() }, vec!["dam break", "dam break", "dam"]),
        (Filter { name: Some("Dam%".into()), ..all() }, vec!["Dam%"]),
        (Filter { created_after: Some(at(3)), ..all() }, vec!["Dam%", "dam break"]),
        (Filter { created_before: Some(at(3)), ..all() }, vec!["dam break", "dam"]),
        (
            Filter { created_after: Some(at(1)), created_before: Some(at(4)), name: Some("s*".into()), ..all() },
            vec!["sand"],
        ),
    ] {
        let jobs = store.list(&filter, None, 10).await.unwrap();
        assert_eq!(names(&jobs), expected, "{filter:?}");
        // Page by page it is the same.
        let (mut seen, mut before) = (Vec::new(), None);
        while let [job] = &store.list(&filter, before, 1).await.unwrap()[..] {
            before = Some(job.seq);
            seen.push(job.clone());
        }
        assert_eq!(seen, jobs, "{filter:?}");
    }
    assert_eq!(store.list(&Filter { tags: tags(&["wet"]), ..all() }, None, 1).await.unwrap()[0].tags, ["wet", "quick"]);
}

async fn a_name_is_found_among_many_and_among_few(store: JobStore) {
    let mut jobs: Vec<NewJob> = (0..1001).map(|i| new_job(&format!("dam {i}"))).collect();
    jobs.insert(500, new_job("sand"));
    let many = NewSweep { jobs, ..NewSweep::default() };
    assert!(matches!(store.submit_sweep(&many, 2000).await.unwrap(), Submission::Accepted(_)));
    let of = |name: &str, statuses: &[Status]| Filter {
        name: Some(name.into()),
        statuses: statuses.into(),
        ..Filter::default()
    };
    for statuses in [&[][..], &[Status::Queued], &[Status::Queued, Status::Running]] {
        let many = store.list(&of("d*", statuses), None, 2).await.unwrap();
        assert_eq!(names(&many), ["dam 1000", "dam 999"]);
        let few = store.list(&of("dam 77*", statuses), None, 2).await.unwrap();
        assert_eq!(names(&few), ["dam 779", "dam 778"]);
        assert_eq!(names(&store.list(&of("s*", statuses), None, 2).await.unwrap()), ["sand"]);
    }
}

async fn a_sweep_is_accepted_as_a_whole_or_not_at_all(store: JobStore) {
    let keyed = NewSweep {
        name: "three".into(),
        jobs: [("a", 1), ("b", 2), ("c", 3)].map(swept).into(),
        idempotency_key: Some("k".into()),
        request_sha256: "three".into(),
        ..NewSweep::default()
    };
    assert!(matches!(store.submit_sweep(&keyed, 2).await.unwrap(), Submission::QueueFull));
    assert_eq!(store.list(&Filter::default(), None, 10).await.unwrap(), []);

    let Submission::Accepted(id) = store.submit_sweep(&keyed, 3).await.unwrap() else { panic!() };
    assert!(matches!(store.submit_sweep(&keyed, 3).await.unwrap(), Submission::Repeated(same) if same == id));
    let other = NewSweep { request_sha256: "another".into(), ..keyed };
    assert!(matches!(store.submit_sweep(&other, 9).await.unwrap(), Submission::KeyReused));
    accept(&store, "another").await;
    let of_it = Filter { sweep: Some(id), ..Filter::default() };
    let listed = store.list(&of_it, None, 10).await.unwrap();
    assert_eq!(names(&listed), ["c", "b", "a"]);
    assert_eq!(listed[0].sweep, Some(id));
    assert_eq!(listed[0].sweep_values, swept(("c", 3)).sweep_values);
    let claim = store.claim("me").await.unwrap().unwrap();
    store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap();
    let sweep = store.sweep(id).await.unwrap().unwrap();
    assert_eq!((sweep.name.as_str(), sweep.jobs), ("three", BTreeMap::from([("queued", 2), ("succeeded", 1)])));
    assert!((sweep.fraction - 1.0 / 3.0).abs() < 1e-12, "{}", sweep.fraction);

    assert_eq!(store.cancel_all(&of_it).await.unwrap(), 2);
    let sweep = store.sweep(id).await.unwrap().unwrap();
    assert_eq!((sweep.jobs, sweep.fraction), (BTreeMap::from([("canceled", 2), ("succeeded", 1)]), 1.0));
    assert_eq!(store.counts().await.unwrap()[0], (Status::Queued, 1), "the other job is untouched");
    assert_eq!(store.sweep(uuid::Uuid::now_v7()).await.unwrap(), None);

    let later = NewSweep { jobs: vec![new_job("d")], ..NewSweep::default() };
    let Submission::Accepted(later) = store.submit_sweep(&later, 9).await.unwrap() else { panic!() };
    let ids = |sweeps: Vec<Sweep>| sweeps.into_iter().map(|sweep| sweep.id).collect::<Vec<_>>();
    let all = store.sweeps(None, None, 9).await.unwrap();
    assert_eq!(all[1].jobs, BTreeMap::from([("canceled", 2), ("succeeded", 1)]));
    assert_eq!(ids(all), [later, id]);
    assert_eq!(ids(store.sweeps(None, None, 1).await.unwrap()), [later]);
    assert_eq!(ids(store.sweeps(None, Some(later), 9).await.unwrap()), [id]);
    store.delete_all(&of_it, 9).await.unwrap();
    assert_eq!(ids(store.sweeps(None, None, 9).await.unwrap()), [later], "without jobs there is no sweep");
}

fn swept((name, seed): (&str, u64)) -> NewJob {
    NewJob { sweep_values: BTreeMap::from([("seed".to_owned(), seed.into())]), ..new_job(name) }
}

async fn many_jobs_are_canceled_and_deleted_by_a_filter(store: JobStore) {
    for name in ["a1", "a2", "a3", "b"] {
        accept(&store, name).await;
    }
    let running = store.claim("me").await.unwrap().unwrap().id;
    let a = Filter { name: Some("a*".into()), ..Filter::default() };
    assert!(store.delete_all(&a, 10).await.unwrap().is_empty(), "none has ended");
    let queued = Filter { statuses: vec![Status::Queued], ..a.clone() };
    assert_eq!(store.cancel_all(&queued).await.unwrap(), 2);
    assert_eq!(store.cancel_all(&a).await.unwrap(), 1);
    assert_eq!(store.cancel_all(&a).await.unwrap(), 0, "once is enough");
    assert!(store.get(running).await.unwrap().unwrap().cancel_requested);
    assert_eq!(store.delete_all(&a, 1).await.unwrap().len(), 1);
    assert_eq!(store.delete_all(&a, 10).await.unwrap().len(), 1);
    assert_eq!(names(&store.list(&Filter::default(), None, 10).await.unwrap()), ["b", "a1"]);
}

async fn a_finished_job_is_found_by_its_scene(store: JobStore) {
    let scene = |sha: &str| NewJob { scene_sha256: sha.into(), ..new_job(sha) };
    for sha in ["x", "x", "y"] {
        submit(&store, scene(sha)).await;
    }
    assert_eq!(store.finished("x", "me", "").await.unwrap(), None);
    let mut last = None;
    while let Some(claim) = store.claim("me").await.unwrap() {
        let backend = gridfall_engine::Backend {
            kind: "cpu".into(),
            device: "a test".into(),
            driver: String::new(),
            software: false,
            reason: "it is a test".into(),
        };
        store.set_backend(claim.id, claim.attempt, &backend).await.unwrap();
        store.finish(claim.id, claim.attempt, &Outcome::Succeeded).await.unwrap();
        last = Some(claim.id);
    }
    let found = store.finished("x", "me", "").await.unwrap().unwrap();
    assert_eq!((found.name.as_str(), found.seq), ("x", 2), "the newest");
    assert_eq!(store.finished("y", "me", "").await.unwrap().map(|job| job.id), last);
    assert_eq!(store.finished("x", "another server", "").await.unwrap(), None, "its files are elsewhere");
}

async fn jobs_that_ended_long_ago_are_deleted(store: JobStore) {
    let at = |seconds: i64| store.clone().with_clock(move || seconds * 1_000_000);
    for (name, seconds) in [("old", 100), ("older", 50), ("new", 200)] {
        let job = accept(&store, name).await;
        at(seconds).cancel(job.id).await.unwrap();
    }
    accept(&store, "waiting").await;
    let before = Timestamp::from_second(150).unwrap();
    let oldest = store.delete_ended_before(before, 1).await.unwrap();
    assert_eq!(oldest.len(), 1);
    assert_eq!(names(&store.list(&Filter::default(), None, 10).await.unwrap()), ["waiting", "new", "old"]);
    assert_eq!(store.delete_ended_before(before, 10).await.unwrap().len(), 1);
    assert_eq!(names(&store.list(&Filter::default(), None, 10).await.unwrap()), ["waiting", "new"]);
}
