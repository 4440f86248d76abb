//! The rings of an outline, every one held against every other: the oracle of what finds the few that matter.

use super::*;

/// The kept rings of those that were traced, with few vertices.
pub(super) fn drawn(traced: &Rings, least_hole: u32, tolerance: f64) -> Rings {
    let kept = kept(traced, least_hole);
    for attempt in 0..ATTEMPTS {
        let tolerance = tolerance / f64::from(1 << attempt);
        let mut fewer = Rings::default();
        for &number in &kept {
            Simplifying::default().draw(traced.ring(number), tolerance, &mut fewer);
            fewer.end(traced.columns(number));
        }
        if are_apart(&fewer) {
            return fewer;
        }
    }
    let mut rings = Rings::default();
    for number in kept {
        traced.ring(number).iter().for_each(|vertex| rings.push(*vertex));
        rings.end(traced.columns(number));
    }
    rings
}

/// The part with most area less its holes, the first of equals, and these holes: those around which it is the smallest.
fn kept(traced: &Rings, least_hole: u32) -> Vec<usize> {
    let area = |ring: usize| doubled_area(traced.ring(ring));
    let parts = || (0..traced.len()).filter(|part| traced.columns(*part) >= 0);
    let is_large = |hole: &usize| traced.columns(*hole) <= -i64::from(least_hole.max(1));
    let owner = |hole: usize| {
        let around = parts().filter(|part| lies_within(traced.ring(hole)[0], traced.ring(*part)));
        around.min_by(|a, b| area(*a).total_cmp(&area(*b)))
    };
    let holes_of =
        |part: usize| (0..traced.len()).filter(is_large).filter(move |hole| owner(*hole) == Some(part));
    let rest = |part: usize| area(part) + holes_of(part).map(area).sum::<f64>();
    let largest = parts().max_by(|a, b| rest(*a).total_cmp(&rest(*b)).then(b.cmp(a))).unwrap();
    std::iter::once(largest).chain(holes_of(largest)).collect()
}

/// Whether no edge meets another but at its ends, and all rings lie within the first.
fn are_apart(rings: &Rings) -> bool {
    let rings: Vec<_> = rings.iter().collect();
    let meets = |a: usize, b: usize| {
        sides(rings[a]).enumerate().any(|(i, edge)| {
            (sides(rings[b]).enumerate()).any(|(j, other)| {
                (a, i) < (b, j) && {
                    let n = rings[a].len();
                    match (a == b, (i + 1) % n == j, (j + 1) % n == i) {
                        (true, true, _) => turns_back(edge, other),
                        (true, _, true) => turns_back(other, edge),
                        _ => touch(edge, other),
                    }
                }
            })
        })
    };
    !(0..rings.len()).any(|a| (a..rings.len()).any(|b| meets(a, b)))
        && rings[1..].iter().all(|ring| lies_within(ring[0], rings[0]))
}

type Side = [Vector2<f64>; 2];

fn sides(ring: &[Vector2<f64>]) -> impl Iterator<Item = Side> {
    (0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()]])
}

fn turns_back([a, b]: Side, [_, c]: Side) -> bool {
    (b - a).perp(&(c - b)) == 0.0 && (b - a).dot(&(c - b)) < 0.0
}

fn touch([a, b]: Side, [c, d]: Side) -> bool {
    let turn = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| (q - p).perp(&(r - p));
    let (least, most) = (a.inf(&b).sup(&c.inf(&d)), a.sup(&b).inf(&c.sup(&d)));
    least <= most && turn(a, b, c) * turn(a, b, d) <= 0.0 && turn(c, d, a) * turn(c, d, b) <= 0.0
}

/// Whether a point lies within a ring (even-odd).
pub(super) fn lies_within(point: Vector2<f64>, ring: &[Vector2<f64>]) -> bool {
    let crosses = |[a, b]: &Side| {
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    sides(ring).filter(crosses).count() % 2 == 1
}
