//! The parameters that a command line and its files give to the node, with where each stands.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use ros2args::names::build_node_fqn;
use ros2args::{ParamAssignment, Ros2Args, match_wildcard_pattern};

use super::ArgsError;
use super::others::{for_misspelt, for_others};
use super::params_file::{assignments, flatten};
use crate::config::{ConfigError, Value, as_meant};
use crate::line::one_line;

/// Where a parameter stands.
#[derive(Debug)]
struct Origin {
    file: PathBuf,
    /// Name or pattern of the nodes that it is for.
    section: String,
}

/// A parameter that is given.
#[derive(Debug)]
pub(super) struct Given {
    pub(super) name: String,
    pub(super) value: Value,
    /// `None` on the command line.
    origin: Option<Rc<Origin>>,
}

/// Files count in their order, the command line after them. What is to be said of those that have nothing for this node stands
/// beside them.
///
/// # Errors
/// At a file that cannot be read, and at the first value that no parameter can have.
pub(super) fn given(
    ros: &Ros2Args,
    namespace: &str,
    name: &str,
) -> Result<(Vec<Given>, Vec<String>), ArgsError> {
    let node = build_node_fqn(namespace, name);
    let is_for_node = |param: &ParamAssignment| {
        param.node_name.as_ref().is_none_or(|pattern| match_wildcard_pattern(pattern, &node))
    };
    let mut assigned: Vec<(ParamAssignment, Option<&Path>)> = Vec::new();
    let mut warnings = Vec::new();
    for file in &ros.param_files {
        let params = assignments(file)?;
        let place = file.display().to_string();
        // A file of a robot has parameters of many nodes: only one without any of this one is odd, or with some for a name that is
        // hardly another.
        warnings.extend(if params.iter().any(is_for_node) {
            for_misspelt(&place, &params, &node)
        } else {
            for_others(&place, &params, &node)
        });
        let of_file = params.into_iter().filter(is_for_node);
        assigned.extend(of_file.map(|param| (param, Some(file.as_path()))));
    }
    let (on_line, others): (Vec<_>, Vec<_>) = ros.param_assignments.iter().cloned().partition(is_for_node);
    // There each is given to this program.
    warnings.extend(for_others("a -p", &others, &node));
    assigned.extend(on_line.into_iter().map(|param| (param, None)));
    let mut given = Vec::new();
    for (param, file) in assigned {
        let origin = file.zip(param.node_name);
        let origin = origin.map(|(file, section)| Rc::new(Origin { file: file.to_owned(), section }));
        let (mut values, mut repeated) = (Vec::new(), Vec::new());
        flatten(param.name, &param.value, &mut values, &mut repeated)
            .map_err(|error| in_file(error, origin.as_deref()))?;
        let place = file.map_or_else(|| "a -p".to_owned(), |file| file.display().to_string());
        warnings.extend(repeated.iter().map(|name| {
            one_line(&format!("{place} has {name} twice in one map: the last value counts")).into_owned()
        }));
        let meant = |(name, value): (String, Value)| Given {
            value: as_meant(&name, value),
            name,
            origin: origin.clone(),
        };
        given.extend(values.into_iter().map(meant));
    }
    Ok((given, warnings))
}

/// The family of a parameter that every node of ROS has and that changes nothing here: a file may give it to all nodes of a robot.
pub(super) fn idle(name: &str) -> Option<&'static str> {
    let of_all = "start_type_description_service";
    if name == of_all {
        return Some(of_all);
    }
    name.starts_with("qos_overrides.").then_some("qos_overrides")
}

/// Says of a parameter that is refused where it stands: the files of a robot are many. Of several of its name the last counts.
pub(super) fn located(error: ConfigError, given: &[Given]) -> ArgsError {
    let last = |name: &str| given.iter().rev().find(|given| given.name == name);
    let origin = error.parameter().and_then(last).and_then(|given| given.origin.clone());
    in_file(error.into(), origin.as_deref())
}

fn in_file(error: ArgsError, origin: Option<&Origin>) -> ArgsError {
    let Some(Origin { file, section }) = origin else { return error };
    ArgsError::InFile { error: error.into(), file: file.clone(), section: section.clone() }
}
