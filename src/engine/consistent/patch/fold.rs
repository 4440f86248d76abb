//! Whether a crease runs through a patch.

use nalgebra::Vector3;

use super::plane_sums::{Fit, PlaneSums};
use super::{NARROW, tilt_variance};
use crate::engine::consistent::rules::Rules;
use crate::engine::consistent::state::State;

/// Angle from which on two planes that meet within a patch are no single one (rad).
const FOLD_ANGLE: f64 = 0.12;
/// Voxels to either side of a crease, at least.
const FLANK: f64 = 6.0;
/// Part of a patch's variance across its narrow side that lies along its normal, where a crease of [`FOLD_ANGLE`] runs
/// through its middle: 0.0009. Where there is less, as in most patches, none does.
const CREASED: f64 = 0.0009;
/// Standard deviation of noise along the normal, in voxels, up to which a crease is looked for: the foot of a ramp 6 m away is
/// noisy, and ties the ramp to the floor.
const CREASE_NOISE: f64 = 0.45;
/// Standard deviations by which flanks that are badly known may differ more. A broad patch that is taken to be folded and is not
/// loses little: one that is folded and not taken to be ties two surfaces together.
const FOLD_SIGMAS: f64 = 1.5;
/// Standard deviations by which badly known flanks of a narrow patch may differ more: it may be the only bridge between two parts
/// of a surface.
const NARROW_FOLD_SIGMAS: f64 = 3.0;

/// Whether a crease runs through a patch with this fit, and this variance of noise along its normal: the voxels to either side of its
/// middle have planes of different directions. Tried are the two axes of the grid that lie nearest to its plane, and their diagonals.
pub(super) fn is_folded(states: &[&State], fit: &Fit, noise_variance: f64, rules: &Rules) -> bool {
    if noise_variance > CREASE_NOISE * CREASE_NOISE || fit.variances[0] < CREASED * fit.variances[1] {
        return false;
    }
    let steepest = fit.plane.normal.iamax();
    let [a, b] = [1, 2].map(|next| Vector3::ith((steepest + next) % 3, 1.0));
    [a, b, a + b, a - b].iter().any(|across| is_folded_along(across, states, fit, rules))
}

fn is_folded_along(across: &Vector3<f64>, states: &[&State], fit: &Fit, rules: &Rules) -> bool {
    let Fit { plane, variances } = fit;
    let mut flanks = [PlaneSums::default(); 2];
    for state in states {
        let is_beyond = across.dot(&(state.mean() - plane.point)) > 0.0;
        flanks[usize::from(is_beyond)].join(&PlaneSums::one(state, &rules.noise));
    }
    if flanks.iter().any(|flank| flank.voxels() < FLANK) {
        return false;
    }
    let [Some(one), Some(other)] = flanks.map(|flank| flank.fit()) else { return false };
    let tilt_variance = tilt_variance(&flanks[0], &one) + tilt_variance(&flanks[1], &other);
    // Each flank faces the sensor by itself: one that is seen along its plane may have its normal on the other side.
    let angle = one.plane.normal.dot(&other.plane.normal).abs().min(1.0).acos();
    let (least, sigmas) = if variances[1] < NARROW {
        (rules.join_angle, NARROW_FOLD_SIGMAS)
    } else {
        (FOLD_ANGLE, FOLD_SIGMAS)
    };
    angle > least.max(sigmas * tilt_variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::patch::examples::states;
    use crate::engine::params::Params;

    #[test]
    fn what_is_bent_a_little_is_not_folded_because_one_flank_was_seen_from_behind() {
        let rules = Rules::new(&Params::default());
        // The sensor is above one flank's plane and below the other's.
        let grazing = Vector3::new(0.0, 1.0, 0.03).normalize();
        let is_folded = |bend: f64| {
            let states = states(1.0, &grazing, 0..8, |y| 2.3 + (bend / 2.0) * (y - 4.0).abs());
            let mut all = PlaneSums::default();
            states.iter().for_each(|state| all.join(&PlaneSums::one(state, &rules.noise)));
            let states: Vec<_> = states.iter().collect();
            is_folded_along(&Vector3::y(), &states, &all.fit().unwrap(), &rules)
        };
        assert_eq!([0.1, 0.2].map(is_folded), [false, true]);
    }
}
