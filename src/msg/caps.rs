//! What an output leaves out, said once a session.

use super::labelled::MAX_LABELLED;
use super::markers::MAX_CUBES;

/// Keeps track of which caps have been told.
#[derive(Clone, Debug, Default)]
pub struct Caps([bool; 2]);

impl Caps {
    /// A sentence for each output whose cap a map of so many dense voxels reaches for the first time.
    pub fn reached(&mut self, voxels: usize) -> Vec<String> {
        let caps = [("~/markers", MAX_CUBES), ("~/points_labelled", MAX_LABELLED)];
        let mut lines = Vec::new();
        for ((topic, cap), told) in caps.into_iter().zip(&mut self.0) {
            if voxels > cap && !std::mem::replace(told, true) {
                lines.push(format!("{topic} shows the first {cap} of {voxels} dense voxels"));
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cap_is_told_once_and_only_when_it_is_exceeded() {
        let mut caps = Caps::default();
        assert!(caps.reached(MAX_CUBES).is_empty());
        assert_eq!(caps.reached(MAX_CUBES + 1), ["~/markers shows the first 20000 of 20001 dense voxels"]);
        assert!(caps.reached(MAX_CUBES + 2).is_empty());
        assert_eq!(caps.reached(MAX_LABELLED + 1).len(), 1);
    }
}
