//! What is said of parameters that are for other nodes.

use std::collections::BTreeSet;

use ros2args::ParamAssignment;

use crate::line::one_line;

/// Names of nodes that are said at most.
const NAMES: usize = 5;
/// Letters of each.
const LETTERS: usize = 64;

/// A line on where these parameters stand, none of which is for `node`; `None` where there are none.
pub(super) fn for_others(place: &str, others: &[ParamAssignment], node: &str) -> Option<String> {
    let names: BTreeSet<_> = others.iter().filter_map(|param| param.node_name.as_deref()).collect();
    if names.is_empty() {
        return None;
    }
    let mut shown: Vec<String> = names.iter().take(NAMES).map(|name| short(name)).collect();
    let more = names.len().saturating_sub(NAMES);
    shown.extend((more > 0).then(|| format!("{more} more")));
    let line = format!("{place} has nothing for {node}; it is for {}", shown.join(", "));
    Some(one_line(&line).into_owned())
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
