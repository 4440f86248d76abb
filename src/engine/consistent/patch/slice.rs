//! When a patch is a slice of another, and how well it lies on that one's plane.

use super::Patch;
use crate::engine::consistent::rules::{RIM_NOISE_FACTOR, Rules};
use crate::engine::symmetric::Symmetric3;

/// Part of a noisy patch's noise, as standard deviations, that the one which it is a slice of has at most.
const SHARPER: f64 = 0.75;
/// Angle between the normals of a noisy or folded patch and the one that it is a slice of, at most (rad).
const SLICE_ANGLE: f64 = 0.6;
/// Angle between the normals of a patch and another that it lies on without meeting it, at most (rad).
const BESIDE_ANGLE: f64 = 0.4;
/// Misfit of a slice, at most: scatters of a pillar seen from 6 m have 1.1 on the nearer ones' planes, and from 1.25 on a
/// wall takes in a door that stands ajar.
const SLICE: f64 = 1.1;
/// Misfit of a folded slice, at most: half of it lies off the plane of the one that it is taken to be a slice of.
const FOLDED_SLICE: f64 = 2.0;
/// A patch is much broader than another where its variance across its narrow side is this many times the other's.
const BROADER: f64 = 2.0;

impl Patch {
    /// How well its points lie on the plane of a patch whose slice it may be, up to 1: of a flat one where it is rough, which is
    /// narrow only where it is so itself, for a narrow one may be a slice of another surface; of a whole one where it is folded; of
    /// one with less noise where it is noisy; of a much broader one where it is narrow, for its own normal may be any then. `None`
    /// where it is no such slice.
    pub(in super::super) fn slice_of(&self, other: &Self, rules: &Rules) -> Option<f64> {
        let turn = self.normal().dot(&other.normal());
        let is_sharper = other.noise() <= SHARPER * SHARPER * self.noise();
        let may_be = if self.is_rough {
            turn > 0.0 && (!other.is_narrow() || self.is_narrow())
        } else if self.is_folded {
            !other.is_folded && !other.is_narrow() && turn >= SLICE_ANGLE.cos()
        } else {
            self.is_noisy() && is_sharper && turn >= SLICE_ANGLE.cos()
                || self.is_narrow()
                    && f64::from(other.breadth) >= BROADER * f64::from(self.breadth)
                    && self.towards.dot(&other.normal) > 0.0
        };
        let may_be = may_be && !other.is_rough;
        let most = if self.is_folded { FOLDED_SLICE } else { SLICE };
        may_be.then(|| self.misfit(other, rules)).filter(|misfit| *misfit <= most)
    }

    /// Whether its points lie on the plane of another that it need not meet, as far as a slice's do.
    pub(in super::super) fn lies_on(&self, other: &Self, rules: &Rules) -> bool {
        self.normal().dot(&other.normal()) >= BESIDE_ANGLE.cos() && self.misfit(other, rules) <= 1.0
    }

    /// How far its points are off the plane of another, by what is allowed of a slice.
    pub(in super::super) fn misfit(&self, other: &Self, rules: &Rules) -> f64 {
        let (normal, off) = (other.normal(), other.height_of(&self.mean()));
        let square = off * off + Symmetric3(self.square.map(f64::from)).quadratic_form(&normal);
        let noise = Symmetric3(self.blur.map(f64::from)).quadratic_form(&normal);
        let flatness = rules.rim_flatness * rules.rim_flatness;
        square / (RIM_NOISE_FACTOR * RIM_NOISE_FACTOR * noise + flatness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::patch::Kind;
    use crate::engine::consistent::patch::examples::{rows, rows_of};
    use crate::engine::params::Params;

    #[test]
    fn a_narrow_patch_on_a_broad_one_s_plane_is_a_slice_of_it_whatever_its_normal() {
        let rules = Rules::new(&Params::default());
        let floor = rows(0..5, |_| 2.3);
        let strip = rows(5..7, |y| 2.3 + 0.3 * (y - 6.0));
        let angle = floor.normal().angle(&strip.normal());
        assert!(angle > rules.join_angle, "{angle}");
        assert!(strip.may_be_slice() && strip.is_frayed());
        assert!(strip.slice_of(&floor, &rules).is_some());
        // Neither the other way round, nor of one that is no broader, nor where it rises from the floor.
        assert!(!floor.may_be_slice() && floor.slice_of(&strip, &rules).is_none());
        assert_eq!(strip.slice_of(&rows(3..5, |_| 2.3), &rules), None);
        assert_eq!(rows(5..7, |y| 2.3 + (y - 5.0)).slice_of(&floor, &rules), None);
    }

    #[test]
    fn a_rough_patch_is_a_slice_of_a_flat_one_and_of_a_narrow_one_only_where_it_is_so_itself() {
        let rules = Rules::new(&Params::default());
        let rough = |of| rows_of(Kind::Rough, 1.0, of, |_| 2.3);
        let [floor, edge] = [0..8, 6..8].map(|of| rows(of, |_| 2.3));
        assert!(
            !floor.is_narrow() && edge.is_narrow() && rough(0..2).is_narrow() && !rough(0..6).is_narrow()
        );
        assert!(rough(0..6).slice_of(&floor, &rules).is_some());
        assert_eq!(rough(0..6).slice_of(&edge, &rules), None);
        assert!(rough(0..2).slice_of(&edge, &rules).is_some());
        assert_eq!(rough(0..2).slice_of(&rough(0..6), &rules), None);
    }

    #[test]
    fn a_patch_with_a_crease_is_a_slice_of_one_of_the_two_surfaces_and_what_is_bent_less_is_none() {
        let rules = Rules::new(&Params::default());
        let ramp = 18.0_f64.to_radians().tan();
        let [floor, foot] = [rows(0..8, |_| 2.3), rows(0..8, |y| 2.3 + ramp * (y - 4.0).max(0.0))];
        // By its direction it would be joined with either.
        assert!(floor.normal().angle(&foot.normal()) < rules.join_angle);
        assert!(foot.is_folded() && foot.is_frayed() && foot.may_be_slice());
        assert!(foot.slice_of(&floor, &rules).is_some());
        // Neither is a flat patch or a slope, nor what is bent over its whole length by as little.
        let slope = rows(0..8, |y| 2.3 + ramp * (y - 4.0));
        let bent = rows(0..8, |y| 2.3 + 0.01 * (y - 4.0) * (y - 4.0));
        assert!([&floor, &slope, &bent].iter().all(|patch| !patch.is_folded()));
        assert_eq!(
            foot.slice_of(&foot.clone(), &rules),
            None,
            "two folded ones would tie the surfaces together"
        );
    }
}
