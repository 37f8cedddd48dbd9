//! What Slurm is told, and what its words mean.

use super::*;
use crate::store::Candidate;
use uuid::Uuid;

fn slurm(sbatch: &[&str]) -> Slurm {
    let options = SlurmOptions {
        program: "/opt/grid fall/bin/gridfall".into(),
        folder: "/shared/it's".into(),
        files: None,
        database: "postgres://db/jobs".into(),
        arguments: vec!["--backend".into(), "gpu".into()],
        sbatch: sbatch.iter().map(|&option| option.into()).collect(),
    };
    Slurm { options, largest_array: 1000 }
}

fn batch(jobs: u128, deaths: i64, estimate_s: f64) -> Batch {
    let attempt = deaths + 1;
    let job = |id| {
        let (name, id) = ("a".into(), Uuid::from_u128(id));
        Candidate { id, attempt, name, sweep: None, estimate_s: None, deaths }
    };
    let (name, comment) = ("a|b\nc".into(), "id".into());
    Batch { jobs: (0..jobs).map(job).collect(), name, comment, estimate_s, attempt, deaths }
}

#[test]
fn every_word_of_slurm_has_a_meaning() {
    let said = "0|PENDING|a|Resources\n1|RUNNING|a|None\n2_0|COMPLETED|b|None\n2_1|CANCELLED by 1000|\n\
                3|NODE_FAIL|(null)\n4|OUT_OF_MEMORY|\n5|TIMEOUT|\n6|NEW|\n7|PENDING|a|launch failed requeued held\n";
    let states = states(said);
    assert_eq!(states.len(), 9);
    let state = |job: &str| states[job].state.clone();
    assert_eq!(state("0"), State::Waiting("Resources".into()));
    assert_eq!(state("1"), State::Alive);
    assert_eq!(state("2_0"), State::Completed);
    assert_eq!(state("2_1"), State::Canceled);
    assert_eq!(state("3"), State::Displaced("NODE_FAIL".into()));
    assert_eq!(state("4"), State::Failed("OUT_OF_MEMORY".into()));
    assert_eq!(state("5"), State::TimedOut);
    assert_eq!(state("6"), State::Failed("NEW".into()));
    assert_eq!(state("7"), State::Displaced("launch failed requeued held".into()), "it would wait for ever");
    assert_eq!((states["2_0"].comment.as_str(), states["3"].comment.as_str()), ("b", ""));
}

#[test]
fn a_number_that_was_given_out_again_is_another_job() {
    let (job, sweep, other) = (Uuid::from_u128(1), Uuid::from_u128(2), Uuid::from_u128(3));
    let seen = |comment: String| Seen { state: State::Alive, comment };
    assert!(seen(job.to_string()).is_of(job, None) && seen(sweep.to_string()).is_of(job, Some(sweep)));
    assert!(!seen(other.to_string()).is_of(job, Some(sweep)));
    assert!(seen(String::new()).is_of(job, None), "it is not known");
}

#[test]
fn the_time_of_an_attempt_follows_what_was_foretold() {
    assert_eq!(batch(1, 0, 3.0).minutes(), 10);
    assert_eq!(batch(1, 0, 3600.0).minutes(), 240);
    assert_eq!(batch(1, 2, 3600.0).minutes(), 960);
    assert_eq!(batch(1, 99, f64::INFINITY).minutes(), 500_000);
}

#[test]
fn the_script_runs_the_task_of_its_number() {
    let script = slurm(&[]).script(&batch(3, 1, 0.0));
    // A shell reads the line as it is meant.
    let shown = script.replace("exec '/opt/grid fall/bin/gridfall'", "printf '<%s>'");
    assert_ne!(shown, script);
    let shell = |environment: &[(&str, &str)]| {
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", &shown]).env_clear().envs(environment.iter().copied());
        String::from_utf8(shell.output().unwrap().stdout).unwrap()
    };
    let head = "<worker><--backend><gpu><--quiet><--data-dir></shared/it's><--attempt><2><--job>";
    let task = shell(&[("SLURM_JOB_ID", "9"), ("SLURM_ARRAY_JOB_ID", "7"), ("SLURM_ARRAY_TASK_ID", "2")]);
    assert_eq!(task, format!("{head}<{}><--cluster-job><7_2>", Uuid::from_u128(2)));
    let alone = shell(&[("SLURM_JOB_ID", "9")]);
    assert_eq!(alone, format!("{head}<{}><--cluster-job><9>", Uuid::from_u128(0)));
}

#[test]
fn sbatch_is_told_what_it_needs() {
    let options = slurm(&["--gres=gpu:1", "--time=5"]).sbatch(&batch(3, 0, 0.0));
    assert!(options.contains(&"--job-name=gridfall abc".into()), "{options:?}");
    assert!(options.contains(&"--array=0-2".into()), "{options:?}");
    assert!(options.contains(&"--output=/shared/it's/cluster/%A_%a.out".into()), "{options:?}");
    assert_eq!(options[options.len() - 2..], ["--gres=gpu:1", "--time=5"], "what the operator says comes last");
    assert!(!slurm(&[]).sbatch(&batch(1, 0, 0.0)).iter().any(|option| option.starts_with("--array")));
}

#[test]
fn the_size_of_arrays_is_read() {
    assert_eq!(largest_array("MaxArraySize            = 1001\nMaxDBDMsgs = 1"), Some(1001));
    assert_eq!(largest_array("MaxArraySize = 0"), Some(1));
    assert_eq!(largest_array("nothing"), None);
}

#[tokio::test]
async fn options_that_are_gridfalls_are_refused() {
    let said = |option: &'static str| async move {
        let options = SlurmOptions { sbatch: vec![option.into()], ..slurm(&[]).options };
        Slurm::new(options).await.unwrap_err().to_string()
    };
    assert!(said("--array=1-3").await.contains("leave it out"));
    assert!(said("-p gpu").await.contains("no long option"));
}
