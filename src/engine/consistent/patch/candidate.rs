//! A voxel that is held against one plane after another.

use nalgebra::Vector3;

use crate::engine::consistent::noise::Noise;
use crate::engine::consistent::plane::Plane;
use crate::engine::consistent::state::{Blur, State};
use crate::engine::symmetric::Symmetric3;

/// What a state says of its points, in numbers that are ready to be used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    mean: Vector3<f64>,
    blur: Blur,
    /// See [`State::thickness`].
    thickness: Symmetric3,
}

/// More than what a quotient times its divisor is less than its dividend by.
const ROUNDING: f64 = 1.0 + 1e-12;

impl Candidate {
    pub(super) fn new(state: &State, noise: &Noise) -> Self {
        Self {
            mean: state.mean(),
            blur: state.blur(noise),
            thickness: Symmetric3::of(&state.thickness(noise)),
        }
    }

    /// How far its points are off a plane: the mean square of their distances, over what `noise_factor` standard deviations of
    /// their noise and `flatness` allow; 1 is just allowed. `None` where it is more than `most`, or where the plane was seen from
    /// the other side.
    pub(super) fn misfit(&self, plane: &Plane, noise_factor: f64, flatness: f64, most: f64) -> Option<f64> {
        let normal = &plane.normal;
        let sight = self.blur.towards.dot(normal);
        if sight <= 0.0 {
            return None;
        }
        let noise = self.blur.deep * sight * sight + self.blur.lateral;
        let allowed = noise_factor * noise_factor * noise + flatness * flatness;
        let off = normal.dot(&(self.mean - plane.point));
        // Most planes pass it by; what is just as far is looked at, for it decides between equals.
        if off * off > most * allowed * ROUNDING {
            return None;
        }
        // Points that lie closer together than their noise would have them are no better than right on it: less than nothing, the
        // misfit would not be told from one beyond `most`.
        let thickness = self.thickness.quadratic_form(normal).max(0.0);
        Some((off * off + thickness) / allowed).filter(|misfit| *misfit <= most)
    }
}
