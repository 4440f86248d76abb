//! Names of topics and services -> fully qualified ones.

use ros2args::Ros2ArgsError;
use ros2args::names::{build_node_fqn, expand_topic_name};

use super::remap::Kind;

/// A name as the node means it: one without a slash is in its namespace, one with a tilde below the node.
///
/// The library holds names against the design document of ROS 2, which forbids two underscores in a row. rcl and rmw look for them
/// neither in a name that is given (`rcl_validate_topic_name`) nor in a full one (`rmw_validate_full_topic_name`), so that topics are
/// called so: of these the library sees one underscore in place of several, and all its other rules hold.
///
/// # Errors
/// When the name is none.
pub(super) fn expand(kind: Kind, namespace: &str, node: &str, name: &str) -> Result<String, Ros2ArgsError> {
    if kind == Kind::Service || !name.contains("__") {
        return expand_topic_name(namespace, node, name);
    }
    expand_topic_name(namespace, node, &with_single_underscores(name))?;
    Ok(match name.strip_prefix('~') {
        Some(below) => build_node_fqn(namespace, node) + below,
        None if name.starts_with('/') => name.to_owned(),
        None => build_node_fqn(namespace, name),
    })
}

fn with_single_underscores(name: &str) -> String {
    let mut single = String::with_capacity(name.len());
    for char in name.chars() {
        if char != '_' || !single.ends_with('_') {
            single.push(char);
        }
    }
    single
}

#[cfg(test)]
mod tests {
    use crate::args::tests::parse;

    #[test]
    fn a_topic_may_have_underscores_in_a_row() {
        let table = [
            ("/cam__left/points", "/cam__left/points"),
            ("cam___left/points__", "/robot/cam___left/points__"),
            ("~/__points", "/robot/cfodi/__points"),
        ];
        for (name, full) in table {
            let setup = parse(&format!("--ros-args -r __ns:=/robot -r points:={name}")).unwrap();
            assert_eq!(setup.resolve("points").unwrap(), full);
            assert!(setup.is_remapped("points"));
        }
        let setup = parse("--ros-args -r cam__left/points:=/a").unwrap();
        assert_eq!(setup.resolve("/cam__left/points").unwrap(), "/a");
        assert_eq!(setup.resolve("/cam_left/points").unwrap(), "/cam_left/points");
    }

    #[test]
    fn nothing_else_of_a_name_is_let_through_with_them() {
        for name in
            ["/a__b//c", "/a__b/", "/a__b/1", "1a__b", "~a__b", "/a__~", "/a__{node}", "/a__-", "/ä__b"]
        {
            let setup = parse(&format!("--ros-args -r points:={name}")).unwrap();
            assert!(setup.resolve("points").is_err(), "{name}");
        }
        let setup = parse("--ros-args -r ~/save:=/a__b").unwrap();
        assert!(setup.resolve("~/save").is_ok() && setup.resolve_service("~/save").is_err());
    }
}
