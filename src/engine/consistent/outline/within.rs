//! Which rings lie within others, many at once.
//!
//! A ring that meets no other lies within it wholly or not at all, so that any of its points tells. One is taken on a
//! line through the middles of columns, which nearly every ring crosses, and of the others that have been entered along that
//! line below it and not left, the last is the innermost around it. Lines are shared by the rings of a row, and an edge
//! crosses no more of them than it is long: costs O(n log n) for n columns at the rim. Lengths in columns.

use nalgebra::Vector2;

use super::rings::edges;

type Vertex = Vector2<f64>;

/// Rings of which it is asked what they lie within, and memory to find it in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Within {
    /// One for each ring that is asked about.
    points: Vec<Vertex>,
    /// The lines that these lie on, by their x, ascending.
    lines: Vec<f64>,
    met: Vec<Met>,
    /// The rings that have been entered and not left, from the outermost to the innermost.
    entered: Vec<u32>,
    innermost: Vec<Option<u32>>,
}

/// What is met along a line.
#[derive(Clone, Copy, Debug)]
struct Met {
    at: Vertex,
    what: What,
}

/// What a line meets: the beginning or end of a ring's inside, or a point that is asked about.
///
/// In this order at one place: a ring whose foremost vertex lies on a line is entered there, and left at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    /// The ring of this number is entered.
    Entry(u32),
    /// It is left.
    Exit(u32),
    /// The point of this number.
    Point(u32),
}

impl Within {
    /// Asks about these rings, and no longer about those before.
    pub(crate) fn ask<'a>(&mut self, rings: impl Iterator<Item = &'a [Vertex]>) {
        self.points.clear();
        self.points.extend(rings.map(point));
        self.lines.clear();
        self.lines.extend(self.points.iter().map(|point| point.x));
        self.lines.sort_unstable_by(f64::total_cmp);
        self.lines.dedup();
    }

    /// The innermost of `around` that each of the rings lies within, by their numbers; it meets none of these, and they run
    /// counter-clockwise and do not cross.
    pub(crate) fn innermost<'a>(&mut self, around: impl Iterator<Item = &'a [Vertex]>) -> &[Option<u32>] {
        let Self { points, lines, met, entered, innermost } = self;
        met.clear();
        met.extend((0..).zip(&*points).map(|(number, &at)| Met { at, what: What::Point(number) }));
        for (number, ring) in (0..).zip(around) {
            for (a, b) in edges(ring) {
                let (least, most) = (a.x.min(b.x), a.x.max(b.x));
                let what = if a.x < b.x { What::Entry(number) } else { What::Exit(number) };
                let from = lines.partition_point(|line| *line < least);
                let crossed = lines[from..].iter().take_while(|line| **line < most);
                met.extend(crossed.map(|&line| Met { at: on_line(a, b, line), what }));
            }
        }
        let place = |a: &Met, b: &Met| a.at.x.total_cmp(&b.at.x).then(a.at.y.total_cmp(&b.at.y));
        met.sort_unstable_by(|a, b| place(a, b).then(a.what.cmp(&b.what)));
        innermost.clear();
        innermost.resize(points.len(), None);
        for line in met.chunk_by(|a, b| a.at.x == b.at.x) {
            entered.clear();
            for met in line {
                match met.what {
                    What::Entry(ring) => entered.push(ring),
                    What::Exit(ring) => leave(entered, ring),
                    What::Point(number) => innermost[number as usize] = entered.last().copied(),
                }
            }
        }
        innermost
    }
}

/// Takes a ring out of those that have been entered: it is the last of them, but for those that are left at the same place.
fn leave(entered: &mut Vec<u32>, ring: u32) {
    if let Some(place) = entered.iter().rposition(|other| *other == ring) {
        entered.remove(place);
    }
}

/// Where a ring first crosses a line through the middles of columns; where it is so narrow that it crosses none, a vertex.
fn point(ring: &[Vertex]) -> Vertex {
    let crossing = |(a, b): (&Vertex, &Vertex)| {
        let line = (a.x.min(b.x) - 0.5).ceil() + 0.5;
        (line < a.x.max(b.x)).then(|| on_line(a, b, line))
    };
    edges(ring).find_map(crossing).unwrap_or(ring[0])
}

/// The point of an edge on a line that it crosses: its end to the last bit, where the next edge begins.
fn on_line(a: &Vertex, b: &Vertex, line: f64) -> Vertex {
    if line == b.x {
        return *b;
    }
    Vertex::new(line, a.y + (line - a.x) / (b.x - a.x) * (b.y - a.y))
}
