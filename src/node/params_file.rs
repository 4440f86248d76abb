//! A parameter file of ROS 2: node names (or patterns), `ros__parameters` below each, names and values below that.

use std::path::Path;

use ros2args::{ParamAssignment, Ros2ArgsError};

use crate::yaml;

/// Most parts of a pattern of node names: matching follows them by recursion.
const MAX_PARTS: usize = 32;

/// What a file assigns, in its order.
///
/// # Errors
/// Where the file cannot be read, is no YAML within bounds, or has another shape.
pub(super) fn assignments(path: &Path) -> Result<Vec<ParamAssignment>, Ros2ArgsError> {
    let refused = |what: String| Ros2ArgsError::ParamFileParseError(path.to_owned(), what);
    let text = yaml::read(path).map_err(|error| refused(error.to_string()))?;
    let documents = yaml::load(&text).map_err(|error| refused(error.to_string()))?;
    let Some(document) = documents.first() else { return Ok(Vec::new()) };
    let must = |what: &str| refused(what.to_owned());
    let nodes = document.as_hash().ok_or_else(|| must("it must hold names of nodes"))?;
    let mut assigned = Vec::new();
    for (node, about) in nodes {
        let node = node.as_str().ok_or_else(|| must("the name of a node must be a text"))?;
        if node.split('/').count() > MAX_PARTS {
            return Err(refused(format!("the name of a node has more than {MAX_PARTS} parts")));
        }
        let parameters = about["ros__parameters"].as_hash();
        let parameters =
            parameters.ok_or_else(|| refused(format!("node `{node}` must have a map `ros__parameters`")))?;
        for (name, value) in parameters {
            let name = name.as_str().ok_or_else(|| must("the name of a parameter must be a text"))?;
            assigned.push(ParamAssignment::new_node_specific(node.into(), name.into(), value.clone()));
        }
    }
    Ok(assigned)
}
