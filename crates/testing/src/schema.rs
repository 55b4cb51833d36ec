//! `docs/*.schema.json`, made from the types of what is printed.

use std::collections::BTreeSet;
use std::env;
use std::fs;
use std::path::PathBuf;

use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value};

/// Where readers find the files.
const ADDRESS: &str = "https://github.com/impinge-rs/impinge/blob/main/docs";

/// Set if the files are to be written rather than compared.
const WRITE: &str = "IMPINGE_WRITE_SCHEMAS";

/// The schema of what `T` is printed as. Documentation is its title and the descriptions of its
/// parts, and no key is there that is not described.
fn of<T: JsonSchema>(name: &str) -> Value {
    let mut settings = SchemaSettings::draft2020_12().for_serialize();
    settings.inline_subschemas = true;
    let mut made = settings.into_generator().into_root_schema_for::<T>();
    RecursiveTransform(plain).transform(&mut made);
    let mut schema = Map::new();
    let mut put = |key: &str, value: Value| schema.insert(key.to_owned(), value);
    put("$schema", SchemaSettings::draft2020_12().meta_schema.into());
    put("$id", format!("{ADDRESS}/{name}.schema.json").into());
    let title = made.remove("description");
    put("title", title.unwrap_or_default());
    for (key, value) in made.as_object().into_iter().flatten() {
        schema.entry(key).or_insert_with(|| value.clone());
    }
    Value::Object(schema)
}

/// Holds `docs/NAME.schema.json` to what `T` is printed as, or writes it if
/// `IMPINGE_WRITE_SCHEMAS` is set.
///
/// # Panics
/// If the file says something else.
pub fn hold<T: JsonSchema>(name: &str) {
    let path = path(name);
    let text = format!("{:#}\n", of::<T>(name));
    if env::var_os(WRITE).is_some() {
        fs::write(&path, text).unwrap();
        return;
    }
    assert_eq!(
        fs::read_to_string(&path).unwrap_or_default(),
        text,
        "docs/{name}.schema.json is not what is printed: set {WRITE}=1 to write it"
    );
}

/// `docs/NAME.schema.json`.
///
/// # Panics
/// If there is no such file, or it holds no JSON.
pub fn read(name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(path(name)).unwrap()).unwrap()
}

/// The names of all descriptions.
///
/// # Panics
/// If there is no folder of documents.
pub fn names() -> BTreeSet<String> {
    let files = fs::read_dir(folder()).unwrap();
    let names = files.filter_map(|file| {
        let name = file.unwrap().file_name().into_string().ok()?;
        Some(name.strip_suffix(".schema.json")?.to_owned())
    });
    names.collect()
}

fn path(name: &str) -> PathBuf {
    folder().join(format!("{name}.schema.json"))
}

fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs"))
}

/// Leaves out what only Rust knows of numbers, and says that nothing else is there.
fn plain(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else {
        return;
    };
    object.shift_remove("format");
    if let Some(Value::String(text)) = object.get_mut("description") {
        *text = text.replace('\n', " ");
    }
    if object.contains_key("properties") {
        object
            .entry("additionalProperties")
            .or_insert(Value::Bool(false));
    }
    // What is left out rather than null is never null.
    let required: Vec<Value> = match object.get("required") {
        Some(Value::Array(keys)) => keys.clone(),
        _ => Vec::new(),
    };
    let properties = object.get_mut("properties").and_then(Value::as_object_mut);
    for (key, of) in properties.into_iter().flatten() {
        if !required.contains(&Value::String(key.clone())) {
            never_null(of);
        }
    }
}

fn never_null(schema: &mut Value) {
    let Some(object) = schema.as_object_mut() else {
        return;
    };
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|name| name != "null");
        if let [only] = &types[..] {
            let only = only.clone();
            object.insert("type".to_owned(), only);
        }
    }
    if let Some(Value::Array(cases)) = object.get_mut("anyOf") {
        cases.retain(|case| case.get("type") != Some(&Value::from("null")));
        if let [only] = &cases[..] {
            let only = only.clone();
            object.shift_remove("anyOf");
            for (key, value) in only.as_object().into_iter().flatten() {
                object.entry(key).or_insert_with(|| value.clone());
            }
        }
    }
}
