//! [`Row`] as the protobuf message of `api/gridfall_diagnostics.proto`.
//!
//! Field numbers are column positions from 1, so columns may only be added at the end; a test compares with the file.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use crate::sim::diagnostics::{Row, Value};

/// Full name of the message.
pub const SCHEMA_NAME: &str = "gridfall.Diagnostics";

/// The message's schema as MCAP wants it.
pub fn schema() -> Vec<u8> {
    descriptor_set().encode_to_vec()
}

fn descriptor_set() -> FileDescriptorSet {
    let types = Row::default().values().map(|value| match value {
        Value::Count(_) => Type::Uint64,
        Value::Real(_) => Type::Double,
    });
    let field = |((name, kind), number): ((&&str, Type), i32)| FieldDescriptorProto {
        name: Some(name.to_string()),
        json_name: Some(json_name(name)),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..Default::default()
    };
    FileDescriptorSet {
        file: vec![FileDescriptorProto {
            name: Some("gridfall_diagnostics.proto".into()),
            package: Some("gridfall".into()),
            message_type: vec![DescriptorProto {
                name: Some("Diagnostics".into()),
                field: Row::COLUMNS.iter().zip(types).zip(1..).map(field).collect(),
                ..Default::default()
            }],
            syntax: Some("proto3".into()),
            ..Default::default()
        }],
    }
}

/// The name that protobuf compilers derive for JSON: camel case.
fn json_name(name: &str) -> String {
    let mut camel = String::new();
    let mut upper = false;
    for c in name.chars() {
        if c != '_' {
            camel.push(if upper { c.to_ascii_uppercase() } else { c });
        }
        upper = c == '_';
    }
    camel
}

/// The row as a protobuf message.
pub fn encode(row: &Row) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(16 * Row::COLUMNS.len());
    for (value, number) in row.values().into_iter().zip(1..) {
        match value {
            Value::Count(n) => prost::encoding::uint64::encode(number, &n, &mut bytes),
            Value::Real(x) => prost::encoding::double::encode(number, &x, &mut bytes),
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_proto_file_describes_the_messages() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/api/gridfall_diagnostics.proto");
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/api");
        let mut compiled = protox::compile([path], [root]).unwrap();
        compiled.file.iter_mut().for_each(|file| file.source_code_info = None);
        assert_eq!(compiled, descriptor_set());
    }
}
