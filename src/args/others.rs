//! What is said of parameters that are for other nodes.

use std::collections::{BTreeMap, BTreeSet};

use ros2args::ParamAssignment;

use super::given::idle;
use super::params_file::flatten;
use crate::config::is_of_node;
use crate::line::one_line;

/// Names of nodes that are said at most.
const NAMES: usize = 5;
/// Letters of each.
const LETTERS: usize = 64;
/// Letters by which a name differs at most that is meant to be another.
const MISSPELT: usize = 2;

/// A line on where these parameters stand, none of which is for `node`; `None` where there are none.
pub(super) fn for_others(place: &str, others: &[ParamAssignment], node: &str) -> Option<String> {
    let names = listed(&others.iter().filter_map(|param| param.node_name.as_deref()).collect())?;
    Some(one_line(&format!("{place} has nothing for {node}; it is for {names}")).into_owned())
}

/// A line on those parameters of a file that are for no other node, but for `node` by a misspelt name: all below that name are its
/// own. `None` where there are none, and where the file names the node itself: what is called like it there is another.
pub(super) fn for_misspelt(place: &str, params: &[ParamAssignment], node: &str) -> Option<String> {
    let mut below: BTreeMap<&str, Vec<_>> = BTreeMap::new();
    for param in params {
        below.entry(param.node_name.as_deref().unwrap_or_default()).or_default().push(param);
    }
    let own = last_part(node);
    if below.keys().any(|name| last_part(name) == own) {
        return None;
    }
    below
        .retain(|name, params| is_misspelt(last_part(name), own) && params.iter().all(|param| is_own(param)));
    let names = listed(&below.into_keys().collect())?;
    Some(
        one_line(&format!("{place} has parameters for {names} that are not read: this node is {node}"))
            .into_owned(),
    )
}

fn last_part(name: &str) -> &str {
    name.rsplit_once('/').map_or(name, |(_, last)| last)
}

/// Whether the name of a node can be meant as `own`. What differs in digits alone is another of several.
fn is_misspelt(name: &str, own: &str) -> bool {
    let length = |name: &str| name.chars().count();
    let without_digits = |name: &str| name.replace(|letter: char| letter.is_ascii_digit(), "");
    !name.contains('*')
        && length(name).abs_diff(length(own)) <= MISSPELT
        && without_digits(name) != without_digits(own)
        && strsim::damerau_levenshtein(name, own) <= MISSPELT
}

/// Whether it can be given to this node.
fn is_own(param: &ParamAssignment) -> bool {
    let mut values = Vec::new();
    flatten(param.name.clone(), &param.value, &mut values, &mut Vec::new()).is_ok()
        && values.iter().all(|(name, _)| is_of_node(name) || idle(name).is_some())
}

/// These names, as many as are said; `None` where there are none.
fn listed(names: &BTreeSet<&str>) -> Option<String> {
    let mut shown: Vec<String> = names.iter().take(NAMES).map(|name| short(name)).collect();
    let more = names.len().saturating_sub(NAMES);
    shown.extend((more > 0).then(|| format!("{more} more")));
    (!names.is_empty()).then(|| shown.join(", "))
}

fn short(name: &str) -> String {
    let mut letters = name.chars();
    let begin: String = letters.by_ref().take(LETTERS).collect();
    if letters.next().is_some() { format!("{begin}...") } else { begin }
}

#[cfg(test)]
mod tests {
    use yaml_rust2::Yaml;

    use super::*;

    #[test]
    fn a_name_is_misspelt_that_differs_in_few_letters_and_not_in_digits_alone() {
        for name in ["cfdi", "cfdoi", "Cfodi", "cfodis", "cf_odi", "cofodi", "cfo1"] {
            assert!(is_misspelt(name, "cfodi"), "{name}");
        }
        let long = "x".repeat(256);
        for name in ["cfodi", "cfodi2", "cfodi_2x", "*", "**", "", "rviz", "cf*di", &long] {
            assert!(!is_misspelt(name, "cfodi"), "{name}");
        }
        assert!(!is_misspelt("lidar_2", "lidar_1") && !is_misspelt("*", "eye"));
    }

    #[test]
    fn the_names_of_other_nodes_are_said_up_to_a_bound_of_their_number_and_length() {
        let of = |names: &[String]| {
            let param = |name: &String| {
                ParamAssignment::new_node_specific(name.clone(), "depth".to_owned(), Yaml::Integer(3))
            };
            for_others("a.yaml", &names.iter().map(param).collect::<Vec<_>>(), "/cfodi")
        };
        assert_eq!(of(&[]), None);
        let twice = ["/other", "/other", "/more"].map(str::to_owned);
        assert_eq!(of(&twice).unwrap(), "a.yaml has nothing for /cfodi; it is for /more, /other");
        let many: Vec<_> = (0..9).map(|i| format!("n{i}")).collect();
        assert_eq!(of(&many).unwrap(), "a.yaml has nothing for /cfodi; it is for n0, n1, n2, n3, n4, 4 more");
        let long = format!("\u{1b}{}", "é".repeat(100));
        let end = format!("it is for \\u{{1b}}{}...", "é".repeat(63));
        let said = of(&[long]).unwrap();
        assert!(said.ends_with(&end), "{said}");
    }
}
