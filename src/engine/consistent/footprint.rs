//! The columns that a planar cluster covers when its voxels are projected along an axis.
//!
//! A column is the pair of a voxel's two other indices. Its content is summed as integers, so that a footprint depends
//! on what is in it and on nothing else: neither on the order of changes nor on what has been there before. The rim,
//! the columns that lack one of their four neighbours, is kept in order, so that the outline is found without a look at
//! the columns within. A change costs four look-ups, and O(log rim) where a column appears or is gone.

use std::collections::BTreeSet;
use std::ops::{AddAssign, SubAssign};

use hashbrown::HashMap;
use nalgebra::UnitVector3;
use rustc_hash::FxBuildHasher;

use super::rim::Cut;
use crate::engine::key::VoxelKey;

/// The two indices of a column, by ascending axis.
pub(crate) type Column = [i32; 2];

/// Units of a column's edge in which offsets are counted.
pub(crate) const UNITS: u32 = 4096;

/// The sides of a column, counter-clockwise: side `s` lies opposite to `s ^ 2`.
pub(crate) const SIDES: [Column; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// All four sides, as bits.
const ALL: u8 = 0b1111;

/// The column beyond a side.
pub(crate) const fn beyond(column: Column, side: usize) -> Column {
    [column[0] + SIDES[side][0], column[1] + SIDES[side][1]]
}

/// The axis along which voxels are projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Axis(usize);

impl Axis {
    /// The axis along which `normal` is longest, the lowest of equals.
    pub(crate) fn dominant(normal: &UnitVector3<f64>) -> Self {
        let [x, y, z] = [normal.x.abs(), normal.y.abs(), normal.z.abs()];
        Self(if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        })
    }

    /// The axis of this index; `None` above 2.
    pub(crate) fn of(index: u8) -> Option<Self> {
        (index < 3).then_some(Self(usize::from(index)))
    }

    /// 0 to 2.
    pub(crate) const fn index(self) -> usize {
        self.0
    }

    /// The two other axes, ascending.
    pub(crate) const fn others(self) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][self.0]
    }

    /// The column of a voxel.
    pub(crate) fn column(self, key: VoxelKey) -> Column {
        self.others().map(|axis| key.indices()[axis])
    }
}

/// What lies in a column: voxels, and the moments of their points along the two other axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Content {
    /// Number of member voxels.
    pub(crate) voxels: u32,
    /// Number of their points, below 2^40.
    pub(crate) points: u64,
    /// Offsets of the points from the column's lower corner, summed, in `voxel_size / 4096`.
    pub(crate) sum: [u64; 2],
    /// Squares of these offsets, summed.
    pub(crate) squares: [u64; 2],
}

impl Content {
    /// Counts a point; its offsets from the column's lower corner are below [`UNITS`].
    #[cfg(test)]
    pub(crate) fn add_point(&mut self, offset: [u32; 2]) {
        self.points += 1;
        for (axis, offset) in offset.map(u64::from).into_iter().enumerate() {
            self.sum[axis] += offset;
            self.squares[axis] += offset * offset;
        }
    }
}

impl AddAssign for Content {
    fn add_assign(&mut self, other: Self) {
        self.voxels += other.voxels;
        self.points += other.points;
        for axis in 0..2 {
            self.sum[axis] += other.sum[axis];
            self.squares[axis] += other.squares[axis];
        }
    }
}

impl SubAssign for Content {
    fn sub_assign(&mut self, other: Self) {
        self.voxels -= other.voxels;
        self.points -= other.points;
        for axis in 0..2 {
            self.sum[axis] -= other.sum[axis];
            self.squares[axis] -= other.squares[axis];
        }
    }
}

/// A column that holds at least one voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Covered {
    content: Content,
    /// Bit `s` is set where the column beyond side `s` is covered as well.
    joined: u8,
}

/// The columns of a cluster.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Footprint {
    axis: Axis,
    columns: HashMap<Column, Covered, FxBuildHasher>,
    rim: BTreeSet<Column>,
}

impl Footprint {
    /// Of no voxel.
    pub(crate) fn new(axis: Axis) -> Self {
        Self { axis, columns: HashMap::default(), rim: BTreeSet::new() }
    }

    /// The axis along which its voxels were projected.
    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    /// Number of columns.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.columns.len()
    }

    /// The columns that lack a neighbour, ascending.
    pub(crate) fn rim(&self) -> impl Iterator<Item = Column> {
        self.rim.iter().copied()
    }

    /// Whether a member lies in this column.
    pub(crate) fn contains(&self, column: Column) -> bool {
        self.columns.contains_key(&column)
    }

    /// What lies in this column.
    #[cfg(test)]
    pub(crate) fn content(&self, column: Column) -> Option<Content> {
        self.columns.get(&column).map(|covered| covered.content)
    }

    /// How a column is cut by the cluster's end; `None` where it holds nothing.
    pub(crate) fn cut(&self, column: Column) -> Option<Cut> {
        self.columns.get(&column).map(|covered| Cut::new(&covered.content, covered.joined))
    }

    /// Adds voxels, points or both; points alone only where a voxel is.
    pub(crate) fn add(&mut self, column: Column, content: Content) {
        let covered = self.columns.entry(column).or_default();
        let is_new = covered.content.voxels == 0;
        covered.content += content;
        debug_assert!(covered.content.voxels > 0, "points without a voxel in {column:?}");
        if is_new {
            self.appear(column);
        }
    }

    /// Takes out what was added before; the points of a voxel go at the latest with it.
    pub(crate) fn remove(&mut self, column: Column, content: Content) {
        let Some(covered) = self.columns.get_mut(&column) else {
            debug_assert!(false, "nothing in {column:?}");
            return;
        };
        covered.content -= content;
        if covered.content.voxels == 0 {
            debug_assert_eq!(covered.content, Content::default(), "points without a voxel in {column:?}");
            self.columns.remove(&column);
            self.vanish(column);
        }
    }

    /// Takes in another cluster's columns along the same axis; O(the smaller of the two).
    #[cfg(test)]
    pub(crate) fn merge(&mut self, mut other: Self) {
        debug_assert_eq!(self.axis, other.axis);
        if other.len() > self.len() {
            std::mem::swap(self, &mut other);
        }
        other.columns.into_iter().for_each(|(column, covered)| self.add(column, covered.content));
    }

    fn appear(&mut self, column: Column) {
        let mut joined = 0;
        for side in 0..4 {
            let Some(other) = self.columns.get_mut(&beyond(column, side)) else { continue };
            joined |= 1 << side;
            other.joined |= 1 << (side ^ 2);
            if other.joined == ALL {
                self.rim.remove(&beyond(column, side));
            }
        }
        if let Some(covered) = self.columns.get_mut(&column) {
            covered.joined = joined;
        }
        if joined != ALL {
            self.rim.insert(column);
        }
    }

    fn vanish(&mut self, column: Column) {
        self.rim.remove(&column);
        for side in 0..4 {
            let Some(other) = self.columns.get_mut(&beyond(column, side)) else { continue };
            if other.joined == ALL {
                self.rim.insert(beyond(column, side));
            }
            other.joined &= !(1 << (side ^ 2));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn content() -> impl Strategy<Value = Content> {
        proptest::collection::vec(proptest::array::uniform2(0..UNITS), 0..6).prop_map(|points| {
            let mut content = Content { voxels: 1, ..Content::default() };
            points.into_iter().for_each(|point| content.add_point(point));
            content
        })
    }

    fn voxels() -> impl Strategy<Value = Vec<(Column, Content)>> {
        proptest::collection::vec((proptest::array::uniform2(-4..4), content()), 0..90)
    }

    fn of(voxels: &[(Column, Content)]) -> Footprint {
        let mut footprint = Footprint::new(Axis(2));
        voxels.iter().for_each(|&(column, content)| footprint.add(column, content));
        footprint
    }

    /// The rim by its definition.
    fn naive_rim(voxels: &[(Column, Content)]) -> Vec<Column> {
        let columns: BTreeSet<Column> = voxels.iter().map(|&(column, _)| column).collect();
        let lacks = |&column: &Column| (0..4).any(|side| !columns.contains(&beyond(column, side)));
        columns.iter().copied().filter(lacks).collect()
    }

    proptest! {
        #[test]
        fn it_depends_on_what_is_in_it_and_not_on_order_or_history(
            stay in voxels(), go in voxels(), turn in 0usize..90,
        ) {
            let whole = of(&stay);
            prop_assert_eq!(whole.rim().collect::<Vec<_>>(), naive_rim(&stay));

            let mut mixed: Vec<_> = stay.iter().chain(&go).copied().collect();
            let middle = turn.min(mixed.len());
            mixed.rotate_left(middle);
            let mut running = of(&mixed);
            go.iter().rev().for_each(|&(column, content)| running.remove(column, content));
            prop_assert_eq!(&running, &whole);

            let at = turn.min(stay.len());
            let mut halves = of(&stay[..at]);
            halves.merge(of(&stay[at..]));
            prop_assert_eq!(&halves, &whole);
        }
    }

    #[test]
    fn more_points_in_a_member_change_its_content_alone() {
        let mut footprint = of(&[([0, 0], Content { voxels: 1, ..Content::default() })]);
        let mut more = Content::default();
        more.add_point([5, 7]);
        footprint.add([0, 0], more);
        assert_eq!(footprint.content([0, 0]).unwrap().squares, [25, 49]);
        footprint.remove([0, 0], more);
        assert_eq!(footprint, of(&[([0, 0], Content { voxels: 1, ..Content::default() })]));
    }

    #[test]
    fn the_axis_is_that_of_the_longest_part_of_the_normal_and_the_lowest_of_equals() {
        let of =
            |x, y, z| Axis::dominant(&UnitVector3::new_normalize(nalgebra::Vector3::new(x, y, z))).index();
        assert_eq!(
            [of(0.1, -0.9, 0.3), of(0.0, 0.0, -1.0), of(1.0, 1.0, 1.0), of(0.1, -1.0, 1.0)],
            [1, 2, 0, 1]
        );
        let key = VoxelKey::new(3, 4, 5).unwrap();
        assert_eq!([0, 1, 2].map(|axis| Axis(axis).column(key)), [[4, 5], [3, 5], [3, 4]]);
    }
}
