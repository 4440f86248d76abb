//! The file of a saved map from any bytes: what is taken goes on like any map.

use cfodi::engine::{Engine, Params, SavedMap};
use cfodi::store;

use super::bytes::Bytes;
use super::reader::Reader;
use super::scans::{Stray, scan};

/// Parameters of the maps among the seeds.
pub fn params() -> Params {
    Params::default().with_voxel_size(0.25).and_then(|params| params.with_min_points(2)).unwrap()
}

/// The first byte says whether the rest is a file, or what is within one (behind its checksum, where a fuzzer does not get by
/// itself), then whether it is a map of mode `paper`.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let (is_file, is_paper) = (bytes.yes(), bytes.yes());
    let params = if is_paper { params().with_mode(cfodi::engine::Mode::Paper) } else { params() };
    let scans = bytes.take(64);
    let map = if is_file {
        store::unpack(bytes.rest()).ok().map(|stored| stored.map)
    } else {
        postcard::from_bytes(bytes.rest()).ok()
    };
    if let Some(map) = map {
        go_on(params, map, &mut Bytes::new(scans));
    }
}

fn go_on(params: Params, map: SavedMap, bytes: &mut Bytes<'_>) {
    let Ok(mut engine) = Engine::restore(params, map) else { return };
    let mut reader = Reader::of(&engine.snapshot());
    for number in 0..3 {
        let update = engine.insert(&scan(bytes, number, Stray::Anywhere));
        reader.apply(&update);
        reader.agrees(&update, &engine.snapshot());
    }
    let again =
        Engine::restore(params, engine.freeze().save()).expect("what an engine saves can be restored");
    assert_eq!(format!("{:?}", again.snapshot()), format!("{:?}", engine.snapshot()));
}
