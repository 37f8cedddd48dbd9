//! Runs a target on its corpus and on mutations of it, and keeps what fails.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::mutate;

/// Address space of the process (bytes). What asks for more ends it, and the input is in `TARGET.running`.
const ADDRESS_SPACE: u64 = 8 << 30;
/// A case that takes longer is taken to be endless. Cases take milliseconds.
const ENDLESS: Duration = Duration::from_secs(120);
/// Most inputs that are kept because they did something new.
const MOST_KEPT: usize = 4096;
/// Failures after which a target is given up.
const MOST_FAILURES: u64 = 200;

/// Where the last panic was.
static PANICKED_AT: Mutex<String> = Mutex::new(String::new());

/// Mutates the files of `corpus/NAME` and `corpus` for the set time and gives them to `check`, which says what came of
/// it. An input that does something new becomes one to mutate.
///
/// # Panics
/// When `check` does.
pub fn run(name: &str, corpus: Vec<Vec<u8>>, mut check: impl FnMut(&[u8]) -> String) {
    // One after the other: each has the whole machine, and the running case is known if the process ends.
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    prepare();
    if let Ok(input) = std::env::var("GRIDFALL_FUZZ_INPUT") {
        println!("{name}: {}", check(&fs::read(input).unwrap()));
        return;
    }
    let (seconds, seed) = (setting("GRIDFALL_FUZZ_SECONDS", 2.0), setting("GRIDFALL_FUZZ_SEED", 1));
    println!("{name}: {seconds} s, GRIDFALL_FUZZ_SEED={seed}");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("fuzz");
    fs::create_dir_all(&folder).unwrap();
    let running = folder.join(format!("{name}.running"));
    let mut pool: Vec<Vec<u8>> = kept(name).into_iter().chain(corpus).collect();
    let given = pool.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut cases, mut failures, mut slowest) = (0u64, 0u64, Duration::ZERO);
    let (mut outcomes, mut places) = (HashSet::new(), BTreeMap::new());
    let started = Instant::now();
    while cases < given as u64 || started.elapsed().as_secs_f64() < seconds {
        let known = pool.get(cases as usize).filter(|_| cases < given as u64);
        let input = known.cloned().unwrap_or_else(|| mutate::mutated(&pool, &mut rng));
        cases += 1;
        fs::write(&running, &input).unwrap();
        let (watch, begun) = (Watch::new(running.clone()), Instant::now());
        let outcome = panic::catch_unwind(AssertUnwindSafe(|| check(&input)));
        drop(watch);
        slowest = slowest.max(begun.elapsed());
        match outcome {
            Ok(outcome) => {
                if outcomes.insert(shape(&outcome)) && pool.len() < MOST_KEPT {
                    pool.push(input);
                }
            }
            Err(_) => {
                failures += 1;
                let place = PANICKED_AT.lock().unwrap_or_else(PoisonError::into_inner).clone();
                let file = folder.join(format!("{name}-{seed}-{cases}"));
                if let std::collections::btree_map::Entry::Vacant(entry) = places.entry(place) {
                    fs::write(&file, &input).unwrap();
                    println!("repeat: GRIDFALL_FUZZ_INPUT={} tests/run --test fuzz {name}", file.display());
                    entry.insert(file);
                }
                if failures == MOST_FAILURES {
                    break;
                }
            }
        }
    }
    let _ = fs::remove_file(&running);
    println!(
        "{name}: {cases} cases in {:.0} s, {} outcomes, slowest {slowest:.1?}, {failures} failures at {} places",
        started.elapsed().as_secs_f64(),
        outcomes.len(),
        places.len(),
    );
    assert!(places.is_empty(), "{name}: {places:#?}");
}

/// The files of a target in `corpus`, by name.
fn kept(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(name);
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

fn setting<T: FromStr>(name: &str, default: T) -> T {
    std::env::var(name).map_or(default, |text| text.parse().ok().unwrap_or_else(|| panic!("{name}={text}: no number")))
}

fn prepare() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        rlimit::Resource::AS.set(ADDRESS_SPACE, ADDRESS_SPACE).unwrap();
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            *PANICKED_AT.lock().unwrap_or_else(PoisonError::into_inner) = place;
            print(info);
        }));
    });
}

/// What came of a case, without its numbers: what says more than others would else be new every time.
fn shape(outcome: &str) -> String {
    outcome.chars().filter(|c| !c.is_ascii_digit()).take(400).collect()
}

/// Ends the process when a case takes too long.
struct Watch {
    over: Arc<AtomicBool>,
    thread: std::thread::Thread,
}

impl Watch {
    fn new(running: PathBuf) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let seen = over.clone();
        let thread = std::thread::spawn(move || {
            let begun = Instant::now();
            while !seen.load(Ordering::Acquire) {
                if begun.elapsed() > ENDLESS {
                    eprintln!("endless: {}", running.display());
                    std::process::abort();
                }
                std::thread::park_timeout(ENDLESS);
            }
        });
        Self { over, thread: thread.thread().clone() }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        self.thread.unpark();
    }
}
