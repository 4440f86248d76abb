//! What a Kinect gets wrong: scatter, rounding, shadows of its projector, and surfaces met at a grazing angle.
//!
//! Along the optical axis a measured depth scatters by sigma = 0.0012 + 0.0019 (z - 0.4)^2 m (Nguyen, Izadi and Lovell,
//! "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking", 2012) and is rounded to a whole raw
//! disparity, z = 1 / (3.3309495161 - 0.0030711016 raw): a step of 3 mm at 1 m, 12 mm at 2 m, 49 mm at 4 m.
//!
//! Nguyen's sigma was measured on a real Kinect, whose depths were already rounded, so it holds the rounding's own
//! deviation, step / sqrt(12). Before the rounding, therefore, only the rest is drawn, with the variance
//! sigma^2 - step^2 / 12, and at least (0.3 step)^2, which keeps the rounding from hiding the scatter; both together are
//! Nguyen's sigma. The scatter of neighbouring pixels is independent here; in a real Kinect it is not quite.

/// The projector's place to the right of the infrared camera (m).
pub(super) const BASELINE: f64 = 0.075;

/// Change of 1/z with a step of the raw disparity (1/m).
const DISPARITY_SLOPE: f64 = 0.003_071_101_6;

/// Angles of incidence between which measurements begin to fail and none is left (degrees).
const GRAZING: [f64; 2] = [60.0, 85.0];

/// Cosine of the angle below which nothing fails.
pub(super) const SAFE_COSINE: f64 = 0.5;

/// Standard deviation of a measured depth (m), Nguyen et al. 2012.
pub(crate) fn axial_sigma(depth: f64) -> f64 {
    0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4)
}

/// Its part that is not due to rounding (m).
pub(super) fn scatter_sigma(depth: f64) -> f64 {
    let step = DISPARITY_SLOPE * depth * depth;
    let whole = axial_sigma(depth);
    (whole * whole - step * step / 12.0).max(0.09 * step * step).sqrt()
}

/// The depth (m) of the nearest whole raw disparity.
pub(super) fn to_whole_disparity(depth: f64) -> f64 {
    const OFFSET: f64 = 3.330_949_516_1;
    // Rounds: a raw disparity is positive from 0.3 m on, and a cast drops the fraction.
    let raw = ((OFFSET - 1.0 / depth) / DISPARITY_SLOPE + 0.5) as u32;
    1.0 / (OFFSET - DISPARITY_SLOPE * f64::from(raw))
}

/// How likely a measurement fails where the ray and the surface's normal have an angle of this cosine.
///
/// The cube of the way from 60 to 85 degrees: a floor 1 m below the camera gives three of four points at 4 m.
pub(super) fn dropout_probability(cosine: f64) -> f64 {
    let [first, last] = GRAZING;
    let way = ((cosine.acos().to_degrees() - first) / (last - first)).clamp(0.0, 1.0);
    way * way * way
}

/// Clears the pixels of a row that the projector does not light: its light ends at something nearer.
///
/// Seen from the projector, a point of column c is in column c - `focal_baseline` / z. From right to left these columns
/// fall, unless what is seen at the right stands in the light.
///
/// A choice: at the left of a thin thing all is cleared that is behind it, also what the light reaches that passes it at its right.
/// The shadow of a chair's leg, 3.4 cm wide at 1 m, on a wall at 4 m is 29 px wide in place of the leg's own 18. One pass over the row
/// is enough for it, and it errs towards fewer points.
pub(super) fn clear_shadows(inverse_depths: &mut [f64], focal_baseline: f64) {
    let mut lit_from = f64::INFINITY;
    for (column, w) in inverse_depths.iter_mut().enumerate().rev() {
        let from_projector = column as f64 - focal_baseline * *w;
        if from_projector >= lit_from {
            *w = 0.0;
        } else {
            lit_from = from_projector;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_gives_the_nearer_of_two_disparities() {
        for z in (40..800).map(|centimetres| f64::from(centimetres) * 0.01) {
            let off = (1.0 / to_whole_disparity(z) - 1.0 / z).abs();
            assert!(off <= 0.5 * 0.003_071_101_6 + 1e-12, "{z} m");
        }
    }

    #[test]
    fn sigma_is_that_of_nguyen() {
        assert!((axial_sigma(2.4) - 0.0088).abs() < 1e-12);
    }

    #[test]
    fn measurements_fail_from_sixty_degrees_on_and_all_of_them_at_eighty_five() {
        let probability = |degrees: f64| dropout_probability(degrees.to_radians().cos());
        assert!(probability(59.9) == 0.0 && probability(85.1) == 1.0 && probability(90.0) == 1.0);
        assert!((probability(72.5) - 0.125).abs() < 1e-9);
        assert!((SAFE_COSINE - GRAZING[0].to_radians().cos()).abs() < 1e-12);
    }

    #[test]
    fn a_shadow_lies_at_the_left_of_a_near_thing_and_is_as_wide_as_the_disparities_differ() {
        // A thing at 1.5 m in columns 40 to 59, in front of a wall at 3 m.
        let mut row: Vec<f64> =
            (0..100).map(|c| if (40..60).contains(&c) { 1.0 / 1.5 } else { 1.0 / 3.0 }).collect();
        clear_shadows(&mut row, 525.0 * BASELINE);
        let dark: Vec<_> = (0..100).filter(|&c| row[c] == 0.0).collect();
        let width = 525.0 * BASELINE * (1.0 / 1.5 - 1.0 / 3.0);
        assert_eq!(dark, (40 - width as usize..40).collect::<Vec<_>>());
    }

    #[test]
    fn a_surface_without_a_jump_has_no_shadow() {
        let slanted: Vec<f64> = (0..640).map(|c| 0.2 + 0.001 * f64::from(c)).collect();
        let mut row = slanted.clone();
        clear_shadows(&mut row, 525.0 * BASELINE);
        assert_eq!(row, slanted);
    }
}
