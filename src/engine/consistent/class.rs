//! Names a surface by its turn, height and size: floor, ceiling, wall, door, ...
//!
//! +z of the fixed frame is up. Rules decide by the sign of margins: how far the tilt is from the limit between level
//! and sloped, how high a surface stands above the floor, and so on. The confidence is the product of the
//! probabilities that each margin that decided has its sign, taken as normally distributed, and of the support by
//! voxels: it never falls when the covariance shrinks or voxels are added. The constants of [`calibration`] are the
//! only ones, but for what poses may put apart (`rules`). Lengths in m, angles in rad; O(neighbours).

use std::f64::consts::PI;

use nalgebra::{Matrix2, UnitVector3};

use self::evidence::{Planarity, Surroundings};
use crate::engine::SurfaceClass;

pub(super) mod evidence;

/// Limits of the classes and of the evidence for them, and how uncertain their margins are.
mod calibration {
    /// Area from which on a level surface that faces up can be the floor (m^2).
    pub(in super::super) const FLOOR_AREA: f64 = 1.0;
    /// Inclination up to which a surface is level (rad): 10 degrees.
    pub(super) const LEVEL: f64 = 0.174_533;
    /// Inclination from which on it is upright (rad): 70 degrees.
    pub(super) const UPRIGHT: f64 = 1.221_730;
    /// Error of a tilt beside its covariance (rad): that of the fixed frame's up.
    pub(super) const TILT_SIGMA: f64 = 0.017;
    /// A level surface this much higher or lower than the floor is another (m), or as much as poses may put apart what is one.
    pub(super) const STEP: f64 = 0.07;
    /// Deviation of a height, with exact poses (m).
    pub(super) const HEIGHT_SIGMA: f64 = 0.02;
    /// Deviation of an area, relative to [`FLOOR_AREA`].
    pub(super) const AREA_SIGMA: f64 = 0.5;
    /// Deviation of rms / tolerance, of many voxels; of n voxels more by the root of 1 + `SUPPORT` / n.
    pub(super) const FIT_SIGMA: f64 = 0.15;
    /// [`Rules::planar`](crate::engine::consistent::rules::Rules::planar) in standard deviations of the noise. Where the points of a
    /// wall scatter over several layers of voxels, as from 4 m on in voxels of 5 cm, the layers' means scatter by 0.85 of it.
    pub(super) const NOISY_PLANAR: f64 = 1.25;
    /// Angle from which on the members' own normals are across the plane (rad): a slice's is turned by no more than this.
    pub(super) const ACROSS: f64 = 0.6;
    /// Deviation of that angle (rad).
    pub(super) const ACROSS_SIGMA: f64 = 0.12;
    /// Voxels for a support of 1 - 1/e.
    pub(super) const SUPPORT: f64 = 8.0;
    /// Widths of doors (m). The widest is a leaf of 1.1 m with the jamb that stands beside it when it is open.
    pub(super) const DOOR_WIDTH: [f64; 2] = [0.6, 1.35];
    /// Heights of doors (m).
    pub(super) const DOOR_HEIGHT: [f64; 2] = [1.7, 2.3];
    /// What is smaller than a door, down to this part of its least width and height, may be part of one.
    pub(super) const PART: f64 = 0.5;
    /// Deviation of a door's width and height, and of its distances from walls and corners, with exact poses (m).
    pub(super) const SIZE_SIGMA: f64 = 0.05;
    /// Angle from which a door is open (rad): 15 degrees.
    pub(super) const OPEN: f64 = 0.261_799;
    /// A hinge lies this close to its wall's plane, and so does a shut door (m).
    pub(super) const HINGE: f64 = 0.3;
    /// Deviation of how far a shut door stands out of its wall's plane, in voxels, with exact poses.
    pub(super) const SHUT_SIGMA: f64 = 0.25;
    /// Angle from which a door may as well be the next wall of the room (rad), 75 degrees, unless its wall is higher than
    /// itself by `HIGHER`.
    pub(super) const CORNER: f64 = 1.308_997;
    /// By how much a wall is higher than the door in it, at least (m).
    pub(super) const HIGHER: f64 = 0.1;
    /// Within this distance of an edge that is free on a door (m), no other upright surface begins there and turns away: a cupboard's
    /// side and its front meet so, and neither is a door.
    pub(super) const CORNER_GAP: f64 = 0.15;
    /// Least angle between two surfaces with a corner between them (60 degrees), as its cosine.
    pub(super) const TURNED: f64 = 0.5;
    /// Least width of what makes a corner (m): the edge of a leaf and the reveal of a doorway are narrower.
    pub(super) const CORNER_WIDTH: f64 = 0.25;
    /// Part of a surface's height that is beside what makes a corner with it, at least.
    pub(super) const CORNER_PART: f64 = 0.5;
    /// Least inclination of what others can stand beside, as its cosine: 70.1 degrees, so that all of it is upright.
    pub(super) const UPRIGHT_COSINE: f64 = 0.34;
    /// Inclination up to which a surface leans too much for a door, as its cosine: 60 degrees.
    pub(super) const LEANING_COSINE: f64 = 0.5;
    /// Inclination up to which all directions in a plane are taken for horizontal, as its sine.
    pub(super) const LEVEL_SINE: f64 = 1e-6;
    /// How far beyond an upright surface's edge another may begin and still be beside it (m).
    pub(super) const BESIDE: f64 = 0.3;
    /// How far its edge may be off the other's plane (m). A hinge is within [`HINGE`] of it, and so is the middle of a shut leaf,
    /// whose edges then are within 0.5 m: what is farther off makes no door of a cluster.
    pub(super) const OFF_PLANE: f64 = 1.0;
    /// Clearance above the floor up to which a surface certainly stands on it, and from which it counts half (m).
    pub(super) const STANDS: [f64; 2] = [0.3, 1.0];
    /// How likely an upright surface of a door's size is a door when no wall beside it is known.
    pub(super) const ALONE: f64 = 0.25;
}
use calibration as c;
pub(super) use calibration::FLOOR_AREA;

/// A larger upright cluster whose outline ends 0.3 m beyond an upright one's edge at most, which is 1 m off its plane at
/// most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    /// Towards the side it was seen from.
    pub(crate) normal: UnitVector3<f64>,
    /// Distance of its plane from the nearest upright edge of the cluster (m).
    pub(crate) hinge_offset: f64,
    /// Which of the cluster's two upright edges that is.
    pub(crate) hinge: usize,
    /// Distance of its plane from the middle of the cluster (m), of either sign.
    pub(crate) plane_offset: f64,
    /// Its highest z (m).
    pub(crate) highest: f64,
}

/// What is known of a cluster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence<'a> {
    /// Towards the side it was seen from.
    pub(crate) normal: UnitVector3<f64>,
    /// Covariance of turns of the normal about two axes in the plane (rad^2).
    pub(crate) tilt_covariance: Matrix2<f64>,
    /// Lowest and highest z (m).
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
    /// Extent along the horizontal direction in the plane (m).
    pub(crate) width: f64,
    /// Extent along the steepest direction in the plane (m).
    pub(crate) height: f64,
    /// (m^2)
    pub(crate) area: f64,
    /// Number of member voxels.
    pub(crate) voxels: u32,
    /// Edge of a voxel (m).
    pub(crate) voxel_size: f64,
    /// How far apart poses may put what is one surface (m): two standard deviations of the distance.
    pub(crate) apart: f64,
    pub(crate) planarity: Planarity,
    pub(crate) surroundings: Surroundings,
    /// The upright clusters beside an upright one.
    pub(crate) neighbours: &'a [Neighbour],
    /// How far from each of its two upright edges an upright surface begins that turns away from there (m); infinite where none does.
    pub(crate) corners: [f64; 2],
}

/// The class of a cluster and the probability that it is right, 0 to 1; unknown has 0.
pub(crate) fn classify(evidence: &Evidence) -> (SurfaceClass, f32) {
    let (class, likely) = evidence.class();
    let confidence = likely * evidence.support();
    // Evidence that is not a number decides nothing.
    if class == SurfaceClass::Unknown || !confidence.is_finite() {
        return (SurfaceClass::Unknown, 0.0);
    }
    (class, confidence as f32)
}

/// The probability that a value measured as `margin` with this deviation is above 0 (a logistic curve, within 0.01 of
/// the normal distribution).
fn likely(margin: f64, sigma: f64) -> f64 {
    1.0 / (1.0 + (-1.702 * margin / sigma).exp())
}

/// The probability that a value measured as `value` with this deviation is within these limits.
fn likely_within(value: f64, [low, high]: [f64; 2], sigma: f64) -> f64 {
    likely(high - value, sigma) - likely(low - value, sigma)
}

/// 1 at `full` and beyond, a half at `half` and beyond.
fn partly(value: f64, half: f64, full: f64) -> f64 {
    0.5 + 0.5 * ((value - half) / (full - half)).clamp(0.0, 1.0)
}

/// Whether a surface with this normal is level and seen from above.
pub(crate) fn faces_up(normal: &UnitVector3<f64>) -> bool {
    normal.z > 0.0 && inclination(normal) <= c::LEVEL
}

/// Angle between a plane and a level one.
fn inclination(normal: &UnitVector3<f64>) -> f64 {
    normal.z.abs().min(1.0).acos()
}

impl Evidence<'_> {
    fn support(&self) -> f64 {
        1.0 - (-f64::from(self.voxels) / c::SUPPORT).exp()
    }

    /// Standard deviation of the tilt, in its least certain direction.
    fn tilt_sigma(&self) -> f64 {
        let [a, b, d] =
            [self.tilt_covariance[(0, 0)], self.tilt_covariance[(0, 1)], self.tilt_covariance[(1, 1)]];
        let largest = 0.5 * (a + d) + (0.25 * (a - d) * (a - d) + b * b).sqrt();
        (largest + c::TILT_SIGMA * c::TILT_SIGMA).sqrt()
    }

    fn class(&self) -> (SurfaceClass, f64) {
        let fit = 1.0 - self.planarity.rms / self.planarity.tolerance;
        let fit_sigma = c::FIT_SIGMA * (1.0 + c::SUPPORT / f64::from(self.voxels.max(1))).sqrt();
        if fit < 0.0 {
            return (SurfaceClass::Curved, likely(-fit, fit_sigma));
        }
        let sigma = self.tilt_sigma();
        let inclination = inclination(&self.normal);
        let (class, sure) = if inclination <= c::LEVEL {
            let (class, sure) = if self.normal.z > 0.0 { self.facing_up() } else { self.facing_down() };
            (class, sure * likely_within(inclination, [-c::LEVEL, c::LEVEL], sigma))
        } else if inclination >= c::UPRIGHT {
            let (class, sure) = self.upright();
            (class, sure * likely_within(inclination, [c::UPRIGHT, PI - c::UPRIGHT], sigma))
        } else {
            (SurfaceClass::Slope, likely_within(inclination, [c::LEVEL, c::UPRIGHT], sigma))
        };
        let along = likely(c::ACROSS - self.planarity.across, c::ACROSS_SIGMA);
        (class, sure * likely(fit, fit_sigma) * along)
    }

    fn middle(&self) -> f64 {
        f64::midpoint(self.lowest, self.highest)
    }

    /// Deviation of a distance or an extent that has this one with exact poses (m).
    fn sigma(&self, exact: f64) -> f64 {
        exact.hypot(0.5 * self.apart)
    }

    fn facing_up(&self) -> (SurfaceClass, f64) {
        let Some(floor) = self.surroundings.floor.or(self.surroundings.floor_above) else {
            // What is large enough is one of the floors that it is held against: `Evidence::of` looks to that.
            let area = (FLOOR_AREA - self.area) / FLOOR_AREA;
            return (SurfaceClass::Horizontal, likely(area, c::AREA_SIGMA));
        };
        let margin = c::STEP.max(self.apart) - (self.middle() - floor).abs();
        let class = if margin >= 0.0 { SurfaceClass::Floor } else { SurfaceClass::Horizontal };
        (class, likely(margin.abs(), self.sigma(c::HEIGHT_SIGMA)))
    }

    fn facing_down(&self) -> (SurfaceClass, f64) {
        let above = self.middle() - self.surroundings.sensor;
        if above < 0.0 && !self.surroundings.was_ceiling {
            return (SurfaceClass::Unknown, 0.0);
        }
        // What was one is one still when the sensor has gone up past it. How sure that is tells how clearly it lies on either
        // side: what was hardly one from below is not a certain one from above.
        (SurfaceClass::Ceiling, likely(above.abs(), self.sigma(c::HEIGHT_SIGMA)))
    }

    fn upright(&self) -> (SurfaceClass, f64) {
        let size_sigma = self.sigma(c::SIZE_SIGMA);
        let top = self.surroundings.floor.map_or(self.height, |floor| self.highest - floor);
        let size = Margins::all(&[
            (c::DOOR_WIDTH[1] - self.width, size_sigma),
            (c::DOOR_HEIGHT[1] - top, size_sigma),
            (self.width - c::PART * c::DOOR_WIDTH[0], size_sigma),
            (self.height - c::PART * c::DOOR_HEIGHT[0], size_sigma),
        ]);
        let beside = self.neighbours.iter().map(|neighbour| self.out_of(neighbour).and(size));
        let doors = beside.clone().filter(Margins::hold).map(|margins| margins.product);
        if let Some(likely) = doors.max_by(f64::total_cmp) {
            return (SurfaceClass::Door, likely * self.seen_of_door(top));
        }
        let alone = Margins { product: c::ALONE, least: c::ALONE };
        let doubt = beside.map(|margins| margins.least).max_by(f64::total_cmp);
        (SurfaceClass::Wall, 1.0 - doubt.unwrap_or(alone.and(size).least))
    }

    /// How the cluster's plane leaves that of a wall.
    fn out_of(&self, wall: &Neighbour) -> Margins {
        let angle = self.normal.dot(&wall.normal).abs().min(1.0).acos();
        let (sigma, size_sigma) = (self.tilt_sigma(), self.sigma(c::SIZE_SIGMA));
        let hinged = (c::HINGE - wall.hinge_offset.abs(), size_sigma);
        let free = self.corners[1 - wall.hinge];
        let mut open = Margins::all(&[(angle - c::OPEN, sigma), hinged, (free - c::CORNER_GAP, size_sigma)]);
        if angle > c::CORNER {
            open = open.and(Margins::all(&[(wall.highest - self.highest - c::HIGHER, size_sigma)]));
        }
        let offset = wall.plane_offset.abs();
        let shut = Margins::all(&[
            (c::OPEN - angle, sigma),
            (offset - self.voxel_size.max(self.apart), self.sigma(c::SHUT_SIGMA * self.voxel_size)),
            (c::HINGE - offset, size_sigma),
            (self.corners[0].min(self.corners[1]) - c::CORNER_GAP, size_sigma),
        ]);
        if shut.least > open.least { shut } else { open }
    }

    /// Less than 1 where only a part of a door's size has been seen.
    fn seen_of_door(&self, top: f64) -> f64 {
        let clearance = self.surroundings.floor.map_or(0.0, |floor| self.lowest - floor);
        partly(self.width, c::PART * c::DOOR_WIDTH[0], c::DOOR_WIDTH[0])
            * partly(top, c::PART * c::DOOR_HEIGHT[0], c::DOOR_HEIGHT[0])
            * partly(-clearance, -c::STANDS[1], -c::STANDS[0])
    }
}

/// Conditions of which each holds with some probability, more than one half where its margin is above 0.
#[derive(Clone, Copy)]
struct Margins {
    product: f64,
    least: f64,
}

impl Margins {
    fn all(margins: &[(f64, f64)]) -> Self {
        let each = margins.iter().map(|&(margin, sigma)| likely(margin, sigma));
        each.fold(Self { product: 1.0, least: 1.0 }, |all, one| all.and(Self { product: one, least: one }))
    }

    fn and(self, other: Self) -> Self {
        Self { product: self.product * other.product, least: self.least.min(other.least) }
    }

    fn hold(&self) -> bool {
        self.least >= 0.5
    }
}

#[cfg(test)]
mod tests;
