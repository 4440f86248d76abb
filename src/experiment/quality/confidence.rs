//! How far the confidences of classes are from the share that is right: the expected calibration error (Naeini, Cooper and
//! Hauskrecht, "Obtaining well calibrated probabilities using Bayesian binning", AAAI 2015), by area.

/// A class that is stated of a part of a seen surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedClass {
    /// Probability that it is right, 0 to 1.
    pub confidence: f64,
    /// Seen area of the part (m^2).
    pub area: f64,
    /// That of it whose class it is (m^2).
    pub right: f64,
}

/// Number of bins of confidence: what is stated with one of the same bin is held together against what is right of it.
const BINS: usize = 10;

/// Over the bins the mean of |confidence - share that is right|, by area: 0 where the confidences are what they say; `None`
/// where none is stated.
pub(super) fn calibration_error<'a>(stated: impl IntoIterator<Item = &'a StatedClass>) -> Option<f64> {
    // Of each bin the area, and by how much more of it is said to be right than is.
    let mut bins = [[0.0; 2]; BINS];
    for class in stated {
        let bin = &mut bins[((class.confidence * BINS as f64) as usize).min(BINS - 1)];
        bin[0] += class.area;
        bin[1] += class.confidence * class.area - class.right;
    }
    let area: f64 = bins.iter().map(|bin| bin[0]).sum();
    (area > 0.0).then(|| bins.iter().map(|bin| bin[1].abs()).sum::<f64>() / area)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidences_are_right_when_of_what_is_so_sure_as_much_is_right() {
        let class = |confidence, area, right| StatedClass { confidence, area, right };
        assert_eq!(calibration_error(&[]), None);
        let error = |stated: &[StatedClass]| calibration_error(stated).unwrap();
        // Three of four that are said to be right with 0.75.
        assert!(error(&[class(0.75, 3.0, 3.0), class(0.75, 1.0, 0.0)]) < 1e-12);
        assert!((error(&[class(1.0, 3.0, 3.0), class(1.0, 1.0, 0.0)]) - 0.25).abs() < 1e-12);
        // Too sure of the one and not sure enough of the other is no excuse.
        assert!((error(&[class(0.95, 1.0, 0.45), class(0.05, 1.0, 0.55)]) - 0.5).abs() < 1e-12);
    }
}
