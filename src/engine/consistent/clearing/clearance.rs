//! When a voxel has been seen through often enough.

use serde::{Deserialize, Serialize};

/// How often a voxel has been seen through, less what speaks for it.
///
/// One look is no proof: a depth scatters, a pose lags behind. So the points of a voxel are dropped when it was seen through
/// [`Clearance::LIMIT`] times, of which there is one in three scans.
///
/// Several points in one scan are a proof: something is there, and they take all votes back. One or two are none, but where a
/// single one makes a voxel dense: beside an
/// edge, points stray into the air behind it, and if each took all votes back, a ghost beside an edge would never go.
/// Yet the last millimetres of a table may have no more than one or two in a scan. So they take back one vote: a ghost
/// stays only if points stray into it as often as it is looked at, and a thin thing that is hit as often as it is missed
/// stays, though the padding of its box should prevent that it is seen through at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Clearance(u8);

impl Clearance {
    /// Votes with which a voxel is to be cleared.
    pub(crate) const LIMIT: u8 = 5;

    /// The voxel was seen through; whether it is to be cleared.
    pub(crate) const fn note_seen_through(&mut self) -> bool {
        self.0 = self.0.saturating_add(1);
        self.0 >= Self::LIMIT
    }

    /// The voxel received enough points in one scan to prove that something is there.
    pub(crate) const fn note_points(&mut self) {
        self.0 = 0;
    }

    /// The voxel received so few points in one scan that they may be strays.
    pub(crate) const fn note_strays(&mut self) {
        self.0 = self.0.saturating_sub(1);
    }

    /// The votes so far.
    #[cfg(test)]
    pub(crate) const fn votes(self) -> u8 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voxel_is_cleared_at_the_fifth_vote_and_stays_so() {
        let mut clearance = Clearance::default();
        let cleared: Vec<bool> = (0..300).map(|_| clearance.note_seen_through()).collect();
        assert_eq!(cleared[..6], [false, false, false, false, true, true]);
        assert!(cleared[4..].iter().all(|&cleared| cleared));
    }

    #[test]
    fn strays_in_every_third_scan_do_not_keep_a_voxel_that_is_seen_through_in_the_others() {
        let mut clearance = Clearance::default();
        let looks = (1..).take_while(|look| {
            if look % 3 == 0 {
                clearance.note_strays();
                return true;
            }
            !clearance.note_seen_through()
        });
        assert_eq!(looks.count(), 10);
    }

    #[test]
    fn points_take_all_votes_back() {
        let mut clearance = Clearance::default();
        for _ in 0..4 {
            clearance.note_seen_through();
        }
        assert_eq!(clearance.votes(), 4);
        clearance.note_points();
        assert!(!clearance.note_seen_through());
        assert_eq!(clearance.votes(), 1);
    }
}
