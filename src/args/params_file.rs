//! A parameter file of ROS 2: node names (or patterns), perhaps below their namespaces, `ros__parameters` below each, names
//! and values below that, all of them as often as they stand there; and what a nested value stands for, in a file or behind
//! `-p`.

use std::io::ErrorKind;
use std::path::Path;

use ros2args::{ParamAssignment, Ros2ArgsError};
use yaml_rust2::Yaml;

use super::{ArgsError, repeats};
use crate::config::{self, Value};
use crate::yaml;

/// Longest name of a parameter, and of a node or its pattern (bytes): it is copied for each value below it.
pub(super) const MAX_NAME_BYTES: usize = 256;

/// Key of the parameters below a node's name.
const PARAMETERS: &str = "ros__parameters";

/// Letters that are said of a name that is too long.
const SHOWN: usize = 32;

/// Most parts of a pattern of node names: matching follows them by recursion.
const MAX_PARTS: usize = 32;

/// What a file assigns, in its order.
///
/// # Errors
/// Where the file cannot be read, is no YAML within bounds, has several documents, or another shape.
pub(super) fn assignments(path: &Path) -> Result<Vec<ParamAssignment>, Ros2ArgsError> {
    let refused = |what: String| Ros2ArgsError::ParamFileParseError(path.to_owned(), what);
    let text = yaml::read(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => Ros2ArgsError::ParamFileNotFound(path.to_owned()),
        _ => refused(error.to_string()),
    })?;
    let documents = repeats::load(&text).map_err(|error| refused(error.to_string()))?;
    let document = match &documents[..] {
        [] => return Ok(Vec::new()),
        [document] => document,
        more => return Err(refused(format!("it has {} documents of YAML; one is read", more.len()))),
    };
    let nodes = document.as_hash().ok_or_else(|| refused("it must hold names of nodes".to_owned()))?;
    let mut assigned = Vec::new();
    for (key, about) in nodes {
        read_node("", key, about, &mut assigned).map_err(refused)?;
    }
    Ok(assigned)
}

/// Reads what stands below a key that names a node, or a namespace with further names below it.
fn read_node(
    namespace: &str,
    key: &Yaml,
    about: &Yaml,
    assigned: &mut Vec<ParamAssignment>,
) -> Result<(), String> {
    let key = repeats::name(key).ok_or("the name of a node must be a text")?;
    let node = if namespace.is_empty() { key.to_owned() } else { format!("{namespace}/{key}") };
    if node.len() > MAX_NAME_BYTES {
        let bytes = node.len();
        return Err(format!("the name of a node has {bytes} bytes; at most {MAX_NAME_BYTES} are read"));
    }
    if node.split('/').count() > MAX_PARTS {
        return Err(format!("the name of a node has more than {MAX_PARTS} parts"));
    }
    let below = about.as_hash().filter(|below| !below.is_empty());
    let below = below.ok_or_else(|| format!("node `{node}` must have a map `{PARAMETERS}`"))?;
    for (key, about) in below {
        match repeats::name(key) {
            Some(PARAMETERS) => read_parameters(&node, about, assigned)?,
            // As a namespace it would be refused further below, and not by what is wrong.
            Some(near) if is_misspelt(near) => {
                return Err(format!("below node `{node}` stands `{near}`, where `{PARAMETERS}` is meant"));
            }
            _ => read_node(&node, key, about, assigned)?,
        }
    }
    Ok(())
}

/// Whether a name is hardly another one than [`PARAMETERS`].
fn is_misspelt(name: &str) -> bool {
    // The distance of a long name would take long.
    name.len() < 2 * PARAMETERS.len() && strsim::levenshtein(name, PARAMETERS) <= 2
}

fn read_parameters(node: &str, about: &Yaml, assigned: &mut Vec<ParamAssignment>) -> Result<(), String> {
    let parameters = about.as_hash();
    let parameters = parameters.ok_or_else(|| format!("node `{node}` must have a map `{PARAMETERS}`"))?;
    for (name, value) in parameters {
        // As in ROS, what reads like a number is a name here. One that has come before keeps its mark: see `flatten`.
        let name = name.as_str().map_or_else(|| shown(name), str::to_owned);
        assigned.push(ParamAssignment::new_node_specific(node.into(), name, value.clone()));
    }
    Ok(())
}

/// Adds a value under its name, and to `repeated` a name that has come before in its map; a nested map stands for names joined by dots.
///
/// # Errors
/// At a name that is too long, and at a value of a type that no parameter has.
pub(super) fn flatten(
    name: String,
    value: &Yaml,
    values: &mut Vec<(String, Value)>,
    repeated: &mut Vec<String>,
) -> Result<(), ArgsError> {
    let name = repeats::unmarked(&name).map(str::to_owned).map_or(name, |name| {
        repeated.push(name.clone());
        name
    });
    if name.len() > MAX_NAME_BYTES {
        return Err(ArgsError::LongName { begin: name.chars().take(SHOWN).collect(), bytes: name.len() });
    }
    let value = match value {
        Yaml::Boolean(value) => Value::Boolean(*value),
        Yaml::Integer(value) => Value::Integer(*value),
        Yaml::Real(text) => match value.as_f64() {
            Some(value) => Value::Double(value),
            None => Value::Text(text.clone()),
        },
        Yaml::String(value) => Value::Text(value.clone()),
        Yaml::Array(list) => match list.iter().map(|text| text.as_str().map(str::to_owned)).collect() {
            Some(texts) => Value::TextList(texts),
            None => return Err(of_no_type(name, value)),
        },
        Yaml::Hash(map) => {
            return map.iter().try_for_each(|(key, value)| {
                let key = key.as_str().map_or_else(|| shown(key), str::to_owned);
                flatten(format!("{name}.{key}"), value, values, repeated)
            });
        }
        other => return Err(of_no_type(name, other)),
    };
    values.push((name, value));
    Ok(())
}

fn of_no_type(name: String, value: &Yaml) -> ArgsError {
    let must = config::must_be(&name);
    let must = must.unwrap_or_else(|| "a boolean, a number, a text or a list of texts".to_owned());
    ArgsError::Type { name, value: shown(value), must }
}

/// Elements of a list that are said of a value that cannot be.
const SHOWN_ELEMENTS: usize = 8;

/// A value as YAML writes it, or as much of it as can be read in an error.
fn shown(value: &Yaml) -> String {
    match value {
        Yaml::Real(text) => text.clone(),
        Yaml::Integer(value) => value.to_string(),
        Yaml::Boolean(value) => value.to_string(),
        Yaml::String(text) => format!("{text:?}"),
        Yaml::Null => "null".to_owned(),
        Yaml::Array(list) => {
            let mut elements: Vec<_> = list.iter().take(SHOWN_ELEMENTS).map(shown).collect();
            elements.extend((list.len() > SHOWN_ELEMENTS).then(|| "...".to_owned()));
            format!("[{}]", elements.join(", "))
        }
        Yaml::Hash(_) => "{...}".to_owned(),
        Yaml::Alias(_) | Yaml::BadValue => "no value".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a file of this text assigns.
    fn of_text(text: &str) -> Result<Vec<ParamAssignment>, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("params.yaml");
        std::fs::write(&file, text).unwrap();
        assignments(&file).map_err(|error| error.to_string())
    }

    /// What a value of this text stands for as the parameter `a`.
    fn flat(text: &str) -> Result<Vec<(String, Value)>, String> {
        let mut values = Vec::new();
        let flattened = flatten("a".to_owned(), &yaml::load(text).unwrap()[0], &mut values, &mut Vec::new());
        flattened.map(|()| values).map_err(|error| error.to_string())
    }

    #[test]
    fn a_second_document_is_refused_with_their_number() {
        let one = "/**: {ros__parameters: {depth: 3}}\n";
        assert_eq!(of_text(&format!("---\n{one}")).unwrap().len(), 1);
        let error = of_text(&format!("{one}---\n{one}---\n{one}")).unwrap_err();
        assert!(error.ends_with("it has 3 documents of YAML; one is read"), "{error}");
    }

    #[test]
    fn names_below_namespaces_are_joined_to_those_of_nodes() {
        let of = |text: &str| -> Vec<_> {
            let assigned = of_text(text).unwrap().into_iter();
            assigned.map(|param| format!("{}:{}", param.node_name.unwrap_or_default(), param.name)).collect()
        };
        let table: [(&str, &[&str]); 5] = [
            ("cfodi: {ros__parameters: {a: 1, b: 2}}", &["cfodi:a", "cfodi:b"]),
            ("robot: {cfodi: {ros__parameters: {a: 1}}}", &["robot/cfodi:a"]),
            ("/robot: {left: {cfodi: {ros__parameters: {a: 1}}}}", &["/robot/left/cfodi:a"]),
            ("/**: {cfodi: {ros__parameters: {a: 1}}, ros__parameters: {b: 1}}", &["/**/cfodi:a", "/**:b"]),
            ("cfodi: {ros__parameters: {}}", &[]),
        ];
        for (text, assigned) in table {
            assert_eq!(of(text), assigned, "{text}");
        }
        for text in
            ["a: {b: 3}", "a: {b: {}}", "a: {b: {c: [ros__parameters]}}", "a: {3: {ros__parameters: {}}}"]
        {
            assert!(of_text(text).is_err(), "{text}");
        }
        let error =
            of_text(&format!("{}: {{{}: {{ros__parameters: {{a: 1}}}}}}", "x".repeat(200), "y".repeat(56)));
        assert!(error.unwrap_err().ends_with("has 257 bytes; at most 256 are read"));
    }

    #[test]
    fn a_parameter_that_stands_twice_in_one_map_is_told_and_one_of_two_sections_is_not() {
        let of = |text: &str| {
            let (mut values, mut repeated) = (Vec::new(), Vec::new());
            for param in of_text(text).unwrap() {
                flatten(param.name, &param.value, &mut values, &mut repeated).unwrap();
            }
            (values, repeated)
        };
        let both = [3, 4].map(|depth| ("depth".to_owned(), Value::Integer(depth)));
        let (values, repeated) = of("/**: {ros__parameters: {depth: 3, depth: 4}}");
        assert_eq!((&values[..], &repeated[..]), (&both[..], &["depth".to_owned()][..]));
        let (_, repeated) = of("/**: {ros__parameters: {front: {kind: cloud, kind: depth}}}");
        assert_eq!(repeated, ["front.kind"]);
        let sections = of("/**: {ros__parameters: {depth: 3}}\n/**: {ros__parameters: {depth: 4}}");
        assert_eq!(sections, (both.to_vec(), Vec::new()));
        let (nul, _) = of("/**: {ros__parameters: {\"depth\\0x\": 3}}");
        assert_eq!(nul, [("depth\0x".to_owned(), Value::Integer(3))], "no name of ours");
    }

    #[test]
    fn a_misspelt_key_of_parameters_is_told_with_the_right_one() {
        for key in ["ros_parameters", "ros__parameter", "ros__paramters"] {
            let error = of_text(&format!("/**: {{{key}: {{depth: 3}}}}")).unwrap_err();
            let said = error.contains(&format!("`{key}`")) && error.contains("`ros__parameters` is meant");
            assert!(said, "{error}");
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_not_said_to_be_no_yaml() {
        let error = assignments(Path::new("/nowhere/params.yaml")).unwrap_err();
        assert!(matches!(&error, Ros2ArgsError::ParamFileNotFound(_)), "{error}");
        assert!(error.to_string().contains("/nowhere/params.yaml"), "{error}");
    }

    #[test]
    fn a_node_of_a_long_name_or_of_many_parts_is_refused() {
        let of_node = |name: &str| of_text(&format!("{name}: {{ros__parameters: {{a: 1, b: 2}}}}\n"));
        assert_eq!(of_node(&"y".repeat(256)).unwrap().len(), 2);
        let error = of_node(&"y".repeat(257)).unwrap_err();
        assert!(error.ends_with("the name of a node has 257 bytes; at most 256 are read"), "{error}");
        let error = of_node(&"/**".repeat(32)).unwrap_err();
        assert!(error.ends_with("has more than 32 parts"), "{error}");
    }

    #[test]
    fn the_names_of_nested_maps_are_joined_up_to_a_bound() {
        let key = "y".repeat(250);
        let joined = flat(&format!("{key}: {{zzz: 1}}")).unwrap();
        assert_eq!(joined, [(format!("a.{key}.zzz"), Value::Integer(1))]);
        let error = flat(&format!("{key}: {{zzzz: 1}}")).unwrap_err();
        let begin = format!("a.{}", &key[..30]);
        let words = format!("the name of the parameter `{begin}...` has 257 bytes; at most 256 are read");
        assert_eq!(error, words);
    }

    #[test]
    fn a_key_of_megabytes_is_not_copied_for_all_the_names_below_it() {
        let below: Vec<_> = (0..100_000).map(|i| format!("k{i}: 1")).collect();
        let error = flat(&format!("? {}\n: {{{}}}\n", "y".repeat(4 << 20), below.join(", "))).unwrap_err();
        assert!(error.contains("has 4194306 bytes"), "{error}");
    }
}
