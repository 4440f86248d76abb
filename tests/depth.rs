//! Depth images of a real recording give the map that its clouds give.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod support;

use std::collections::BTreeSet;

use byteorder::LittleEndian;
use cdr_encoding::CdrDeserializer;
use cfodi::cloud::{Camera, CloudFilter, DepthSeed};
use cfodi::engine::{Engine, Params, Points, Scan, VoxelKey};
use cfodi::msg::ros::Image;
use serde::de::DeserializeSeed;

const FILTER: CloudFilter = CloudFilter::DEFAULT;

fn dense(scans: impl Iterator<Item = Scan>) -> BTreeSet<VoxelKey> {
    let mut engine = Engine::new(Params::paper());
    scans.for_each(|scan| drop(engine.insert(&scan)));
    engine.snapshot().voxels.iter().map(|voxel| voxel.key).collect()
}

#[test]
fn depth_images_in_millimetres_give_the_map_of_their_clouds() {
    let test = "depth_images_in_millimetres_give_the_map_of_their_clouds";
    let Some(recording) = support::recording("tum_fr3_cabinet58", test) else { return };
    let camera = Camera::from_info(&recording.camera_info()).unwrap();
    let through_images = dense(recording.rows().iter().map(|row| {
        let bytes = cdr_encoding::to_vec::<Image, LittleEndian>(&recording.image(row)).unwrap();
        let mut bytes = CdrDeserializer::<LittleEndian>::new(&bytes);
        let cloud = DepthSeed::new(camera, FILTER).deserialize(&mut bytes).unwrap().unwrap();
        Scan { stamp: cloud.stamp, fixed_from_sensor: row.map_from_optical, points: cloud.points }
    }));
    let of_millimetres = dense(recording.rows().iter().map(|row| {
        let points = recording.points_of_millimetres(&recording.millimetres(row));
        Scan { stamp: row.stamp, fixed_from_sensor: row.map_from_optical, points: Points::F32(points) }
    }));
    let of_fifths = dense(recording.scans(1));
    let differ = |other: &BTreeSet<VoxelKey>| through_images.symmetric_difference(other).count();
    let (same, finer) = (differ(&of_millimetres), differ(&of_fifths));
    eprintln!(
        "{} dense voxels: {same} differ from the map of the same millimetres ({}), {finer} from that of the PNGs' \
         fifths of a millimetre ({})",
        through_images.len(),
        of_millimetres.len(),
        of_fifths.len()
    );
    assert!(same as f64 <= 0.001 * of_millimetres.len() as f64, "{same} of {}", of_millimetres.len());
    assert!(finer as f64 <= 0.05 * of_fifths.len() as f64, "{finer} of {}", of_fifths.len());
}
