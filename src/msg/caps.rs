//! What an output leaves out, said once a session.

use super::{labelled, markers};
use crate::engine::Snapshot;

/// Keeps track of which caps have been told.
#[derive(Clone, Debug, Default)]
pub struct Caps {
    session: u64,
    told: [bool; 3],
}

impl Caps {
    /// A sentence for each output whose cap this map exceeds for the first time in its session.
    pub fn reached(&mut self, session: u64, snapshot: &Snapshot) -> Vec<String> {
        if self.session != session {
            *self = Self { session, ..Self::default() };
        }
        let [surfaces, cubes] = markers::left_out(snapshot);
        let sentences =
            [surfaces, cubes, labelled::left_out(snapshot.voxels.len(), snapshot.unclustered_voxels)];
        let is_new = |(sentence, told): (Option<String>, &mut bool)| {
            sentence.filter(|_| !std::mem::replace(told, true))
        };
        sentences.into_iter().zip(&mut self.told).filter_map(is_new).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of which only the number of voxels in no cluster is known.
    fn map(unclustered_voxels: usize) -> Snapshot {
        Snapshot {
            sequence: 1,
            stamp: None,
            voxel_size: 0.1,
            clusters: Vec::new(),
            voxels: Vec::new(),
            unclustered_voxels: unclustered_voxels as u32,
        }
    }

    #[test]
    fn a_cap_is_told_once_a_session_and_only_when_it_is_exceeded() {
        let mut caps = Caps::default();
        assert!(caps.reached(1, &map(markers::MAX_CUBES)).is_empty());
        let told = caps.reached(1, &map(markers::MAX_CUBES + 1));
        assert_eq!(told, ["~/markers shows the first 20000 of 20001 voxels as cubes"]);
        assert!(caps.reached(1, &map(markers::MAX_CUBES + 2)).is_empty());
        assert_eq!(caps.reached(2, &map(markers::MAX_CUBES + 2)).len(), 1);
    }
}
