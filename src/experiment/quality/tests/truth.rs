//! The true surfaces of hand-made maps, and which of their voxels are scored.

use proptest::prelude::*;

use super::super::pieces::TrueSurface;
use super::*;
use crate::engine::VoxelKey;
use crate::sim::{Drive, PoseNoise};

#[test]
fn the_true_surfaces_are_the_rectangles_with_their_seen_areas_and_planes() {
    let world = corner();
    let truth = truth_of(world.clone());
    let of: Vec<_> = truth.surfaces.iter().map(|s| (s.name.as_str(), s.is_seen(), s.is_one_plane)).collect();
    assert_eq!(of, [("wall", true, true), ("side", true, true)]);
    for ((surface, rectangle), area) in truth.surfaces.iter().zip(&world).zip([6.0, 2.56]) {
        let plane = surface.plane.unwrap();
        assert!((surface.seen_area - area).abs() < 1e-9);
        assert_eq!(surface.areas.keys().collect::<Vec<_>>(), [&rectangle.class()]);
        assert!((plane.normal - rectangle.normal().into_inner()).norm() < 1e-12);
        assert!(plane.height(&rectangle.pose().translation.vector.into()).abs() < 1e-12);
        assert!((surface.middle.unwrap().coords - rectangle.pose().translation.vector).norm() < 1e-9);
        // About a voxel of 8 cm for each 64 cm^2, less the edge where two surfaces share voxels.
        let expected = surface.seen_area / 0.0064;
        assert!((f64::from(surface.scored) / expected - 1.0).abs() < 0.1, "{} of {expected}", surface.scored);
        assert!(surface.scored <= surface.voxels);
    }
}

#[test]
fn one_surface_in_two_pieces_is_two_surfaces_and_a_scrap_is_not_asked_for() {
    // 3 x 2 m whose points between x = 1 and 1.5 were never measured, and a far corner of it seen by itself.
    let scene = scene(vec![corner().remove(0)]);
    let wall = &scene.surfaces()[0];
    let measured = |point: &Point3<f64>| {
        !(1.0..1.5).contains(&point.x) && (point.x < 2.5 || point.y < 1.5 || (point.x > 2.7 && point.y > 1.7))
    };
    let points: Vec<_> = grid_on(wall, 0.01).into_iter().filter(measured).collect();
    let mut map = TruthMap::new(&scene, &Params::default());
    map.insert(&scan(&points), &vec![WALL; points.len()]);
    let truth = map.truth(|_| seen(wall, measured));
    let names: Vec<_> = truth.surfaces.iter().map(|surface| surface.name.as_str()).collect();
    assert_eq!(names, ["wall #2", "wall #1", "wall (scrap)"]);
    let quality = truth.score(&perfect(&truth));
    assert_eq!(quality.surfaces.len(), 2);
    assert_eq!(quality.rand_index, Some(1.0));
    assert_eq!(quality.clusters.len(), 3);
    assert!(!quality.clusters[2].of_seen && quality.clusters[2].is_large());
}

/// Its edge, of which nothing was measured, is none of it, and what noise has moved off the plane is.
#[test]
fn a_seen_cell_counts_where_voxels_are_dense_at_it_or_before_or_behind_it() {
    let scene = scene(vec![corner().remove(0)]);
    let wall = &scene.surfaces()[0];
    let measured = |point: &Point3<f64>| point.x < 1.6;
    let points = grid_on(wall, 0.01).into_iter().filter(measured);
    let points: Vec<_> = points.map(|point| point - 0.1 * wall.normal().into_inner()).collect();
    let mut map = TruthMap::new(&scene, &Params::default());
    map.insert(&scan(&points), &vec![WALL; points.len()]);
    let truth = map.truth(|_| seen(wall, |_| true));
    let [surface] = &truth.surfaces[..] else { panic!("{:?}", truth.surfaces) };
    // From x = 0.06 to 1.6, which is the border of a voxel.
    assert!((surface.seen_area - 1.54 * 2.0).abs() < 1e-9, "{surface:?}");
}

#[test]
fn what_moves_is_not_asked_for() {
    let scene = Scene::named("moving").unwrap();
    let moving = scene.surfaces().iter().find(|surface| surface.motion().is_some()).unwrap();
    let stays = scene.surfaces().iter().find(|surface| surface.name() == "floor").unwrap();
    let mut map = TruthMap::new(&scene, &Params::default());
    for surface in [moving, stays] {
        let points = grid_on(surface, 0.01);
        // The sensor looks along z and sees nothing nearer than 0.4 m.
        let away = nalgebra::Translation3::new(0.0, 0.0, 2.0);
        let scan = Scan {
            fixed_from_sensor: away.inverse().into(),
            ..scan(&points.iter().map(|p| away * p).collect::<Vec<_>>())
        };
        map.insert(&scan, &vec![surface.label(); points.len()]);
    }
    let truth = map.truth(|label| seen(scene.surface(label).unwrap(), |_| true));
    let asked: Vec<_> =
        truth.surfaces.iter().filter(|surface| surface.is_seen()).map(|s| s.name.as_str()).collect();
    assert_eq!(asked, ["floor"]);
}

#[test]
fn rectangles_that_touch_in_one_plane_are_one_surface_with_the_areas_of_both_classes() {
    let wall = corner().remove(0);
    let beside = nalgebra::Translation3::new(2.0, 0.0, 0.03) * wall.pose();
    let door = rectangle("door", SurfaceClass::Door, beside, [1.0, 2.0]);
    let truth = truth_of(vec![wall, door]);
    let [surface] = &truth.surfaces[..] else { panic!("{:?}", truth.surfaces) };
    assert_eq!((surface.name.as_str(), surface.is_one_plane), ("wall", false));
    assert!((surface.areas[&SurfaceClass::Wall] - 6.0).abs() < 1e-9);
    assert!((surface.areas[&SurfaceClass::Door] - 2.0).abs() < 1e-9);
    let found = perfect(&truth);
    let quality = truth.score(&found);
    assert!((line(&quality, Measure::Class).worst - 0.75).abs() < 1e-9);
    assert!(quality.surfaces[0].described.unwrap().nees.is_none());
}

#[test]
fn voxels_are_scored_by_majority_and_by_the_distance_of_their_points() {
    let wall = corner().remove(0);
    let size = Params::default().voxel_size();
    let middle = |i: f64| Vector3::new((i + 0.5) * size, 1.0, 3.06);
    // Voxel 10: 79 % on the wall; 20: 80 %; 30: too far in front; 40 (of 14 points): not dense.
    let at = |i: f64, count: usize, on_wall: usize, off: f64| {
        let points = vec![Point3::from(middle(i) - Vector3::z() * off); count];
        let labels = (0..count).map(|n| u32::from(n < on_wall));
        (points, labels.collect::<Vec<_>>())
    };
    let sigma = 0.0012 + 0.0019 * (3.06_f64 - 0.4).powi(2);
    let cases = [at(10.0, 100, 79, 0.0), at(20.0, 100, 80, 0.0), at(25.0, 50, 50, 1.9 * sigma)];
    let more = [at(30.0, 50, 50, 2.2 * sigma), at(35.0, 14, 14, 0.0)];
    let mut map = TruthMap::new(&scene(vec![wall]), &Params::default());
    for (points, labels) in cases.into_iter().chain(more) {
        map.insert(&scan(&points), &labels);
    }
    let truth = map.truth(|_| SeenPart::default());
    let scored: Vec<_> = truth.scored.iter().map(|(key, _)| key.indices()[0]).collect();
    assert_eq!(scored, [20, 25]);
    assert_eq!(truth.surfaces.len(), 4);
}

/// A wall whose points a wrong pose has put five voxels before it.
#[test]
fn what_a_wrong_pose_has_moved_is_scored_and_its_cells_are_seen() {
    let scene = scene(vec![corner().remove(0)]);
    let wall = &scene.surfaces()[0];
    let points: Vec<_> = grid_on(wall, 0.01).into_iter().map(|point| point - 0.4 * Vector3::z()).collect();
    let drive = Drive::new(scene.clone(), 1, Stamp::from_nanos(0));
    let spread = |metres, radians| drive.clone().with_pose_noise(PoseNoise { metres, radians }).pose_spread();
    let seen_of = |spread| {
        let mut map = TruthMap::new(&scene, &Params::default()).with_pose_spread(spread);
        map.insert(&scan(&points), &vec![WALL; points.len()]);
        let truth = map.truth(|_| seen(wall, |_| true));
        let [surface] = &truth.surfaces[..] else { panic!("{:?}", truth.surfaces) };
        assert_eq!(surface.scored as usize, truth.scored.len());
        (f64::from(surface.scored) / f64::from(surface.voxels), surface.seen_area)
    };
    assert_eq!(seen_of(None), (0.0, 0.0));
    assert_eq!(seen_of(spread(0.05, 0.0)), (0.0, 0.0), "2 sigma are 10 cm");
    let (scored, area) = seen_of(spread(0.25, 0.0));
    assert!(scored == 1.0 && (area - 6.0).abs() < 1e-9, "2 sigma are 50 cm: {scored}, {area} m2");
    // 2.4 m or more from the robot 2 sigma are 48 cm or more.
    let (scored, area) = seen_of(spread(0.0, 0.1));
    assert!(scored == 1.0 && (area - 6.0).abs() < 1e-9, "{scored}, {area} m2");
}

#[test]
fn depths_out_of_range_and_points_beyond_the_grid_count_nowhere() {
    let mut map = TruthMap::new(&scene(corner()), &Params::default());
    let near = vec![Point3::new(0.0, 0.0, 0.399); 20];
    let far = vec![Point3::new(0.0, 0.0, 6.001); 20];
    let beyond = vec![Point3::new(1e9, 0.0, 3.0); 20];
    for points in [near, far, beyond] {
        map.insert(&scan(&points), &[WALL; 20]);
    }
    assert_eq!(map.truth(|_| SeenPart::default()), Truth::default());
    map.insert(&scan(&[Point3::new(0.0, 0.0, 0.4); 20]), &[WALL; 20]);
    assert_eq!(map.truth(|_| SeenPart::default()).surfaces.len(), 1);
}

#[test]
fn a_bent_surface_is_held_to_no_plane() {
    let upright = Isometry3::new(Vector3::new(0.5, 0.3, 2.5), Vector3::x() * std::f64::consts::FRAC_PI_2);
    let shape = Shape::Cylinder { radius: 0.3, height: 2.0 };
    let truth = truth_of(vec![Surface::new("pillar", SurfaceClass::Curved, upright, shape)]);
    let quality = truth.score(&perfect(&truth));
    let mut pooled = Pooled::default();
    pooled.add("run", &quality);
    for measure in [Measure::Angle, Measure::Offset, Measure::Nees] {
        assert_eq!(pooled.line(measure), None);
    }
    // All round: a boundary in a plane along the axis can hold its breadth, one across it the end of it.
    for (normal, area) in [(Vector3::x(), 0.6 * 2.0), (Vector3::z(), 0.6 * 2.0), (Vector3::y(), 0.0)] {
        let bends = truth.surfaces.iter().flat_map(|piece| piece.bends.clone()).collect();
        let whole = TrueSurface { bends, ..truth.surfaces[0].clone() };
        let found = whole.area_on(&Plane { normal, offset: 0.0 });
        assert!((found - area).abs() < 0.05, "{found} of {area} m2");
    }
    // Voxels that the side only cuts through the corners of are not dense, so it may be in pieces.
    let area: f64 = truth.surfaces.iter().map(|surface| surface.seen_area).sum();
    assert!((area - 3.77).abs() < 0.02, "{area}");
}

proptest! {
    #[test]
    fn the_dense_voxels_are_those_of_the_engine(
        points in proptest::collection::vec((-0.3..0.3, -0.3..0.3, 0.5..0.9), 0..400),
        turn in -3.0..3.0,
    ) {
        let points = points.iter().map(|&(x, y, z)| [x as f32, y as f32, z as f32]).collect();
        let fixed_from_sensor = Isometry3::new(Vector3::new(-0.2, 0.1, 3.0), Vector3::new(1.0, turn, 0.3));
        let scan = Scan { stamp: Stamp::from_nanos(1), fixed_from_sensor, points: Points::F32(points) };
        let params = Params::default().with_min_points(2).unwrap();
        let mut map = TruthMap::new(&scene(corner()), &params);
        let mut engine = crate::engine::paper::Cfodi::new(params);
        map.insert(&scan, &vec![1; scan.points.len()]);
        engine.insert(&scan);
        let dense: Vec<(VoxelKey, u32)> = map.dense().iter().map(|voxel| (voxel.key, voxel.count())).collect();
        let expected: Vec<_> = engine.snapshot().voxels.iter().map(|voxel| (voxel.key, voxel.count)).collect();
        prop_assert_eq!(dense, expected);
        for (voxel, of_engine) in map.dense().iter().zip(engine.snapshot().voxels) {
            prop_assert!((voxel.mean() - of_engine.centre).norm() < 1e-8);
        }
    }
}
