//! The clusters that others are judged by: level ones that can be the floor, by height, and upright ones, by where they are
//! beside others.
//!
//! **Kept true.** They are those of the clusters as they are told of: [`Landmarks::set`] is called wherever that changes.
//!
//! **Cost.** To look costs O(log) and what is within a cell, for the floor O(log) a storey below and the large level surfaces
//! that lie lower there than its floor or just above such a one; to set follows the area of the cluster, in voxels where these are
//! large.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::iter::successors;

use nalgebra::{Point3, Vector3};

use crate::engine::consistent::class::evidence::{is_upright, middle, reach};
use crate::engine::consistent::class::{FLOOR_AREA, faces_up};
use crate::engine::consistent::graph::ComponentId;
use crate::engine::snapshot::Cluster;

/// Least height of a storey, from floor to floor (m): tables, cupboards and landings below are in it.
const STOREY: f64 = 2.5;
/// A surface is no floor where another lies above it by no more than this (m), with more than [`GHOST_SHARE`] times its area: it is the
/// mirror image of a part of that one, or noise below it, or a hollow in it. On the cabinet recording (8 cm) 1.3 m^2 lie 9 cm below
/// a floor of 32 m^2.
const GHOST: f64 = 0.3;
const GHOST_SHARE: f64 = 10.0;
/// Area below which (m^2) it is none either where the other lies higher, but less than a storey: a pit, or a landing that is seen down
/// a stairwell. Of a floor that a robot drives on, below a platform, more is soon seen.
const PIT: f64 = 4.0;
/// How far a piece of a floor may lie below it (m), at least.
const SUNK: f64 = 0.1;
/// Least edge of a cell (m): a few of them cover a wall, and a few walls are in each.
const CELL: f64 = 2.0;
/// Least edge of a cell, in voxels: a cluster of large ones has no more cells than voxels.
const CELL_VOXELS: f64 = 8.0;
/// For the rounding of poses (m).
const SLACK: f64 = 1e-3;

/// Integer place of a cell: x, y and z divided by its edge, rounded down.
type CellKey = [i32; 3];

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Landmarks {
    /// Edge of a cell (m).
    cell: f64,
    /// Level surfaces that face up and are large, with their areas (m^2).
    levels: BTreeMap<(Height, ComponentId), f64>,
    uprights: BTreeSet<(CellKey, ComponentId)>,
    /// What the sets hold of each component; nothing of most.
    marks: BTreeMap<ComponentId, Mark>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Mark {
    /// Height and area (m^2) where it is level, faces up and is large.
    level: Option<(Height, f64)>,
    /// Ascending.
    cells: Vec<CellKey>,
}

/// z (m), in total order.
#[derive(Clone, Copy, Debug)]
struct Height(f64);

impl Ord for Height {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Height {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Height {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Height {}

impl Landmarks {
    /// None yet, in a map of voxels of this edge (m).
    pub(super) fn new(voxel_size: f64) -> Self {
        let cell = (CELL_VOXELS * voxel_size).clamp(CELL, f64::MAX);
        Self { cell, levels: BTreeMap::new(), uprights: BTreeSet::new(), marks: BTreeMap::new() }
    }

    /// Notes what a component is told to be now, `None` where it is not told of.
    pub(super) fn set(&mut self, component: ComponentId, told: Option<&Cluster>) {
        let mark = told.map(|told| Mark::of(told, self.cell)).unwrap_or_default();
        let before = self.marks.remove(&component).unwrap_or_default();
        if mark != before {
            if let Some((height, _)) = before.level {
                self.levels.remove(&(height, component));
            }
            for cell in before.cells {
                self.uprights.remove(&(cell, component));
            }
            self.levels.extend(mark.level.map(|(height, area)| ((height, component), area)));
            self.uprights.extend(mark.cells.iter().map(|&cell| (cell, component)));
        }
        if mark != Mark::default() {
            self.marks.insert(component, mark);
        }
    }

    /// z of the lowest floor (m).
    pub(super) fn lowest_floor(&self) -> Option<f64> {
        self.floor_above(f64::NEG_INFINITY)
    }

    /// z of the floor of the storey that a surface with its middle at this height is in (m), `None` below the lowest. The lowest
    /// large surface that faces up, and is no ghost, is a floor, and so is the next one that is a storey higher, and so on. Its
    /// pieces may lie as far below it as poses put what is one surface `apart` (m).
    pub(super) fn floor_below(&self, middle: f64, apart: f64) -> Option<f64> {
        // So far up that a storey is less than is told apart, the next is at least another.
        let next = |floor: &f64| self.floor_above((floor + STOREY).max(floor.next_up()));
        let floors = successors(self.lowest_floor(), next);
        floors.take_while(|floor| *floor <= middle + SUNK.max(apart)).last()
    }

    /// z of the lowest from here on that is large and no ghost (m).
    fn floor_above(&self, least: f64) -> Option<f64> {
        let mut levels = self.levels.range((Height(least), ComponentId::MIN)..);
        levels.find(|(at, area)| !self.is_ghost(at.0, **area)).map(|(at, _)| at.0.0)
    }

    /// Whether there is a much larger surface just above one at this height, which has this area; above a small one, whether there is
    /// in its storey.
    fn is_ghost(&self, height: Height, area: f64) -> bool {
        let reach = if area < PIT { STOREY } else { GHOST };
        let above = (height, ComponentId::MIN)..=(Height(height.0 + reach), ComponentId::MAX);
        self.levels.range(above).any(|(_, other)| *other > GHOST_SHARE * area)
    }

    /// Upright components, among them all that one of these points can be beside, ascending.
    pub(super) fn near(&self, points: &[Point3<f64>]) -> Vec<ComponentId> {
        let of_cell = |cell| self.uprights.range((cell, ComponentId::MIN)..=(cell, ComponentId::MAX));
        let cells = points.iter().map(|point| [point.x, point.y, point.z].map(|at| index(at, self.cell)));
        let mut near: Vec<_> = cells.flat_map(of_cell).map(|(_, component)| *component).collect();
        near.sort_unstable();
        near.dedup();
        near
    }
}

impl Mark {
    fn of(cluster: &Cluster, cell: f64) -> Self {
        let area = cluster.area.filter(|area| *area >= FLOOR_AREA && faces_up(&cluster.normal));
        Self {
            // What is judged by it has a middle as well, the floor itself among others: its centroid may be far from there.
            level: area.map(|area| (Height(middle(cluster)), area)),
            cells: if is_upright(cluster) { cells(cluster, cell) } else { Vec::new() },
        }
    }
}

fn index(metres: f64, cell: f64) -> i32 {
    (metres / cell).floor() as i32
}

/// The cells of this edge that the box with the places beside a cluster reaches, ascending. The box is taken in pieces: that around a
/// long wall at a slant would hold half of the house.
fn cells(cluster: &Cluster, cell: f64) -> Vec<CellKey> {
    let half = reach(cluster);
    let [along, upwards] = [half.x, half.y].map(|half| (2.0 * half / cell).ceil().max(1.0) as i32);
    let piece = Vector3::new(half.x / f64::from(along), half.y / f64::from(upwards), half.z);
    let turn = cluster.pose.rotation.to_rotation_matrix().into_inner();
    let extent = turn.abs() * piece;
    let mut cells = Vec::new();
    for (i, j) in (0..along).flat_map(|i| (0..upwards).map(move |j| (i, j))) {
        let middle = [2 * i + 1 - along, 2 * j + 1 - upwards].map(f64::from);
        let middle = cluster.pose * Point3::new(middle[0] * piece.x, middle[1] * piece.y, 0.0);
        let [xs, ys, zs] = [0, 1, 2].map(|axis| {
            let (at, to) = (middle[axis], extent[axis] + SLACK);
            index(at - to, cell)..=index(at + to, cell)
        });
        for x in xs {
            cells.extend(ys.clone().flat_map(|y| zs.clone().map(move |z| [x, y, z])));
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

#[cfg(test)]
mod tests;
