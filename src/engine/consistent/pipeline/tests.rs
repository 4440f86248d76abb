use super::*;
use crate::engine::scan::Stamp;
use crate::sim::{Drive, Scene};

/// Drives through a scene and checks after every scan that what clusters are judged by is found as by a scan of all.
fn drive_and_check(scene: &str, params: Params, scans: impl Iterator<Item = u32>) {
    let drive = Drive::new(Scene::named(scene).unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut engine = Consistent::new(params);
    let (mut removed, mut neighbours) = (0, 0);
    for index in scans {
        removed += engine.insert(&drive.labelled_scan(index).scan).removed.len();
        neighbours += engine.surfaces.check_landmarks();
    }
    assert!(removed > 10 && neighbours > 100, "{removed} removed, {neighbours} neighbours");
}

#[test]
fn floor_and_neighbours_are_those_of_all_clusters_while_things_come_and_go() {
    drive_and_check("moving", Params::default(), (0..720).step_by(18));
}

#[test]
fn floor_and_neighbours_are_those_of_all_clusters_where_what_is_far_is_forgotten() {
    let params = Params::default().with_keep_radius(3.0).unwrap();
    drive_and_check("lab", params, (0..1600).step_by(40));
}
