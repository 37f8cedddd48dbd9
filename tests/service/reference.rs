//! The reference shows what it describes: an example and a picture of each shape and material.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gridfall_scene::{self as scene, Limits, presets};
use serde_json::{Value, json};

use crate::guide::{merge, pages};

/// Most bytes of a picture, and of all.
const MOST: u64 = 25_000;
const MOST_OF_ALL: u64 = 1_500_000;
/// Fewer colours show nothing.
const LEAST_COLOURS: usize = 12;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn schema() -> Value {
    serde_json::from_str(&scene::contract::json_schema()).unwrap()
}

fn shapes() -> BTreeSet<String> {
    schema()["$defs"]["Shape"]["properties"].as_object().unwrap().keys().cloned().collect()
}

/// Models that no preset follows, which have pictures of their own.
fn models_alone() -> BTreeSet<String> {
    let schema = schema();
    let models = schema["$defs"]["Material"]["properties"]["model"]["enum"].as_array().unwrap();
    let models = models.iter().map(|model| model.as_str().unwrap());
    models.filter(|model| presets::all().all(|preset| preset.model != *model)).map(str::to_owned).collect()
}

fn pictures(folder: &str) -> Vec<PathBuf> {
    let folder = root().join("docs/guide/pictures").join(folder);
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

fn stems(pictures: &[PathBuf]) -> BTreeSet<String> {
    pictures.iter().map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
}

#[test]
fn every_shape_and_material_has_its_picture_and_every_picture_is_shown() {
    let (of_shapes, of_materials) = (pictures("shapes"), pictures("materials"));
    assert_eq!(stems(&of_shapes), shapes(), "docs/guide/pictures/make.py draws what is missing");
    let named = presets::all().map(|preset| preset.name.to_owned()).chain(models_alone()).collect();
    assert_eq!(stems(&of_materials), named, "docs/guide/pictures/make.py draws what is missing");
    let read = |page: &str| std::fs::read_to_string(root().join("docs").join(page)).unwrap();
    let (reference, list) = (read("guide/scene.md"), read("PRESETS.md"));
    for shape in shapes() {
        assert!(reference.contains(&format!("![{shape}](pictures/shapes/{shape}.png)")), "{shape}");
    }
    for preset in presets::all() {
        assert!(list.contains(&format!("](guide/pictures/materials/{}.png)", preset.name)), "{}", preset.name);
        assert!(reference.contains(&format!("### {}\n", preset.model)), "{}", preset.model);
    }
    for model in models_alone() {
        assert!(reference.contains(&format!("](pictures/materials/{model}.png)")), "{model}");
    }
}

#[test]
fn pictures_are_small_and_show_something() {
    let all = [pictures("shapes"), pictures("materials")].concat();
    let mut bytes = 0;
    for path in &all {
        let size = path.metadata().unwrap().len();
        assert!(size <= MOST, "{} has {size} bytes", path.display());
        bytes += size;
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut decoder = png::Decoder::new(file);
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (360, 240), "{}", path.display());
        // What is in the middle third, where things are.
        let width = 3 * info.width as usize;
        let rows = pixels.chunks(width).skip(80).take(80).flat_map(|row| row[width / 3..2 * width / 3].chunks(3));
        let colours: BTreeSet<&[u8]> = rows.collect();
        assert!(colours.len() >= LEAST_COLOURS, "{} has {} colours in its middle", path.display(), colours.len());
    }
    assert!(bytes <= MOST_OF_ALL, "{bytes} bytes of pictures");
}

#[test]
fn the_examples_of_shapes_and_materials_are_valid() {
    let text = std::fs::read_to_string(root().join("scenes/quickstart.json")).unwrap();
    let quickstart: Value = serde_json::from_str(&text).unwrap();
    let (mut examples, mut marked) = (0, BTreeSet::new());
    for (name, mark, code) in pages()
        .into_iter()
        .flat_map(|(name, blocks)| blocks.into_iter().map(move |(mark, code)| (name.clone(), mark, code)))
    {
        let value: Value = match mark.as_str() {
            "json shape" | "json material" => serde_json::from_str(&code).unwrap(),
            _ => continue,
        };
        let mut document = quickstart.clone();
        let patch = match mark.as_str() {
            // A collider may have any shape, a half-space too.
            "json shape" => {
                json!({ "colliders": [{ "name": "it", "contact": "separate", "shape": value }],
                    "bodies": [{ "name": "it", "material": "jelly",
                                 "shape": { "box": { "min": [0.1, 0.1, 0.1], "max": [0.2, 0.2, 0.2] } } }] })
            }
            _ => json!({ "materials": { "water": value } }),
        };
        // The whole material, and not what was there before as well.
        document["materials"]["water"] = Value::Null;
        merge(&mut document, json!({ "materials": { "water": { "preset": "water" } } }));
        if mark == "json material" {
            document["materials"]["water"] = Value::Null;
        }
        merge(&mut document, patch);
        let judged = scene::from_value(&document);
        assert!(judged.is_ok(), "docs/guide/{name}.md: {:?}\n{code}", judged.err());
        // A mesh names a file, which is not there.
        if !code.contains("\"file\"") {
            let judged = scene::problem(&judged.unwrap(), &Limits::default());
            assert!(judged.is_ok(), "docs/guide/{name}.md: {:?}\n{code}", judged.err());
        }
        marked.insert(mark);
        examples += 1;
    }
    assert!(examples >= shapes().len() + 9 && marked.len() == 2, "only {examples} examples");
}

/// Definitions of the schema by name, with the document itself as `Scene`.
fn definitions() -> Vec<(String, Value)> {
    let mut schema = schema();
    let mut found: Vec<_> = schema["$defs"].as_object().unwrap().clone().into_iter().collect();
    schema.as_object_mut().unwrap().remove("$defs");
    found.push(("Scene".into(), schema));
    found
}

#[test]
fn editors_can_explain_every_field() {
    let definitions = definitions();
    let find = |name: &str| &definitions.iter().find(|(known, _)| known == name).unwrap().1;
    let mut missing = Vec::new();
    for (name, definition) in &definitions {
        for member in ["title", "description"] {
            if definition[member].as_str().is_none_or(str::is_empty) {
                missing.push(format!("{name}: {member}"));
            }
        }
        let required = definition["required"].as_array().cloned().unwrap_or_default();
        for (field, schema) in definition["properties"].as_object().into_iter().flatten() {
            let at = format!("{name}.{field}");
            for member in ["title", "description"] {
                if schema[member].as_str().is_none_or(str::is_empty) {
                    missing.push(format!("{at}: {member}"));
                }
            }
            if field == "$comment" {
                continue;
            }
            // Its own, or of what it refers to; choices explain themselves.
            let referred = schema["$ref"].as_str().map(|path| find(path.rsplit('/').next().unwrap()));
            let shown = |schema: &Value| {
                ["examples", "default", "const", "enum"].iter().any(|member| !schema[*member].is_null())
            };
            if !shown(schema) && !referred.is_some_and(shown) {
                missing.push(format!("{at}: example"));
            }
            let said = schema["description"].as_str().unwrap_or_default();
            let about = definition["description"].as_str().unwrap_or_default();
            // What is left out has a value, or a meaning in words: that of the preset, one of several, nothing.
            let optional = !required.contains(&json!(field)) && schema["default"].is_null();
            let words = ["default", "without", "in the place of", "nothing depends on it"];
            let of_all = ["Give one of", "replaces its values", "A closed shape"];
            if optional
                && !words.iter().any(|word| said.contains(word))
                && !of_all.iter().any(|words| about.contains(words))
            {
                missing.push(format!("{at}: neither a default nor what it means without"));
            }
        }
    }
    assert!(missing.is_empty(), "\n{}", missing.join("\n"));
}
