//! The dense voxels of a map as they leave the engine, by ascending key.

use std::cell::OnceCell;
use std::ops::Range;

use nalgebra::UnitVector3;

use super::FrozenConsistent;
use crate::engine::consistent::block::{Block, BlockIndex, BlockKey, EDGE, Voxel};
use crate::engine::consistent::patch::plane_sums::{Fit, PlaneSums};
use crate::engine::consistent::surfaces::Faces;
use crate::engine::key::ClusterId;
use crate::engine::snapshot::DenseVoxel;

impl FrozenConsistent {
    /// All dense voxels by ascending key. Blocks are sorted, and not voxels, which are fifty times as many.
    pub(super) fn voxels(&self) -> Vec<DenseVoxel> {
        let mut blocks: Vec<_> = self.blocks.blocks().map(|(index, block)| (block.key, index)).collect();
        blocks.sort_unstable();
        let mut voxels = Vec::with_capacity(self.blocks.dense() as usize);
        let faces = self.surfaces.faces();
        // Blocks with the same x: all that holds voxels of these eight x.
        let mut slab = Vec::new();
        for blocks in blocks.chunk_by(|(a, _), (b, _)| a[0] == b[0]) {
            slab.clear();
            let of_block = |&(key, index): &(BlockKey, BlockIndex)| {
                let begin = slab.len();
                self.put_voxels(index, &faces, &mut slab);
                (key[1], begin..slab.len())
            };
            let mut ranges: Vec<_> = blocks.iter().map(of_block).collect();
            by_columns(&slab, &mut ranges, &mut voxels);
        }
        voxels
    }

    /// The dense voxels of a block, ascending. A voxel has the normal of its patch, which sees further than the voxel's own
    /// neighbourhood, and its curvature; one in no patch that of its neighbourhood in its block.
    fn put_voxels(&self, index: BlockIndex, faces: &Faces, voxels: &mut Vec<DenseVoxel>) {
        let block = self.blocks.block(index);
        let published = self.surfaces.voxels(index, faces);
        let now = OnceCell::new();
        for voxel in block.voxels().iter().filter(|voxel| self.blocks.is_dense(voxel)) {
            let place = published.binary_search_by_key(&voxel.cell, |(state, _)| state.cell());
            let face = place.ok().and_then(|place| published[place].1);
            let shape = face.map(|face| (face.normal, face.curvature)).or_else(|| {
                let now = now.get_or_init(|| self.blocks.states(block));
                let fit = PlaneSums::around(now, voxel.cell, &self.noise).fit().filter(Fit::spans_plane)?;
                Some((fit.plane.normal, fit.curvature() as f32))
            });
            voxels.extend(self.voxel(block, voxel, shape, face.and_then(|face| face.cluster)));
        }
    }

    fn voxel(
        &self,
        block: &Block,
        voxel: &Voxel,
        shape: Option<(UnitVector3<f64>, f32)>,
        cluster: Option<ClusterId>,
    ) -> Option<DenseVoxel> {
        Some(DenseVoxel {
            key: block.voxel_key(voxel.cell)?,
            count: voxel.count,
            centre: self.blocks.centre(block, voxel),
            normal: shape.map(|(normal, _)| normal),
            curvature: shape.map_or(f32::NAN, |(_, curvature)| curvature),
            cluster,
        })
    }
}

/// Puts the voxels of blocks with the same x, ascending by y and z, in the order of their keys: for each block its y and the
/// range of its voxels, which are ascending.
fn by_columns(slab: &[DenseVoxel], blocks: &mut [(i32, Range<usize>)], voxels: &mut Vec<DenseVoxel>) {
    for x in 0..EDGE {
        for row in blocks.chunk_by_mut(|(a, _), (b, _)| a == b) {
            for y in 0..EDGE {
                for (_, left) in &mut *row {
                    let is_here = |voxel: &&DenseVoxel| {
                        let [ix, iy, _] = voxel.key.indices();
                        [ix.rem_euclid(EDGE), iy.rem_euclid(EDGE)] == [x, y]
                    };
                    let here = slab[left.clone()].iter().take_while(is_here);
                    let before = voxels.len();
                    voxels.extend(here.cloned());
                    left.start += voxels.len() - before;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    use crate::engine::binning::between;
    use crate::engine::consistent::{Consistent, NoiseModel};
    use crate::engine::params::Params;
    use crate::engine::points::Points;
    use crate::engine::scan::{Scan, Stamp};

    /// A pole, one voxel wide.
    #[test]
    fn what_spans_no_plane_has_no_normal() {
        let params = Params::default().with_min_points(1).unwrap().with_voxel_size(0.1).unwrap();
        let params = params.with_noise_model(NoiseModel::None);
        let normals = |rows: &[f32]| {
            let mut engine = Consistent::new(params);
            let points =
                (0..3).flat_map(|along| rows.iter().map(move |&y| [0.05 + 0.1 * along as f32, y, 1.05]));
            let points = Points::F32(points.collect());
            engine.insert(&Scan {
                stamp: Stamp::from_nanos(0),
                fixed_from_sensor: Isometry3::identity(),
                points,
            });
            engine.freeze().voxels().iter().filter(|voxel| voxel.normal.is_some()).count()
        };
        assert_eq!((normals(&[0.05]), normals(&[0.05, 0.15, 0.25])), (0, 9));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn all_dense_voxels_come_by_ascending_key(
            points in prop::collection::vec(prop::array::uniform3(between(-2.0, 2.0)), 1..300),
        ) {
            let params = Params::default().with_min_points(1).unwrap().with_voxel_size(0.1).unwrap();
            let mut engine = Consistent::new(params);
            let stamp = Stamp::from_nanos(0);
            let scan = Scan { stamp, fixed_from_sensor: Isometry3::identity(), points: Points::F32(points) };
            engine.insert(&scan);
            let voxels = engine.freeze().voxels();
            prop_assert_eq!(voxels.len(), engine.dense_count());
            prop_assert!(voxels.is_sorted_by(|a, b| a.key < b.key));
        }
    }
}
