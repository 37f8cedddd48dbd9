//! A PVD: the files of a series with their times, which ParaView opens as one.

use std::fmt::Write;
use std::path::Path;

use crate::files::{RecordingError, write_file};

/// Files in one folder, with their times (s).
#[derive(Clone, Debug, Default)]
pub struct Series(Vec<(f64, String)>);

impl Series {
    /// Adds a file by its name in the folder.
    pub fn add(&mut self, time_s: f64, name: &str) {
        self.0.push((time_s, name.to_owned()));
    }

    /// Writes the list into the folder of its files.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), RecordingError> {
        let mut text = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
             <Collection>\n",
        );
        for (time_s, name) in &self.0 {
            let file = escaped(name);
            writeln!(text, r#"<DataSet timestep="{time_s}" group="" part="0" file="{file}"/>"#)
                .expect("a string grows");
        }
        text += "</Collection>\n</VTKFile>\n";
        write_file(path, text.as_bytes())
    }
}

/// Fit for an attribute of XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
