//! Plain statistics; `None` where there is nothing to take them of.

/// The mean.
pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The middle value, or the mean of the middle two.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    Some(if sorted.len().is_multiple_of(2) {
        f64::midpoint(sorted[sorted.len() / 2 - 1], upper)
    } else {
        upper
    })
}

/// The largest.
pub(super) fn largest(values: &[f64]) -> Option<f64> {
    values.iter().copied().max_by(f64::total_cmp)
}

/// Slope and value at 0 of the least squares line through (x, y); `None` where all x are the same.
pub(super) fn line(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (xs, ys): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
    let (x0, y0) = (mean(&xs)?, mean(&ys)?);
    let squares: f64 = xs.iter().map(|x| (x - x0).powi(2)).sum();
    let products: f64 = points.iter().map(|(x, y)| (x - x0) * (y - y0)).sum();
    (squares > 0.0).then(|| (products / squares, y0 - products / squares * x0))
}

/// The mean of the last quarter over that of the second; `None` below four values or where the second is 0.
pub(super) fn last_quarter_over_second(values: &[f64]) -> Option<f64> {
    let quarter = values.len() / 4;
    let second = mean(&values[quarter..2 * quarter]).filter(|mean| *mean > 0.0)?;
    Some(mean(&values[values.len() - quarter..])? / second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_has_no_statistics() {
        assert_eq!((mean(&[]), median(&[]), largest(&[]), line(&[])), (None, None, None, None));
        assert_eq!(last_quarter_over_second(&[1.0; 3]), None);
        assert_eq!(last_quarter_over_second(&[0.0; 8]), None);
        assert_eq!(line(&[(2.0, 1.0), (2.0, 5.0)]), None);
    }

    #[test]
    fn worked_by_hand() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), Some(3.0));
        assert_eq!(median(&[9.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[9.0, 1.0, 2.0, 4.0]), Some(3.0));
        assert_eq!(largest(&[1.0, 9.0, 2.0]), Some(9.0));
        let (slope, start) = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)]).unwrap();
        assert!((slope - 2.0).abs() < 1e-12 && (start - 1.0).abs() < 1e-12);
        // Second quarter 2 and 4, last one 5 and 7.
        assert_eq!(last_quarter_over_second(&[9.0, 9.0, 2.0, 4.0, 0.0, 0.0, 5.0, 7.0]), Some(2.0));
    }
}
