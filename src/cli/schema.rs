//! `gridfall schema`: the machine-readable contracts.

use clap::{Args, ValueEnum};

use super::CliError;
use crate::{http, scene};

/// Print the JSON Schema of scenes or the OpenAPI document of the server.
#[derive(Debug, Args)]
pub struct Arguments {
    #[arg(value_enum)]
    what: What,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum What {
    Scene,
    Openapi,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    match arguments.what {
        What::Scene => print!("{}", scene::schema::json_schema()),
        What::Openapi => print!("{}", http::document_json()),
    }
    Ok(())
}
