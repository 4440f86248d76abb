//! The engine on any scans: each mode equals its definition after every scan, and its updates add up to its snapshots.

use cfodi::engine::canonical;
use cfodi::engine::consistent::Consistent;
use cfodi::engine::paper::Cfodi;
use cfodi::engine::paper::oracle::Oracle;

use super::bytes::Bytes;
use super::reader::Reader;
use super::scans::{SCANS, Stray, consistent_params, paper_params, scan};

/// The first byte chooses the mode, the rest makes parameters and scans.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    match bytes.below(3) {
        0 => paper(&mut bytes),
        1 => paper_alone(&mut bytes),
        _ => consistent(&mut bytes),
    }
}

/// Equal to the naive oracle.
fn paper(bytes: &mut Bytes<'_>) {
    let params = paper_params(bytes);
    let (mut engine, mut oracle, mut reader) = (Cfodi::new(params), Oracle::new(params), Reader::default());
    for number in 0..SCANS {
        if bytes.is_empty() {
            return;
        }
        let scan = scan(bytes, number, Stray::Beyond);
        let update = engine.insert(&scan);
        oracle.insert(&scan);
        let snapshot = engine.snapshot();
        assert_eq!(oracle.difference(&snapshot), None);
        reader.apply(&update);
        reader.agrees(&update, &snapshot);
    }
}

/// Where ties may be met, which the oracle decides otherwise, what remains is that the map is sound.
fn paper_alone(bytes: &mut Bytes<'_>) {
    let (mut engine, mut reader) = (Cfodi::new(paper_params(bytes)), Reader::default());
    for number in 0..SCANS {
        if bytes.is_empty() {
            return;
        }
        let update = engine.insert(&scan(bytes, number, Stray::Anywhere));
        reader.apply(&update);
        reader.agrees(&update, &engine.snapshot());
    }
}

/// Equal to its definition from scratch.
fn consistent(bytes: &mut Bytes<'_>) {
    let params = consistent_params(bytes);
    let (mut map, mut reader) = (Consistent::new(params), Reader::default());
    for number in 0..SCANS {
        if bytes.is_empty() {
            return;
        }
        let scan = scan(bytes, number, Stray::Anywhere);
        let update = map.insert(&scan);
        assert!(update.points_beyond_grid as usize <= scan.points.len());
        assert_eq!(canonical(map.partition()), canonical(map.scratch()));
        reader.apply(&update);
        reader.agrees(&update, &map.snapshot());
        let bound = params.max_voxels();
        assert!(bound == 0 || map.voxel_count() as u64 <= bound);
    }
}
