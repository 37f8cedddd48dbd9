//! A program that runs beside the tests, and ends with their process, however that ends.

use std::fs::File;
use std::process::{Child, Command, Stdio};

pub struct Daemon(Child);

impl Daemon {
    /// Starts what a command says, which writes to `log`.
    pub fn start(command: &Command, log: File) -> Self {
        // The shell reads on until the process that holds the other end is gone.
        let script = r#""$@" </dev/null & read -r _; kill -KILL $!; wait"#;
        let mut shell = Command::new("/bin/sh");
        shell.args(["-c", script, "sh"]).arg(command.get_program()).args(command.get_args());
        shell.envs(command.get_envs().filter_map(|(name, value)| Some((name, value?))));
        let child = shell.stdin(Stdio::piped()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap();
        Self(child)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        let _ = self.0.wait();
    }
}
