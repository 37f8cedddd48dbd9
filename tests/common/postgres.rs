//! A PostgreSQL server of the tests' own, gone with the process that started it.

use std::fs;
use std::io::Write;
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A server that listens on a socket in a folder of its own.
pub struct Postgres {
    programs: PathBuf,
    dir: PathBuf,
    shell: Child,
    /// Closed when this process ends, however it does: the server's shell then stops it.
    held: Option<ChildStdin>,
    databases: AtomicUsize,
}

/// The server that the tests of a program share.
pub fn shared() -> &'static Postgres {
    static SHARED: OnceLock<Postgres> = OnceLock::new();
    SHARED.get_or_init(Postgres::start)
}

impl Postgres {
    pub fn start() -> Self {
        let programs = programs();
        let dir = tempfile::tempdir().unwrap().keep();
        if let Some((uid, gid)) = other_user() {
            chown(&dir, Some(uid), Some(gid)).unwrap();
        }
        let made = command(&programs.join("initdb"))
            .args(["--username=gridfall", "--auth=trust", "--encoding=UTF8", "--locale=C", "--no-sync", "-D"])
            .arg(dir.join("data"))
            .current_dir(&dir)
            .output()
            .unwrap();
        assert!(made.status.success(), "initdb: {}", String::from_utf8_lossy(&made.stderr));
        let (shell, held) = serve(&programs, &dir);
        Self { programs, dir, shell, held: Some(held), databases: AtomicUsize::new(0) }
    }

    /// Creates an empty database and returns its URL.
    pub fn database(&self) -> String {
        let name = format!("jobs_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        self.sql("postgres", &format!("CREATE DATABASE {name}"));
        format!("postgres://gridfall@localhost/{name}?host={}", self.dir.display())
    }

    /// What `psql` answers to a statement, without decoration.
    pub fn sql(&self, database: &str, statement: &str) -> String {
        let answer = Command::new(self.programs.join("psql"))
            .args(["-X", "-A", "-t", "-q", "-v", "ON_ERROR_STOP=1", "-U", "gridfall", "-d", database, "-c", statement])
            .arg("-h")
            .arg(&self.dir)
            .output()
            .unwrap();
        assert!(answer.status.success(), "{statement}: {}", String::from_utf8_lossy(&answer.stderr));
        String::from_utf8(answer.stdout).unwrap().trim().to_owned()
    }

    /// Stops the server as a crash would, and keeps its data.
    pub fn stop(&mut self) {
        if let Some(mut held) = self.held.take() {
            held.write_all(b"again\n").unwrap();
            self.shell.wait().unwrap();
        }
    }

    /// Starts it again on the same data.
    pub fn restart(&mut self) {
        let (shell, held) = serve(&self.programs, &self.dir);
        (self.shell, self.held) = (shell, Some(held));
    }
}

/// Starts the server on a folder, and waits until it answers.
fn serve(programs: &Path, dir: &Path) -> (Child, ChildStdin) {
    // Durability is for those who will want their data tomorrow.
    let script = r#""$0" -D "$1/data" -k "$1" -c listen_addresses= -c fsync=off -c full_page_writes=off \
        -c max_connections=200 >"$1/log" 2>&1 & read -r again; kill -QUIT $!; wait; [ "$again" ] || rm -rf "$1""#;
    let mut shell = command(Path::new("/bin/sh"))
        .args(["-c", script])
        .arg(programs.join("postgres"))
        .arg(dir)
        .current_dir(dir)
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let held = shell.stdin.take().unwrap();
    let started = Instant::now();
    while !Command::new(programs.join("pg_isready")).arg("-q").arg("-h").arg(dir).status().unwrap().success() {
        if started.elapsed() > Duration::from_secs(60) {
            panic!("PostgreSQL does not start:\n{}", fs::read_to_string(dir.join("log")).unwrap_or_default());
        }
        sleep(Duration::from_millis(20));
    }
    (shell, held)
}

impl Drop for Postgres {
    fn drop(&mut self) {
        self.held = None;
        let _ = self.shell.wait();
    }
}

/// Where PostgreSQL's programs are. Debian keeps most of them out of the search path.
fn programs() -> PathBuf {
    let versions = fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = versions.map(|version| version.path().join("bin")).collect();
    found.sort();
    let path = std::env::var_os("PATH").unwrap_or_default();
    found.splice(0..0, std::env::split_paths(&path));
    let found = found.into_iter().rfind(|dir| dir.join("initdb").exists() && dir.join("postgres").exists());
    found.expect("PostgreSQL is not installed; tests/run installs it (apt-get install postgresql)")
}

/// PostgreSQL does not run as root.
fn command(program: &Path) -> Command {
    let mut command = Command::new(program);
    if let Some((uid, gid)) = other_user() {
        command.uid(uid).gid(gid);
    }
    command
}

/// Whom root runs PostgreSQL as; `None` for others, who run it themselves.
fn other_user() -> Option<(u32, u32)> {
    let id = Command::new("id").arg("-u").output().unwrap().stdout;
    if id != b"0\n" {
        return None;
    }
    let users = fs::read_to_string("/etc/passwd").unwrap();
    let find = |name: &str| {
        let fields: Vec<&str> =
            users.lines().map(|line| line.split(':')).find(|f| f.clone().next() == Some(name))?.collect();
        Some((fields[2].parse().unwrap(), fields[3].parse().unwrap()))
    };
    Some(find("postgres").or_else(|| find("nobody")).expect("there is a user besides root"))
}
