//! JSON text to a value. Unlike plain serde_json, which silently drops one of two equal keys, it
//! reports keys that occur twice.

use std::cell::RefCell;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

use crate::fault::{Fault, join};

/// Reads a JSON document. A fault of syntax names line and column; there is at most one.
pub fn read(text: &str) -> Result<Value, Vec<Fault>> {
    let duplicates = RefCell::new(Vec::new());
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let value = Node { pointer: String::new(), duplicates: &duplicates }
        .deserialize(&mut deserializer)
        .and_then(|value| deserializer.end().map(|()| value))
        .map_err(|e| vec![syntax(&e)])?;
    let duplicates = duplicates.into_inner();
    if duplicates.is_empty() { Ok(value) } else { Err(duplicates) }
}

fn syntax(error: &serde_json::Error) -> Fault {
    let text = error.to_string();
    let what = text.split(" at line ").next().unwrap_or(&text);
    let place = format!("line {}, column {}", error.line(), error.column());
    let (code, reason, remedy) = if what.starts_with("number out of range") {
        ("not_finite", format!("a number is too large at {place}"), "write a number below 1e308".into())
    } else if what.starts_with("recursion limit") {
        ("too_deep", format!("values are nested too deeply at {place}"), "nest shapes less deeply".into())
    } else {
        ("syntax", format!("not valid JSON: {what} at {place}"), "correct the JSON there".to_owned())
    };
    Fault { pointer: String::new(), code, reason, remedy }
}

/// Reads the value at `pointer`.
struct Node<'a> {
    pointer: String,
    duplicates: &'a RefCell<Vec<Fault>>,
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }
    fn visit_bool<E: Error>(self, v: bool) -> Result<Value, E> {
        Ok(Value::Bool(v))
    }
    fn visit_i64<E: Error>(self, v: i64) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_u64<E: Error>(self, v: u64) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_f64<E: Error>(self, v: f64) -> Result<Value, E> {
        Number::from_f64(v).map(Value::Number).ok_or_else(|| E::custom("number out of range"))
    }
    fn visit_str<E: Error>(self, v: &str) -> Result<Value, E> {
        Ok(v.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        let node = |n| Node { pointer: join(&self.pointer, n), duplicates: self.duplicates };
        while let Some(value) = items.next_element_seed(node(values.len()))? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            let pointer = join(&self.pointer, &key);
            let value = entries.next_value_seed(Node { pointer: pointer.clone(), duplicates: self.duplicates })?;
            if map.insert(key, value).is_some() {
                self.duplicates.borrow_mut().push(Fault {
                    pointer,
                    code: "duplicate_key",
                    reason: "the same key occurs twice in one object".into(),
                    remedy: "keep one of the two, or rename one".into(),
                });
            }
        }
        Ok(Value::Object(map))
    }
}
