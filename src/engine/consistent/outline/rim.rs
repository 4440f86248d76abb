//! How much of a column at the rim is covered, from the moments of its points.
//!
//! A column is taken as a unit square whose points lie evenly over the covered part, which a straight line cuts off
//! towards the sides that have no neighbour. Then the points' mean alone says where that line is: a triangle with legs
//! a and b has it at (a/3, b/3) of its right angle, a trapezoid with widths w0 and w1 at
//! (w0^2 + w0 w1 + w1^2) / (3 (w0 + w1)) and (w0 + 2 w1) / (3 (w0 + w1)). Where both sides of an axis lack a neighbour,
//! the extent follows from mean and deviation: points spread evenly over (a, b) have the deviation (b - a) / sqrt(12).

use super::footprint::Content;

/// How far the mean of a column's points lies from its far side at least, in columns.
const LEAST: f64 = 1.0 / 4096.0;

/// How a column is cut by the end of its cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cut {
    /// The covered part of the column's area, 0 to 1.
    pub(crate) fraction: f64,
    /// For each side how far the covered part reaches towards it along the column's middle line, measured from the
    /// opposite side: 0 to 1, and 1 towards a neighbour.
    pub(crate) reach: [f64; 4],
    /// Bit `s` is set where the column has a neighbour beyond side `s`.
    pub(crate) joined: u8,
}

/// Which sides of an axis have no neighbour.
#[derive(Clone, Copy, PartialEq)]
enum Open {
    None,
    /// The side of this number.
    One(usize),
    Both,
}

impl Cut {
    /// `joined` has bit `s` set where the column has a neighbour beyond side `s`.
    pub(crate) fn new(content: &Content, joined: u8) -> Self {
        let mut cut = Self { fraction: 1.0, reach: [1.0; 4], joined };
        if joined == 0b1111 {
            return cut;
        }
        let open = [0, 1].map(|axis| cut.open(axis));
        let means = content.means();
        for axis in 0..2 {
            if open[axis] == Open::Both {
                cut.cut_both(axis, means[axis], content);
            }
        }
        // How far the points' middle lies from the far side, at most one half: beyond it nothing is cut off.
        let near = [0, 1].map(|axis| match open[axis] {
            Open::One(side) => (if side < 2 { means[axis] } else { 1.0 - means[axis] }).min(0.5),
            Open::None => means[axis].min(1.0 - means[axis]),
            Open::Both => 0.5,
        });
        match open {
            [Open::One(u), Open::One(v)] if near[1] < near[0] => cut.cut_off(v, Some(u), near[1], near[0]),
            [Open::One(u), Open::One(v)] => cut.cut_off(u, Some(v), near[0], near[1]),
            [Open::One(side), _] => cut.cut_off(side, None, near[0], near[1]),
            [_, Open::One(side)] => cut.cut_off(side, None, near[1], near[0]),
            _ => {}
        }
        cut
    }

    /// Whether there is no neighbour beyond `side`.
    pub(crate) const fn is_open(&self, side: usize) -> bool {
        self.joined & (1 << side) == 0
    }

    fn open(&self, axis: usize) -> Open {
        match (self.is_open(axis), self.is_open(axis + 2)) {
            (false, false) => Open::None,
            (true, false) => Open::One(axis),
            (false, true) => Open::One(axis + 2),
            (true, true) => Open::Both,
        }
    }

    fn cut_both(&mut self, axis: usize, mean: f64, content: &Content) {
        let half = (3.0 * (content.squares()[axis] - mean * mean).max(0.0)).sqrt();
        self.reach[axis] = (mean + half).min(1.0);
        self.reach[axis + 2] = 1.0 - (mean - half).max(0.0);
        self.fraction *= (self.reach[axis] + self.reach[axis + 2] - 1.0).max(0.0);
    }

    /// A line cuts off a part towards `side`, and towards `across` where that side is open as well. `near` is the
    /// distance of the points' mean from the side opposite to `side`, `other` that along the other axis from the
    /// nearer side.
    fn cut_off(&mut self, side: usize, across: Option<usize>, near: f64, other: f64) {
        // A mean on the far side itself leaves nothing, not an area of 0 / 0.
        let near = near.max(LEAST);
        let other = other.max(near);
        let [fraction, reach, reach_across] = if other < 1.0 / 3.0 {
            let [a, b] = [3.0 * near, 3.0 * other];
            [0.5 * a * b, a * (1.0 - 0.5 / b), b * (1.0 - 0.5 / a)]
        } else {
            let ratio = (3.0 * other - 1.0) / (2.0 - 3.0 * other);
            let wide = 3.0 * near * (1.0 + ratio) / (1.0 + ratio + ratio * ratio);
            let middle = 0.5 * wide * (1.0 + ratio);
            // Where the other axis' middle line leaves the covered part.
            let across = (wide - 0.5) / (wide * (1.0 - ratio)).max(1e-9);
            [middle, middle, across]
        };
        self.fraction *= fraction.clamp(0.0, 1.0);
        self.reach[side] = reach.clamp(0.0, 1.0);
        if let Some(across) = across {
            self.reach[across] = reach_across.clamp(0.0, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column whose points lie evenly where `holds`.
    fn column(joined: u8, holds: impl Fn(f64, f64) -> bool) -> Cut {
        let points = (0..256 * 256).map(|i| [i % 256, i / 256].map(|at| (f64::from(at) + 0.5) / 256.0));
        let points: Vec<_> = points.filter(|[x, y]| holds(*x, *y)).collect();
        Cut::new(&Content::of_points(&points), joined)
    }

    const RIGHT: usize = 0;
    const TOP: usize = 1;

    fn without(sides: &[usize]) -> u8 {
        sides.iter().fold(0b1111, |joined, side| joined & !(1 << side))
    }

    #[test]
    fn a_straight_end_towards_a_missing_neighbour_is_found_whatever_its_slope() {
        for slope in [-0.4, -0.1, 0.0, 0.3] {
            let cut = column(without(&[RIGHT]), |x, y| x < 0.6 + slope * (y - 0.5));
            assert!((cut.fraction - 0.6).abs() < 0.01 && (cut.reach[RIGHT] - 0.6).abs() < 0.01, "{cut:?}");
            let mirrored = column(without(&[RIGHT + 2]), |x, y| 1.0 - x < 0.6 + slope * (y - 0.5));
            assert!((mirrored.fraction - 0.6).abs() < 0.01 && (mirrored.reach[2] - 0.6).abs() < 0.01);
        }
    }

    #[test]
    fn a_corner_is_cut_off_along_a_line() {
        let triangle = column(without(&[RIGHT, TOP]), |x, y| x / 0.9 + y / 0.7 < 1.0);
        assert!((triangle.fraction - 0.315).abs() < 0.01, "{triangle:?}");
        assert!((triangle.reach[RIGHT] - 0.9 * (1.0 - 0.5 / 0.7)).abs() < 0.02, "{triangle:?}");
        assert!((triangle.reach[TOP] - 0.7 * (1.0 - 0.5 / 0.9)).abs() < 0.02, "{triangle:?}");
        let pentagon = column(without(&[RIGHT, TOP]), |x, y| (1.0 - x) / 0.8 + (1.0 - y) / 0.5 > 1.0);
        assert!((pentagon.fraction - 0.8).abs() < 0.02, "{pentagon:?}");
    }

    #[test]
    fn a_strip_within_a_column_has_the_width_of_its_spread() {
        let strip = column(without(&[RIGHT, RIGHT + 2]), |x, _| (0.25..0.75).contains(&x));
        assert!((strip.fraction - 0.5).abs() < 0.01 && (strip.reach[0] - 0.75).abs() < 0.01, "{strip:?}");
    }

    #[test]
    fn towards_neighbours_nothing_is_cut_off() {
        assert_eq!(column(0b1111, |x, _| x < 0.3).fraction, 1.0);
        assert_eq!(column(without(&[TOP]), |x, _| x > 0.3).reach, [1.0; 4]);
    }
}
