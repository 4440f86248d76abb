//! Which blocks of voxels a scan may say something about.

use nalgebra::{Isometry3, Point3, Rotation3, Vector3};

use super::silhouette::{Face, Silhouette};
use super::{RangeGrid, TILE_CELLS, TILES};

/// How far a cube with this edge, parallel to the axes of the fixed frame, reaches from its centre along those of the
/// sensor's frame: from half an edge to half a diagonal.
pub(super) fn cube_reach(sensor_from_fixed: &Rotation3<f64>, edge: f64) -> Vector3<f64> {
    sensor_from_fixed.matrix().abs() * Vector3::repeat(0.5 * edge)
}

impl RangeGrid {
    /// Lists the blocks in which voxels may have been seen through, by ascending key, in place of what `blocks` held.
    ///
    /// Block `[bx, by, bz]` covers `[bx, bx + 1) * block_edge` along x of the fixed frame, likewise y and z. None is left
    /// out that lies in part in a measured direction, before the point measured there, and nearer than `max_depth`.
    ///
    /// Only blocks that are `wanted`, all of them among the `count` that are `known`, are projected and listed. Costs one such
    /// question for each block in the box around the view, some thousand for a Kinect, or for each known one where these are fewer,
    /// be the blocks ever so small, and one projection for each that is wanted.
    pub(crate) fn blocks_in_view(
        &self,
        fixed_from_sensor: &Isometry3<f64>,
        block_edge: f64,
        max_depth: f64,
        (count, known): (usize, impl Iterator<Item = [i32; 3]>),
        wanted: impl Fn([i32; 3]) -> bool,
        blocks: &mut Vec<[i32; 3]>,
    ) {
        blocks.clear();
        let Some((low, high)) = self.box_around_view(fixed_from_sensor, max_depth) else { return };
        let [low, high] = [low, high].map(|corner| corner.coords.map(|x| (x / block_edge).floor() as i32));
        let sensor_from_fixed = fixed_from_sensor.inverse();
        let rotation = sensor_from_fixed.rotation.to_rotation_matrix();
        let half = cube_reach(&rotation, block_edge);
        let is_in_view = |key: &[i32; 3]| {
            let middle = Vector3::from(*key).map(|b| (f64::from(b) + 0.5) * block_edge);
            let centre = rotation * Point3::from(middle) + sensor_from_fixed.translation.vector;
            self.may_see_into(&centre, &half, max_depth)
        };
        let in_box: f64 = (high.map(f64::from) - low.map(f64::from)).add_scalar(1.0).product();
        if (count as f64) < in_box {
            let is_in_box = |key: &[i32; 3]| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&key[axis]));
            blocks.extend(known.filter(|key| is_in_box(key) && wanted(*key) && is_in_view(key)));
            blocks.sort_unstable();
            return;
        }
        let beside = |bx: i32| (low.y..=high.y).map(move |by| [bx, by]);
        let columns = (low.x..=high.x).flat_map(beside);
        let keys = columns.flat_map(|[bx, by]| (low.z..=high.z).map(move |bz| [bx, by, bz]));
        blocks.extend(keys.filter(|key| wanted(*key) && is_in_view(key)));
    }

    /// Whether a box lies in part in a measured direction, before the point measured there, and nearer than `max_depth`.
    ///
    /// `centre` and `half` as in [`Body`](super::super::body::Body).
    fn may_see_into(&self, centre: &Point3<f64>, half: &Vector3<f64>, max_depth: f64) -> bool {
        Face::all().filter(|face| self.faces[face.index()]).any(|face| {
            Silhouette::new(face, centre, half, TILES)
                .is_some_and(|tiles| tiles.near < max_depth && self.any_tile_beyond(face, &tiles))
        })
    }

    fn any_tile_beyond(&self, face: Face, silhouette: &Silhouette) -> bool {
        let near = silhouette.near as f32;
        silhouette.rows.clone().any(|row| {
            let start = (face.index() * TILES + row) * TILES;
            let tiles = &self.tiles[start + silhouette.columns.start..start + silhouette.columns.end];
            tiles.iter().any(|&far| far > near)
        })
    }

    /// Opposite corners, in the fixed frame, of a box around everything in measured directions before the points there.
    fn box_around_view(
        &self,
        fixed_from_sensor: &Isometry3<f64>,
        max_depth: f64,
    ) -> Option<(Point3<f64>, Point3<f64>)> {
        let mut corners = None;
        let mut include = |point: Point3<f64>| {
            let point = fixed_from_sensor * point;
            let (low, high) = corners.get_or_insert((point, point));
            (*low, *high) = (low.inf(&point), high.sup(&point));
        };
        for face in Face::all() {
            let tiles = &self.tiles[face.index() * TILES * TILES..][..TILES * TILES];
            let Some(view) = FaceView::new(tiles) else { continue };
            include(Point3::origin());
            let depth = view.depth.min(max_depth);
            for column in view.columns {
                for row in view.rows {
                    include(face.point([column, row].map(tangent), depth));
                }
            }
        }
        corners
    }
}

/// The bounds of the tiles with points on a face and the largest depth in them.
struct FaceView {
    /// First column, and the one after the last.
    columns: [usize; 2],
    rows: [usize; 2],
    depth: f64,
}

impl FaceView {
    fn new(tiles: &[f32]) -> Option<Self> {
        let mut view = None;
        for (index, &depth) in tiles.iter().enumerate().filter(|&(_, &depth)| depth > 0.0) {
            let (column, row) = (index % TILES, index / TILES);
            let Self { columns, rows, depth: largest } =
                view.get_or_insert(Self { columns: [column, column + 1], rows: [row, row + 1], depth: 0.0 });
            *columns = [columns[0].min(column), columns[1].max(column + 1)];
            *rows = [rows[0].min(row), rows[1].max(row + 1)];
            *largest = largest.max(f64::from(depth));
        }
        view
    }
}

/// The tangent of the direction where a tile begins.
fn tangent(tile: usize) -> f64 {
    2.0 * (tile * TILE_CELLS) as f64 / (TILES * TILE_CELLS) as f64 - 1.0
}
