//! [`Row`] and [`SolverRow`] as the protobuf messages of `api/gridfall_diagnostics.proto`.
//!
//! Field numbers are column positions from 1, so new columns must be added at the end. The
//! surfaces, which differ from scene to scene, are a repeated field with a much higher number. A
//! test compares the messages with the file.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use gridfall_core::sim::diagnostics::{Row, SolverRow, Value};

/// Full name of a frame's message.
pub const SCHEMA_NAME: &str = "gridfall.Diagnostics";

/// Full name of an implicit step's message.
pub const SOLVER_SCHEMA_NAME: &str = "gridfall.SolverStep";

/// The schema of both messages as MCAP expects it.
pub fn schema() -> Vec<u8> {
    descriptor_set().encode_to_vec()
}

/// Number of the field that lists the surfaces.
const REACTIONS: u32 = 100;

/// Fields of a surface's message, after its name.
const QUANTITIES: [&str; 6] = ["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z"];

/// The reaction of a surface, as a message.
#[derive(Clone, PartialEq, Message)]
struct ReactionMessage {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(double, tag = "2")]
    force_x: f64,
    #[prost(double, tag = "3")]
    force_y: f64,
    #[prost(double, tag = "4")]
    force_z: f64,
    #[prost(double, tag = "5")]
    torque_x: f64,
    #[prost(double, tag = "6")]
    torque_y: f64,
    #[prost(double, tag = "7")]
    torque_z: f64,
}

fn descriptor_set() -> FileDescriptorSet {
    let field = |((name, kind), number): ((&&str, Type), i32)| FieldDescriptorProto {
        name: Some(name.to_string()),
        json_name: Some(json_name(name)),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..Default::default()
    };
    let reactions = FieldDescriptorProto {
        label: Some(Label::Repeated.into()),
        type_name: Some(".gridfall.Reaction".into()),
        ..field(((&"reactions", Type::Message), REACTIONS as i32))
    };
    let columns = |names: &'static [&str], values: &[Value]| -> Vec<FieldDescriptorProto> {
        let types = values.iter().map(|value| match value {
            Value::Count(_) => Type::Uint64,
            Value::Real(_) => Type::Double,
            Value::Flag(_) => Type::Bool,
        });
        names.iter().zip(types).zip(1..).map(field).collect()
    };
    let frame = columns(Row::COLUMNS, &Row::default().values());
    let step = columns(SolverRow::COLUMNS, &SolverRow::default().values());
    let quantities = QUANTITIES.iter().map(|name| (name, Type::Double));
    let reaction = [(&"name", Type::String)].into_iter().chain(quantities).zip(1..).map(field).collect();
    FileDescriptorSet {
        file: vec![FileDescriptorProto {
            name: Some("gridfall_diagnostics.proto".into()),
            package: Some("gridfall".into()),
            message_type: vec![
                DescriptorProto {
                    name: Some("Diagnostics".into()),
                    field: frame.into_iter().chain([reactions]).collect(),
                    ..Default::default()
                },
                DescriptorProto { name: Some("Reaction".into()), field: reaction, ..Default::default() },
                DescriptorProto { name: Some("SolverStep".into()), field: step, ..Default::default() },
            ],
            syntax: Some("proto3".into()),
            ..Default::default()
        }],
    }
}

/// The JSON name that protobuf compilers derive: camel case.
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

/// A step as a protobuf message.
pub fn encode_solver(row: &SolverRow) -> Vec<u8> {
    encode_values(&row.values())
}

/// Values as the fields from number 1.
fn encode_values(values: &[Value]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(16 * values.len());
    for (value, number) in values.iter().zip(1..) {
        match value {
            Value::Count(n) => prost::encoding::uint64::encode(number, n, &mut bytes),
            Value::Real(x) => prost::encoding::double::encode(number, x, &mut bytes),
            Value::Flag(flag) => prost::encoding::bool::encode(number, flag, &mut bytes),
        }
    }
    bytes
}

/// The row as a protobuf message.
pub fn encode(row: &Row) -> Vec<u8> {
    let mut bytes = encode_values(&row.values());
    for (surface, reaction) in &row.reactions {
        let ([force_x, force_y, force_z], [torque_x, torque_y, torque_z]) = (reaction.force, reaction.torque);
        let name = surface.name.clone();
        let message = ReactionMessage { name, force_x, force_y, force_z, torque_x, torque_y, torque_z };
        prost::encoding::message::encode(REACTIONS, &message, &mut bytes);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_proto_file_describes_the_messages() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../api/gridfall_diagnostics.proto");
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../api");
        let mut compiled = protox::compile([path], [root]).unwrap();
        compiled.file.iter_mut().for_each(|file| file.source_code_info = None);
        assert_eq!(compiled, descriptor_set());
    }
}
