//! `metadata.yaml` of a rosbag2 folder: its files and topics.

use std::path::{Component, Path, PathBuf};

use yaml_rust2::Yaml;

use super::error::BagError;
use super::files::METADATA;
use super::topic::Topic;
use crate::yaml;

/// What a `metadata.yaml` says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Metadata {
    /// The files in their order, with the folder.
    pub(super) files: Vec<PathBuf>,
    /// `mcap`, `sqlite3`.
    pub(super) storage: String,
    /// The topics with their numbers of messages.
    pub(super) topics: Vec<Topic>,
}

/// Reads the text of `folder`/metadata.yaml.
pub(super) fn parse(folder: &Path, text: &str) -> Result<Metadata, BagError> {
    let refuse = |what: String| BagError::Metadata { path: folder.join(METADATA), what };
    let documents = yaml::load(text).map_err(|error| refuse(error.to_string()))?;
    let root = documents.first().unwrap_or(&Yaml::BadValue);
    let about = &root["rosbag2_bagfile_information"];
    let listed = about["relative_file_paths"].as_vec().map_or(&[][..], Vec::as_slice);
    let files = listed.iter().enumerate().map(|(index, listed)| file(folder, index, listed));
    let files = files.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
    if files.is_empty() {
        return Err(refuse("rosbag2_bagfile_information/relative_file_paths names no file".to_owned()));
    }
    let listed = about["topics_with_message_count"].as_vec().map_or(&[][..], Vec::as_slice);
    Ok(Metadata {
        files,
        storage: about["storage_identifier"].as_str().unwrap_or_default().to_owned(),
        topics: listed.iter().filter_map(topic).collect(),
    })
}

/// The file that an entry names, counted from 0; what is wrong with it where it names none in the folder.
fn file(folder: &Path, index: usize, listed: &Yaml) -> Result<PathBuf, String> {
    let Some(name) = listed.as_str() else {
        return Err(format!("relative_file_paths[{index}] is {}, not the name of a file", kind(listed)));
    };
    let is_inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    if !Path::new(name).components().all(is_inside) {
        return Err(format!("it names the file {name:?}, which is not in the folder"));
    }
    Ok(folder.join(name))
}

/// What stands in the place of a text.
fn kind(listed: &Yaml) -> String {
    match listed {
        Yaml::Integer(number) => number.to_string(),
        Yaml::Real(number) => number.clone(),
        Yaml::Boolean(value) => value.to_string(),
        Yaml::Array(_) => "a list".to_owned(),
        Yaml::Hash(_) => "a map".to_owned(),
        Yaml::String(_) | Yaml::Alias(_) | Yaml::Null | Yaml::BadValue => "empty".to_owned(),
    }
}

fn topic(listed: &Yaml) -> Option<Topic> {
    let about = &listed["topic_metadata"];
    Some(Topic {
        name: about["name"].as_str()?.to_owned(),
        type_name: about["type"].as_str()?.to_owned(),
        encoding: about["serialization_format"].as_str().unwrap_or("cdr").to_owned(),
        messages: listed["message_count"].as_i64().and_then(|count| u64::try_from(count).ok()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths: [a_0.mcap.zstd, a_1.mcap.zstd]
  topics_with_message_count:
  - message_count: 58
    topic_metadata:
      name: /tf
      type: tf2_msgs/msg/TFMessage
      serialization_format: cdr
      offered_qos_profiles: ''
";

    #[test]
    fn files_and_topics_are_read_in_their_order() {
        let metadata = parse(Path::new("/bags/a"), TEXT).unwrap();
        assert_eq!(metadata.files, ["/bags/a/a_0.mcap.zstd", "/bags/a/a_1.mcap.zstd"].map(PathBuf::from));
        assert_eq!(metadata.storage, "mcap");
        let [topic] = &metadata.topics[..] else { panic!() };
        assert_eq!((topic.name.as_str(), topic.messages), ("/tf", Some(58)));
    }

    #[test]
    fn files_outside_of_the_folder_are_refused() {
        for name in ["/etc/passwd", "../secret.mcap", "a/../../b.mcap"] {
            let text = format!("rosbag2_bagfile_information: {{relative_file_paths: [\"{name}\"]}}");
            let error = parse(Path::new("/bags/a"), &text).unwrap_err().to_string();
            assert!(error.contains(&format!("it names the file {name:?}")), "{error}");
        }
        let inside = "rosbag2_bagfile_information: {relative_file_paths: [./b/a.mcap]}";
        assert_eq!(parse(Path::new("/bags/a"), inside).unwrap().files, [PathBuf::from("/bags/a/b/a.mcap")]);
    }

    #[test]
    fn an_entry_that_names_no_file_is_refused_with_its_index_and_what_it_is() {
        for (entry, what) in [
            ("7", "7"),
            ("2024.5", "2024.5"),
            ("true", "true"),
            ("", "empty"),
            ("~", "empty"),
            ("[b.mcap]", "a list"),
            ("{b.mcap: 1}", "a map"),
        ] {
            let text = format!(
                "rosbag2_bagfile_information:\n  relative_file_paths:\n  - a.mcap\n  - {entry}\n  - c.mcap\n"
            );
            let error = parse(Path::new("/bags/a"), &text).unwrap_err().to_string();
            let expected = format!("relative_file_paths[1] is {what}, not the name of a file");
            assert_eq!(error, format!("/bags/a/metadata.yaml: {expected}"));
        }
    }

    #[test]
    fn what_is_nested_or_repeated_without_end_is_refused() {
        for text in ["- ".repeat(100_000), "[".repeat(100)] {
            let error = parse(Path::new("/bags/a"), &text).unwrap_err().to_string();
            assert!(error.contains("nested deeper"), "{error}");
        }
        assert!(parse(Path::new("/bags/a"), &crate::yaml::billion_laughs()).is_err());
    }

    #[test]
    fn numbers_that_cannot_be_are_no_numbers() {
        for count in ["-1", "1e99", "99999999999999999999", "many"] {
            let metadata = parse(Path::new("/bags/a"), &TEXT.replace("58", count)).unwrap();
            assert_eq!(metadata.topics[0].messages, None, "{count}");
        }
    }

    #[test]
    fn what_names_no_file_is_refused_with_the_reason() {
        for text in ["", "a: [", "rosbag2_bagfile_information: {relative_file_paths: []}"] {
            let error = parse(Path::new("/bags/a"), text).unwrap_err().to_string();
            assert!(error.starts_with("/bags/a/metadata.yaml: "), "{error}");
        }
    }
}
