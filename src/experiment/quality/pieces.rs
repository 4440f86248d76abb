//! The true surfaces of a map, and the voxels that are scored.

use std::collections::BTreeMap;
use std::collections::hash_map::Entry;
use std::ops::RangeInclusive;

use nalgebra::{Point3, UnitVector3, Vector3};
use rustc_hash::FxHashMap;

use super::plane::{Plane, mean};
use super::truth::{SeenPart, TruthMap, TruthVoxel, voxel_index};
use crate::engine::{SurfaceClass, VoxelKey};

/// Area of truth cells from which on a surface counts as seen (m^2).
const SEEN_AREA: f64 = 0.5;
/// Least share of a scored voxel's points on its surface.
const MAJORITY: f64 = 0.8;
/// Furthest that a scored voxel's mean lies from its surface, in sigmas.
const SIGMAS: f64 = 2.0;
/// How many voxels away a truth cell looks for its surface, and straight before and behind as much further as poses may be wrong by.
const CELL_REACH: i32 = 2;
/// Places in a voxel, along the normal, at which it looks for any.
const STEPS: i32 = 8;
/// Furthest from one plane that cells lie which are one plane (m).
const FLAT: f64 = 1e-3;

/// A 6-connected component of the dense voxels whose majority is one surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TrueSurface {
    /// That of the simulated surface that most of its cells lie on; with a number where several seen surfaces have it, and
    /// `(scrap)` where it does not count as seen.
    pub(super) name: String,
    /// Area of its truth cells that a noise-free ray has hit and that lie at dense voxels (m^2).
    pub(super) seen_area: f64,
    /// The same by class.
    pub(super) areas: BTreeMap<SurfaceClass, f64>,
    /// Normals and areas (m^2) of those cells of one that is bent.
    pub(super) bends: Vec<(Vector3<f64>, f64)>,
    /// Middle of those cells; `None` without a cell.
    pub(super) middle: Option<Point3<f64>>,
    /// The plane of its rectangle, or the least squares plane through its cells where it has several; `None` where it is
    /// bent.
    pub(super) plane: Option<Plane>,
    /// Whether it is all on that plane, not on several close to it.
    pub(super) is_one_plane: bool,
    /// Number of its dense voxels.
    pub(super) voxels: u32,
    /// Number of its scored voxels.
    pub(super) scored: u32,
}

impl TrueSurface {
    /// Whether enough of it was seen to ask for it.
    pub(super) fn is_seen(&self) -> bool {
        // A cell has 4e-4 m^2; a sum of them that is 0.5 m^2 but for rounding is enough.
        self.seen_area >= SEEN_AREA - 1e-9
    }

    /// What of the seen area has this class (m^2).
    pub(super) fn area_of(&self, class: Option<SurfaceClass>) -> f64 {
        class.and_then(|class| self.areas.get(&class)).copied().unwrap_or_default()
    }

    /// What of the seen area a boundary in a plane can hold (m^2): of one that is bent its shadow there. A convex one casts that of
    /// what faces the one way, or the other.
    pub(super) fn area_on(&self, plane: &Plane) -> f64 {
        let shadow = |side: f64| -> f64 {
            let facing =
                self.bends.iter().map(|(normal, area)| (side * plane.normal.dot(normal)).max(0.0) * area);
            facing.sum()
        };
        if self.bends.is_empty() { self.seen_area } else { shadow(1.0).max(shadow(-1.0)) }
    }
}

/// What there is to be found in a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Truth {
    /// The surfaces in the order of their first voxels.
    pub(super) surfaces: Vec<TrueSurface>,
    /// The scored voxels by ascending key, each with the index of its surface.
    pub(super) scored: Vec<(VoxelKey, usize)>,
}

/// A component on its way to a [`TrueSurface`].
struct Piece {
    group: u32,
    voxels: u32,
    scored: u32,
    cells: Vec<SeenCell>,
}

/// A cell that was seen of a surface.
struct SeenCell {
    /// Index of the surface.
    surface: usize,
    middle: Point3<f64>,
    /// m^2.
    area: f64,
}

impl Truth {
    pub(super) fn new(map: &TruthMap, seen: impl Fn(u32) -> SeenPart) -> Self {
        let dense = map.dense();
        let (piece_of, mut pieces) = components(&dense);
        let mut scored = Vec::new();
        for voxel in dense {
            let Some(&piece) = piece_of.get(&voxel.key) else { continue };
            pieces[piece].voxels += 1;
            if is_scored(map, voxel) {
                pieces[piece].scored += 1;
                scored.push((voxel.key, piece));
            }
        }
        let reach = CELL_REACH + (SIGMAS * map.spread_ahead() / map.voxel_size).ceil() as i32;
        for (index, surface) in map.surfaces.iter().enumerate() {
            let group = map.groups.of_label(surface.label()).filter(|&group| map.stays(group));
            let Some(group) = group else { continue };
            let SeenPart { cells, area } = seen(surface.label());
            let area = area / cells.len() as f64;
            for cell in cells {
                let of_group =
                    |key: VoxelKey| piece_of.get(&key).copied().filter(|&piece| pieces[piece].group == group);
                let normal = surface.normal_at(&cell);
                let straight = |steps| straight(&cell, normal, map.voxel_size, steps);
                // Of a cell by which there is none too little was measured to be in any map.
                let is_mapped = straight(0..=CELL_REACH * STEPS).any(|key| piece_of.contains_key(&key));
                let piece = is_mapped.then(|| nearest(&cell, map.voxel_size, of_group)).flatten();
                let further = || straight(CELL_REACH * STEPS + 1..=reach * STEPS).find_map(of_group);
                if let Some(piece) = piece.or_else(further) {
                    pieces[piece].cells.push(SeenCell { surface: index, middle: cell, area });
                }
            }
        }
        let surfaces = pieces.iter().map(|piece| piece.surface(map)).collect();
        Self { surfaces: numbered(surfaces), scored }
    }
}

/// The component of each dense voxel with a majority; components in the order of their first voxels.
fn components(dense: &[&TruthVoxel]) -> (FxHashMap<VoxelKey, usize>, Vec<Piece>) {
    let majority = |voxel: &TruthVoxel| Some((voxel.key, voxel.majority()?.0));
    let groups: FxHashMap<VoxelKey, u32> = dense.iter().filter_map(|voxel| majority(voxel)).collect();
    let mut piece_of = FxHashMap::default();
    let mut pieces = Vec::new();
    for (start, group) in dense.iter().filter_map(|voxel| majority(voxel)) {
        if piece_of.contains_key(&start) {
            continue;
        }
        let mut open = vec![start];
        piece_of.insert(start, pieces.len());
        while let Some(key) = open.pop() {
            for next in key.neighbours().filter(|next| groups.get(next) == Some(&group)) {
                if let Entry::Vacant(entry) = piece_of.entry(next) {
                    entry.insert(pieces.len());
                    open.push(next);
                }
            }
        }
        pieces.push(Piece { group, voxels: 0, scored: 0, cells: Vec::new() });
    }
    (piece_of, pieces)
}

fn is_scored(map: &TruthMap, voxel: &TruthVoxel) -> bool {
    let Some((group, points)) = voxel.majority().filter(|(group, _)| map.stays(*group)) else { return false };
    let mean = voxel.mean();
    let distances = map.groups.members(group).filter_map(|index| map.surfaces[index].distance(&mean, 0.0));
    f64::from(points) >= MAJORITY * f64::from(voxel.count())
        && distances.fold(f64::INFINITY, f64::min) <= SIGMAS * voxel.sigma()
}

/// The piece of the voxel that holds `cell`, or of the voxel with one whose middle is nearest; the lower key of two as near.
fn nearest(
    cell: &Point3<f64>,
    voxel_size: f64,
    piece_of: impl Fn(VoxelKey) -> Option<usize>,
) -> Option<usize> {
    let own = key_at(cell, voxel_size)?;
    if let Some(piece) = piece_of(own) {
        return Some(piece);
    }
    let steps = -CELL_REACH..=CELL_REACH;
    let around = steps.clone().flat_map(|x| {
        let steps = steps.clone();
        steps.clone().flat_map(move |y| steps.clone().map(move |z| [x, y, z]))
    });
    let found = around.filter_map(|step| {
        let key = own.step(step)?;
        let middle = Vector3::from(key.indices().map(|i| (f64::from(i) + 0.5) * voxel_size));
        Some(((middle - cell.coords).norm_squared(), piece_of(key)?))
    });
    found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, piece)| piece)
}

/// The voxels straight before and behind a cell of a surface with this normal, where noise moves points to; the nearest first.
fn straight(
    cell: &Point3<f64>,
    normal: UnitVector3<f64>,
    voxel_size: f64,
    steps: RangeInclusive<i32>,
) -> impl Iterator<Item = VoxelKey> {
    let places = steps.flat_map(move |step| {
        let away = normal.into_inner() * (f64::from(step) / f64::from(STEPS) * voxel_size);
        [cell + away, cell - away]
    });
    places.filter_map(move |place| key_at(&place, voxel_size))
}

fn key_at(place: &Point3<f64>, voxel_size: f64) -> Option<VoxelKey> {
    let [ix, iy, iz] = voxel_index(place, voxel_size);
    VoxelKey::new(ix, iy, iz)
}

impl Piece {
    fn surface(&self, map: &TruthMap) -> TrueSurface {
        // Seen area of each simulated surface of it.
        let mut shares: BTreeMap<usize, f64> = BTreeMap::new();
        self.cells.iter().for_each(|cell| *shares.entry(cell.surface).or_default() += cell.area);
        let mut areas = BTreeMap::new();
        for (&index, area) in &shares {
            *areas.entry(map.surfaces[index].class()).or_default() += area;
        }
        // Of two with as much area the first, which without a cell is that of the group.
        let main = shares.iter().rev().max_by(|a, b| a.1.total_cmp(b.1));
        let main = &map.surfaces[main.map_or(self.group as usize, |(index, _)| *index)];
        let points: Vec<_> = self.cells.iter().map(|cell| cell.middle).collect();
        let own = || Plane::through(&main.pose().translation.vector.into(), &main.normal());
        let plane = main.shape().is_flat().then(|| {
            let fitted = (shares.len() > 1).then(|| Plane::fit(&points, &main.normal()));
            fitted.flatten().unwrap_or_else(own)
        });
        let bends = self.cells.iter().filter(|_| plane.is_none());
        let bends =
            bends.map(|cell| (map.surfaces[cell.surface].normal_at(&cell.middle).into_inner(), cell.area));
        let on = |plane: Plane| points.iter().all(|point| plane.height(point).abs() <= FLAT);
        TrueSurface {
            name: main.name().to_owned(),
            seen_area: shares.values().sum(),
            areas,
            bends: bends.collect(),
            middle: mean(&points),
            plane,
            is_one_plane: plane.is_some_and(on),
            voxels: self.voxels,
            scored: self.scored,
        }
    }
}

/// Numbers the seen surfaces of one name, the largest first; where there is one, it has no number. The others are said to
/// be scraps.
fn numbered(mut surfaces: Vec<TrueSurface>) -> Vec<TrueSurface> {
    let mut of_name: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, surface) in surfaces.iter().enumerate().filter(|(_, surface)| surface.is_seen()) {
        of_name.entry(surface.name.clone()).or_default().push(index);
    }
    surfaces.iter_mut().filter(|surface| !surface.is_seen()).for_each(|surface| surface.name += " (scrap)");
    for mut indices in of_name.into_values().filter(|indices| indices.len() > 1) {
        indices.sort_by(|&a, &b| surfaces[b].seen_area.total_cmp(&surfaces[a].seen_area));
        for (number, index) in (1..).zip(indices) {
            let name = &mut surfaces[index].name;
            *name = format!("{name} #{number}");
        }
    }
    surfaces
}
