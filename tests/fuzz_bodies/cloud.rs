//! A serialised `sensor_msgs/PointCloud2`: both orders of bytes, both ways in.

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::CdrDeserializer;
use cfodi::cloud::{Cloud, CloudError, CloudFilter, CloudSeed, Optical, decode};
use cfodi::engine::Points;
use cfodi::msg::ros::PointCloud2;
use serde::de::DeserializeSeed as _;

use super::bytes::Bytes;

/// The first two bytes choose the filter, the rest is the message.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let optical = bytes.one_of(&[Optical::Auto, Optical::Yes, Optical::No]);
    let (max_range, max_points) = bytes.one_of(&[(6.0, 4_000_000), (6.0, 20), (1e6, 4_000_000), (1e6, 1)]);
    let filter = CloudFilter { max_range, optical, max_points, ..CloudFilter::DEFAULT };
    let cdr = bytes.rest();
    both_ways::<LittleEndian>(cdr, &filter);
    both_ways::<BigEndian>(cdr, &filter);
}

fn both_ways<O: ByteOrder>(cdr: &[u8], filter: &CloudFilter) {
    let seeded = CloudSeed::new(*filter).deserialize(&mut CdrDeserializer::<O>::new(cdr));
    let owned = cdr_encoding::from_bytes::<PointCloud2, O>(cdr).map(|(message, _)| decode(&message, filter));
    match (seeded, owned) {
        (Ok(seeded), Ok(owned)) => {
            assert_eq!(seeded, owned);
            check(seeded, filter, cdr.len());
        }
        (Err(_), Err(_)) => {}
        (seeded, owned) => panic!("{seeded:?}, but {owned:?}"),
    }
}

/// What holds of whatever was taken in, of a message of so many bytes.
pub fn check(decoded: Result<Cloud, CloudError>, filter: &CloudFilter, bytes: usize) {
    let cloud = match decoded {
        Ok(cloud) => cloud,
        Err(error) => {
            assert!(error.to_string().len() < 4000 && !error.reason().key.is_empty());
            return;
        }
    };
    assert_eq!(cloud.total as usize, cloud.points.len() + (cloud.invalid + cloud.out_of_range) as usize);
    assert!(cloud.total <= filter.max_points && cloud.total as usize <= 8 * bytes);
    assert!(!cloud.frame_id.is_empty() && cloud.frame_id.len() <= 256 && !cloud.frame_id.starts_with('/'));
    match &cloud.points {
        Points::F32(points) => assert!(points.iter().flatten().all(|value| value.is_finite())),
        Points::Ended { points, ends } => {
            assert!(points.iter().chain(ends).flatten().all(|value| value.is_finite()));
            assert!(ends.len() <= cloud.out_of_range as usize);
        }
        Points::F64(points) => assert!(points.iter().flatten().all(|value| value.is_finite())),
        Points::Depths(depths) => {
            let list = depths.list();
            assert_eq!(list.len(), depths.len());
            assert!(list.iter().flatten().all(|value| value.is_finite()));
        }
    }
}
