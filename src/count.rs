//! Numbers of things in words: one scan is no scans.

use std::fmt::Display;

/// So many things in words, `one` being what one of them is called: "1 scan", "2 scans".
pub fn count_of<N: Copy + Display + PartialEq + From<u8>>(number: N, one: &str) -> String {
    let plural = if is_one(number) { "" } else { "s" };
    format!("{number} {one}{plural}")
}

/// What so many things were: "was", "were".
pub fn were<N: Copy + PartialEq + From<u8>>(number: N) -> &'static str {
    if is_one(number) { "was" } else { "were" }
}

fn is_one<N: Copy + PartialEq + From<u8>>(number: N) -> bool {
    number == N::from(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_one_there_is_one_and_of_none_and_of_more_there_are_several() {
        let said = [0, 1, 2].map(|number: u64| format!("{} {} lost", count_of(number, "scan"), were(number)));
        assert_eq!(said, ["0 scans were lost", "1 scan was lost", "2 scans were lost"]);
        assert_eq!(count_of(1_usize, "dense voxel"), "1 dense voxel");
    }
}
