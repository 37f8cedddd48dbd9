//! What shells know of the program: completions and manual pages.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::CliError;

/// Print what a shell needs to complete the command line.
#[derive(Debug, Args)]
#[command(after_help = "bash: gridfall completions bash > /etc/bash_completion.d/gridfall\n\
    zsh:  gridfall completions zsh > \"${fpath[1]}/_gridfall\"\n\
    fish: gridfall completions fish > ~/.config/fish/completions/gridfall.fish")]
pub struct CompletionArguments {
    #[arg(value_enum)]
    shell: Shell,
}

/// Write the manual pages of all commands, or print that of the program.
#[derive(Debug, Args)]
#[command(after_help = "gridfall man | man -l -\n\
    gridfall man -o /usr/local/share/man/man1")]
pub struct ManArguments {
    /// Write a page a command into this folder.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub fn completions(arguments: CompletionArguments) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut super::Arguments::command(), "gridfall", &mut script);
    print(&script)
}

pub fn man(arguments: ManArguments) -> Result<(), CliError> {
    let command = super::Arguments::command();
    let failed = |error: io::Error| CliError::Failed(format!("cannot write the manual: {error}"));
    let Some(folder) = arguments.output else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page).map_err(failed)?;
        return print(&page);
    };
    std::fs::create_dir_all(&folder).and_then(|()| clap_mangen::generate_to(command, &folder)).map_err(failed)
}

fn print(text: &[u8]) -> Result<(), CliError> {
    match io::stdout().write_all(text) {
        // A reader such as `head` may close the pipe early.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Failed(error.to_string())),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_a_page() {
        let folder = tempfile::tempdir().unwrap();
        man(ManArguments { output: Some(folder.path().join("man1")) }).unwrap();
        for command in crate::cli::Arguments::command().get_subcommands() {
            let page = folder.path().join(format!("man1/gridfall-{}.1", command.get_name()));
            assert!(std::fs::read_to_string(&page).unwrap().contains("DESCRIPTION"), "{}", page.display());
        }
    }
}
