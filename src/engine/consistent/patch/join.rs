//! When two patches that meet are one surface.

use super::Patch;
use super::contacts::Contact;
use crate::engine::consistent::rules::Rules;

/// Pairs of voxels that make a contact.
const MIN_PAIRS: u32 = 3;
/// Part of what is allowed of a slice that two narrow patches are off each other at most where fewer pairs are one: rows of
/// one voxel, end to end, have a single pair.
const ALIGNED: f64 = 0.05;
/// Standard deviations by which planes that are badly known may differ more.
const JOIN_SIGMAS: f64 = 3.0;
/// What a badly known plane excuses at most (rad): 20 degrees.
const MAX_JOIN_ANGLE: f64 = 0.35;
/// What each of two patches adds to the distance between their planes that is allowed, in standard deviations of its noise.
const CUT_SIGMAS: f64 = 0.8;
/// Part of what is allowed of a slice that two scatters may be off each other.
const WELL: f64 = 0.5;
/// Angle between the facets of a bend, at most (rad): 75 degrees.
const BEND_ANGLE: f64 = 1.3;
/// Radius of a bend, at least, in voxels: what is bent more is an edge.
const BEND_RADIUS: f64 = 2.0;
/// How far two facets may be off one circle, in voxels.
const BEND_SKEW: f64 = 1.0;
/// Voxels of a facet, at least: a row and a half through a block.
const FACET: usize = 12;

impl Patch {
    /// Whether two patches that meet so are one surface; a rough one is none with a flat one. Free of order.
    pub(in super::super) fn joins(&self, other: &Self, contact: &Contact, rules: &Rules) -> bool {
        self.is_rough() == other.is_rough()
            && (contact.pairs >= MIN_PAIRS || self.is_in_line_with(other, rules))
            && self.has_direction_of(other, rules)
            && self.is_level_with(other, contact, rules)
    }

    /// Whether a flat patch is one surface with another that has less noise, and so need be no slice of a third.
    pub(in super::super) fn is_equal_of(&self, other: &Self, contact: &Contact, rules: &Rules) -> bool {
        !self.is_rough()
            && !self.is_folded()
            && other.has_less_noise(self)
            && self.joins(other, contact, rules)
    }

    /// Whether two narrow patches lie each on the plane of the other as if they were one.
    fn is_in_line_with(&self, other: &Self, rules: &Rules) -> bool {
        self.is_narrow() && other.is_narrow() && self.mutual_misfit(other, rules) <= ALIGNED
    }

    fn mutual_misfit(&self, other: &Self, rules: &Rules) -> f64 {
        self.misfit(other, rules).max(other.misfit(self, rules))
    }

    /// Whether their planes have the same direction, as far as both are known, or else are of one scatter or one bend.
    fn has_direction_of(&self, other: &Self, rules: &Rules) -> bool {
        let most = if self.is_rough() { rules.rough_angle } else { rules.join_angle };
        let angle = self.normal().dot(&other.normal()).clamp(-1.0, 1.0).acos();
        let tilt_sigma = (self.tilt_variance() + other.tilt_variance()).sqrt();
        angle <= (JOIN_SIGMAS * tilt_sigma).clamp(most, MAX_JOIN_ANGLE.max(most))
            || angle <= MAX_JOIN_ANGLE && self.is_one_scatter(other, rules)
            || angle <= BEND_ANGLE && self.is_one_bend(other, angle)
    }

    /// Whether two patches that meet the same third are no single surface: their directions differ, or they are turned by more
    /// than those of one surface are when both are known, and each lies off the plane of the other.
    pub(in super::super) fn differs_from(&self, other: &Self, rules: &Rules) -> bool {
        let is_off = || self.misfit(other, rules).min(other.misfit(self, rules)) > 1.0;
        let is_turned = self.normal().dot(&other.normal()) < rules.join_angle.cos();
        !self.has_direction_of(other, rules) || is_turned && is_off()
    }

    /// Whether two noisy patches lie each on the plane of the other, well within their noise. Where a block cuts a scatter, its
    /// planes are turned by more than their voxels say.
    fn is_one_scatter(&self, other: &Self, rules: &Rules) -> bool {
        let is_noisy_and_flat = |patch: &Self| !patch.is_rough() && patch.is_noisy();
        is_noisy_and_flat(self) && is_noisy_and_flat(other) && self.mutual_misfit(other, rules) <= WELL
    }

    /// Whether two narrow patches, turned by this angle, are facets of one bend, as of a pillar: each has some voxels, both lie
    /// on one circle, and what is bent by that angle over their distance is no edge.
    fn is_one_bend(&self, other: &Self, angle: f64) -> bool {
        let is_facet = |patch: &Self| !patch.is_rough() && patch.is_narrow() && patch.cells.len() >= FACET;
        let (a, b) = (self.normal().into_inner(), other.normal().into_inner());
        let (axis, middle) = (a.cross(&b).normalize(), (a + b).normalize());
        let apart = other.mean() - self.mean();
        let chord = (apart - axis * axis.dot(&apart)).norm();
        is_facet(self)
            && is_facet(other)
            && chord >= 2.0 * BEND_RADIUS * (0.5 * angle).sin()
            && middle.dot(&apart).abs() <= BEND_SKEW
    }

    /// Whether their planes are at one height where they meet, as far as both are known.
    fn is_level_with(&self, other: &Self, contact: &Contact, rules: &Rules) -> bool {
        let most = if self.is_rough() { rules.rough_offset } else { rules.join_offset };
        let meeting = contact.sum / (2.0 * f64::from(contact.pairs));
        // The meeting lies within a voxel of both planes; the heights of the planes above it are compared.
        let heights = [self, other].map(|patch| patch.height_of(&meeting));
        let variance = self.height_variance(&meeting) + other.height_variance(&meeting);
        // Where a block ends within the scatter, each of the two sees one side of it.
        let cut = CUT_SIGMAS * (self.noise().sqrt() + other.noise().sqrt());
        let allowed = (JOIN_SIGMAS * variance.sqrt()).clamp(most, 2.0 * most) + cut;
        (heights[0] - heights[1]).abs() <= allowed
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::engine::consistent::patch::examples::{rows, rows_from};
    use crate::engine::params::Params;

    #[test]
    fn planes_of_one_scatter_may_be_turned_by_more_than_their_voxels_say() {
        let rules = Rules::new(&Params::default());
        let meeting = Contact { pairs: 8, sum: Vector3::new(4.0, 4.0, 2.3) * 16.0 };
        let turned = |distance: f64, slope: f64| {
            let here = rows_from(distance, 0..4, |_| 2.3);
            let there = rows_from(distance, 4..8, |y| 2.3 + slope * (y - 4.0));
            assert_eq!(here.joins(&there, &meeting, &rules), there.joins(&here, &meeting, &rules));
            here.joins(&there, &meeting, &rules)
        };
        assert!(turned(5.0, 0.3));
        // What is sharp is turned indeed, and so is what is turned by more than 20 degrees.
        assert!(!turned(1.0, 0.3) && !turned(5.0, 0.4));
        assert!(turned(1.0, 0.1));
    }

    #[test]
    fn ramp_and_floor_differ_and_two_parts_of_either_do_not() {
        let rules = Rules::new(&Params::default());
        let floor = |from: i32| rows(from..from + 4, |_| 2.3);
        let ramp = |from: i32| rows(from..from + 4, |y| 2.3 + 0.32 * (y - 4.0));
        let differ = |a: &Patch, b: &Patch| {
            assert_eq!(a.differs_from(b, &rules), b.differs_from(a, &rules));
            a.differs_from(b, &rules)
        };
        assert!(differ(&floor(0), &ramp(4)));
        assert!(!differ(&floor(0), &floor(4)) && !differ(&ramp(0), &ramp(4)));
    }

    #[test]
    fn narrow_facets_of_a_bend_are_one_surface_and_those_of_an_edge_are_not() {
        let rules = Rules::new(&Params::default());
        // A roof of `rows_each` rows to either side of its ridge, which is 2.6 voxels high.
        let bent = |rows_each: i32, slope: f64| {
            let ridge = f64::from(rows_each);
            let height = |y: f64| 2.6 - slope * (y - ridge).abs();
            let [here, there] = [rows(0..rows_each, height), rows(rows_each..2 * rows_each, height)];
            let meeting = Contact { pairs: 22, sum: Vector3::new(4.0, ridge, 2.6) * 44.0 };
            assert!(here.normal().angle(&there.normal()) > MAX_JOIN_ANGLE);
            assert_eq!(here.joins(&there, &meeting, &rules), there.joins(&here, &meeting, &rules));
            here.joins(&there, &meeting, &rules)
        };
        assert!(bent(3, 0.3), "a radius of five voxels");
        assert!(!bent(2, 0.65), "a radius of less than two");
        assert!(!bent(4, 0.3), "too broad for facets: two slopes of a roof");
    }
}
