//! Parameters that change while the node runs.

use super::*;
use crate::sim::drive::Drive;
use crate::sim::scene::Scene;

fn config(name: &str, value: f64) -> Config {
    Config::new([(name.to_owned(), Value::Double(value))]).unwrap()
}

#[test]
fn a_shorter_tf_timeout_holds_for_clouds_that_wait_already() {
    let events = vec![cloud(at(10.0), "nowhere"), Event::Changed(Box::new(config("tf_timeout", 0.0)))];
    let given_up = |counts: &RefCell<Counts>| counts.borrow().skipped.contains_key(&TRANSFORM_TIMEOUT);
    let (ended, counts, _) =
        node_until(&config("tf_timeout", 60.0), Fake::default(), events, move |_, counts| async move {
            until("a cloud that is given up", || given_up(&counts)).await;
        });
    ended.unwrap();
    assert_eq!(by_key(counts), [("transform_timeout", 1)]);
}

#[test]
fn a_shorter_snapshot_period_holds_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map");
    let saving = |period: f64| {
        let path = Value::Text(path.display().to_string());
        let given = [("snapshot_path", path), ("snapshot_period", Value::Double(period))];
        Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap()
    };
    let changed = Event::Changed(Box::new(saving(0.1)));
    let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera"), changed];
    let saved = path.clone();
    let (ended, _, _) = node_until(&saving(3600.0), Fake::default(), events, |_, _| async move {
        until("a map in its file", || saved.exists()).await;
    });
    ended.unwrap();
}

/// Transforms at 2 Hz, beside a Kinect.
#[test]
fn of_a_longer_tf_timeout_all_scans_that_one_transform_releases_are_taken_in() {
    let clouds = (0..15).map(|number| cloud(at(10.0 + f64::from(number) / 30.0), "camera"));
    let mut events = vec![Event::Changed(Box::new(config("tf_timeout", 1.0)))];
    events.extend(clouds.chain([transform(at(9.9), false), transform(at(10.6), false)]));
    let (_, counts, _) = node(Fake::default(), events, 15);
    assert_eq!((counts.taken_in, counts.replaced, counts.skipped.len()), (15, 0, 0));
}

#[test]
fn what_the_engine_goes_on_by_reaches_it_before_the_next_scan() {
    let bounded = Config::new([("max_voxels".to_owned(), Value::Integer(1))]).unwrap();
    let wide = |seconds| match cloud(at(seconds), "camera") {
        Event::Cloud(input, Ok(cloud)) => {
            let point = |i: u16| [f32::from(i / 20), 0.01, 1.01];
            Event::Cloud(input, Ok(Cloud { points: Points::F32((0..80).map(point).collect()), ..cloud }))
        }
        other => other,
    };
    let before = vec![transform(at(0.0), true), wide(10.0)];
    let after = vec![transform(at(0.0), true), Event::Changed(Box::new(bounded)), wide(10.0)];
    for (events, voxels) in [(before, 4), (after, 1)] {
        let (_, counts, transport) = node(Fake::default(), events, 1);
        assert_eq!(counts.taken_in, 1);
        assert_eq!(transport.deltas.borrow()[0].unclustered_voxels, voxels);
    }
}

#[test]
fn a_cloud_that_is_handed_over_is_decoded_by_the_parameters_of_that_moment() {
    let drive = Drive::new(Scene::room(), 1, at(10.0));
    let handed = |index| {
        let mut cloud = drive.step(index).cloud;
        cloud.header.frame_id = "camera".to_owned();
        Event::Handed(Form::Points.of(0), Box::new(cloud))
    };
    let fewer = Config::new([("max_points".to_owned(), Value::Integer(1))]).unwrap();
    let events = vec![transform(at(0.0), true), handed(0), Event::Changed(Box::new(fewer)), handed(1)];
    let (_, counts, _) = node(Fake::default(), events, 1);
    assert_eq!((counts.taken_in, counts.skipped.into_values().sum::<u64>()), (1, 1));
}
