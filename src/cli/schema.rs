//! `gridfall schema`: the machine-readable contracts.

use std::io::{self, Write};

use clap::{Args, ValueEnum};

use super::CliError;
use gridfall_scene as scene;
use gridfall_service::http;

/// Print the JSON Schema of scenes, the OpenAPI document of the server, or a page of Markdown: what its error codes
/// mean, the reference of scenes, the presets of materials.
#[derive(Debug, Args)]
pub struct Arguments {
    #[arg(value_enum)]
    what: What,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum What {
    Scene,
    Openapi,
    Errors,
    Reference,
    Materials,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let document = match arguments.what {
        What::Scene => scene::contract::json_schema(),
        What::Openapi => http::document_json(),
        What::Errors => http::error_codes(),
        What::Reference => scene::contract::reference_page(),
        What::Materials => scene::presets::page::markdown(),
    };
    match io::stdout().write_all(document.as_bytes()) {
        // A reader such as `head` may close the pipe early.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Failed(error.to_string())),
        _ => Ok(()),
    }
}
