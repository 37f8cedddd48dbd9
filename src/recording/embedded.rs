//! What a recording carries of its scene.

use mcap::records::Record;

/// Name of the attachment that is the scene's document.
pub const SCENE: &str = "scene.json";

/// Name of the metadata with the names of bodies and sources, by their numbers.
pub const BODIES: &str = "bodies";

/// Whether the bytes begin as a recording does.
pub fn is_recording(bytes: &[u8]) -> bool {
    bytes.starts_with(mcap::MAGIC)
}

/// The document of the scene of a recording, of which the beginning is enough: what is before the first frame.
///
/// # Errors
/// What is wrong with the recording, or that its scene is not in these bytes.
pub fn scene(recording: &[u8]) -> Result<String, String> {
    let records =
        mcap::read::LinearReader::sans_magic(recording.strip_prefix(mcap::MAGIC).ok_or("it is no MCAP file")?);
    for record in records {
        match record.map_err(|error| format!("its scene is not in these {} bytes: {error}", recording.len()))? {
            Record::Attachment { header, data, .. } if header.name == SCENE => {
                return String::from_utf8(data.into_owned()).map_err(|error| format!("its scene is no text: {error}"));
            }
            Record::Chunk { .. } | Record::DataEnd(_) => break,
            _ => {}
        }
    }
    Err("it has no scene: it was not written by Gridfall".into())
}
