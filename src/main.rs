use std::process::ExitCode;

fn main() -> ExitCode {
    gridfall::cli::main()
}
