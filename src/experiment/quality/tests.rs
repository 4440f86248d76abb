//! Hand-made maps: two surfaces that meet, clusterings of them that are wrong in one way each.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::found::{Found, FoundCluster, FoundPlane};
use super::measure::Measure;
use super::pieces::Truth;
use super::plane::Plane;
use super::pooled::{Line, Pooled};
use super::score::Quality;
use super::truth::{SeenPart, TruthMap};
use crate::engine::{Params, Points, Scan, Stamp, SurfaceClass};
use crate::sim::{Route, Scene, Shape, Surface};

mod truth;

const WALL: u32 = 1;

/// 3 x 2 m in front of the sensor, and 1.28 x 2 m to its right; they meet at x = 3.06, z = 3.06.
fn corner() -> Vec<Surface> {
    let wall = Isometry3::new(Vector3::new(1.56, 1.0, 3.06), Vector3::x() * std::f64::consts::PI);
    let side = Isometry3::new(Vector3::new(3.06, 1.0, 2.42), Vector3::y() * -std::f64::consts::FRAC_PI_2);
    vec![
        rectangle("wall", SurfaceClass::Wall, wall, [3.0, 2.0]),
        rectangle("side", SurfaceClass::Door, side, [1.28, 2.0]),
    ]
}

fn rectangle(name: &str, class: SurfaceClass, pose: Isometry3<f64>, size: [f64; 2]) -> Surface {
    Surface::new(name, class, pose, Shape::Rectangle { size, holes: Vec::new() })
}

fn scene(surfaces: Vec<Surface>) -> Scene {
    Scene::new(surfaces, Route::default())
}

/// Points of a surface on a grid of this spacing.
fn grid_on(surface: &Surface, spacing: f64) -> Vec<Point3<f64>> {
    let shape = surface.shape();
    let ranges = shape.half_ranges().map(|half| 2.0 * half);
    let [nx, ny] = ranges.map(|side| (side / spacing).round() as u32);
    let [x0, y0] = ranges.map(|side| -0.5 * side + 0.5 * spacing);
    let local = (0..nx).flat_map(|i| (0..ny).map(move |j| [f64::from(i), f64::from(j)]));
    local.map(|[i, j]| surface.pose() * shape.point([x0 + i * spacing, y0 + j * spacing])).collect()
}

fn scan(points: &[Point3<f64>]) -> Scan {
    Scan {
        stamp: Stamp::from_nanos(1),
        fixed_from_sensor: Isometry3::identity(),
        points: Points::F64(points.iter().map(|point| [point.x, point.y, point.z]).collect()),
    }
}

/// The truth of a scene where every surface was measured without noise.
fn truth_of(surfaces: Vec<Surface>) -> Truth {
    let scene = scene(surfaces);
    let mut map = TruthMap::new(&scene, &Params::default());
    for surface in scene.surfaces() {
        let points = grid_on(surface, 0.01);
        map.insert(&scan(&points), &vec![surface.label(); points.len()]);
    }
    map.truth(|label| seen(scene.surface(label).unwrap(), |_| true))
}

/// The cells of a surface for which this holds.
fn seen(surface: &Surface, holds: impl Fn(&Point3<f64>) -> bool) -> SeenPart {
    let cells: Vec<_> = grid_on(surface, 0.02).into_iter().filter(holds).collect();
    SeenPart { area: cells.len() as f64 * 4e-4, cells }
}

/// What a perfect method finds: cluster i + 1 is surface i.
fn perfect(truth: &Truth) -> Found {
    let voxels = truth.scored.iter().map(|(key, surface)| (*key, Some(*surface as u64 + 1))).collect();
    let clusters = truth.surfaces.iter().map(|surface| {
        let plane = surface.plane.unwrap_or(Plane { normal: Vector3::x(), offset: 0.0 });
        FoundCluster {
            plane,
            area: Some(surface.area_on(&plane)),
            class: surface.areas.keys().next().copied(),
            confidence: Some(1.0),
            certainty: surface.plane.map(|plane| certainty(&plane, &surface.middle.unwrap())),
        }
    });
    Found { voxels, clusters: (1..).zip(clusters).collect() }
}

/// Turns of 2 mrad, an offset of 4 mm.
fn certainty(plane: &Plane, place: &Point3<f64>) -> FoundPlane {
    let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &plane.normal);
    let turn = turn.unwrap_or_else(|| {
        nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    });
    let pose = Isometry3::from_parts(place.coords.into(), turn);
    FoundPlane { pose, covariance: Matrix3::from_diagonal(&Vector3::new(4e-6, 4e-6, 1.6e-5)) }
}

fn line(quality: &Quality, measure: Measure) -> Line {
    let mut pooled = Pooled::default();
    pooled.add("run", quality);
    pooled.line(measure).unwrap()
}

/// The measures whose bars do not hold, but for NEES, which asks for 200 cases.
fn failing(quality: &Quality) -> Vec<Measure> {
    let mut pooled = Pooled::default();
    pooled.add("run", quality);
    let measures = Measure::ALL.into_iter().filter(|measure| *measure != Measure::Nees);
    measures.filter(|measure| pooled.line(*measure).is_some_and(|line| !line.holds)).collect()
}

#[test]
fn a_perfect_clustering_scores_perfectly() {
    let truth = truth_of(corner());
    let quality = truth.score(&perfect(&truth));
    assert_eq!(failing(&quality), []);
    assert_eq!(quality.failures, [""; 0]);
    assert_eq!(quality.rand_index, Some(1.0));
    for (measure, worst) in [
        (Measure::Coverage, 1.0),
        (Measure::Wholeness, 1.0),
        (Measure::Impurity, 0.0),
        (Measure::ImpurityOfLarge, 0.0),
        (Measure::Angle, 0.0),
        (Measure::Offset, 0.0),
        (Measure::AreaOfLarge, 0.0),
        (Measure::Class, 1.0),
        (Measure::Nees, 0.0),
        (Measure::OffsetSigma, 0.004),
    ] {
        assert!((line(&quality, measure).worst - worst).abs() < 1e-6, "{measure:?}");
    }
}

#[test]
fn a_surface_cut_in_two_is_not_whole_and_both_halves_are_pure() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    for (key, cluster) in &mut found.voxels {
        if *cluster == Some(1) && key.indices()[0] >= 25 {
            *cluster = Some(7);
        }
    }
    found.clusters.insert(7, found.clusters[&1].clone());
    let quality = truth.score(&found);
    assert_eq!(failing(&quality), [Measure::Wholeness, Measure::RandIndex]);
    let wholeness = line(&quality, Measure::Wholeness);
    assert_eq!((wholeness.held, wholeness.of), (1, 2));
    assert!((wholeness.worst - 0.65).abs() < 0.05, "{wholeness:?}");
    assert!(quality.failures[0].starts_with("wall (6.0 m2, "), "{:?}", quality.failures);
    assert!(quality.failures[0].contains("cluster 7 holds"), "{:?}", quality.failures);
}

/// The half that has the right class is right, and not the whole for its sake.
#[test]
fn each_cluster_of_a_surface_has_its_share_of_the_area_whose_class_is_right() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    let of_wall = found.voxels.iter_mut().filter(|(_, cluster)| *cluster == Some(1));
    of_wall.step_by(2).for_each(|(_, cluster)| *cluster = Some(7));
    found.clusters.insert(7, FoundCluster { class: Some(SurfaceClass::Floor), ..found.clusters[&1].clone() });
    let quality = truth.score(&found);
    assert!((quality.surfaces[0].class_right - 3.0).abs() < 0.01, "{:?}", quality.surfaces[0]);
    assert!((line(&quality, Measure::Class).worst - 5.56 / 8.56).abs() < 1e-3);
}

#[test]
fn two_surfaces_merged_are_each_whole_in_a_cluster_that_is_mixed() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    found.voxels.iter_mut().for_each(|(_, cluster)| *cluster = Some(1));
    found.clusters.remove(&2);
    let quality = truth.score(&found);
    assert_eq!(line(&quality, Measure::Wholeness).worst, 1.0);
    let impurity = line(&quality, Measure::Impurity);
    assert!((impurity.worst - 1.28 / 4.28).abs() < 0.02 && impurity.of == 1, "{impurity:?}");
    let index = quality.rand_index.unwrap();
    assert!(index.abs() < 1e-9, "{index}");
    // The plane, area and class of the side are those of the wall.
    let side = quality.surfaces[1].described.unwrap();
    assert!((side.angle.unwrap() - 90.0).abs() < 1e-6);
    assert!((side.offset.unwrap() - 0.64).abs() < 0.01, "{side:?}");
    assert!((side.area_error.unwrap() - (6.0 / 2.56 - 1.0)).abs() < 1e-6);
    assert_eq!(quality.surfaces[1].class_right, 0.0);
    assert!((line(&quality, Measure::Class).worst - 6.0 / 8.56).abs() < 1e-6);
    assert!(
        quality
            .failures
            .iter()
            .any(|failure| failure.starts_with("cluster 1 (") && failure.contains(" of side"))
    );
}

#[test]
fn scored_voxels_in_no_cluster_lower_coverage_and_are_clusters_of_their_own() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    let count = found.voxels.len();
    // Half of them said to be in no cluster, the others left out.
    let mut lost = 0;
    found.voxels.retain_mut(|(key, cluster)| {
        let hit = key.indices()[1] % 4 == 0;
        lost += usize::from(hit);
        if hit {
            *cluster = None;
        }
        !hit || lost % 2 == 0
    });
    let quality = truth.score(&found);
    let coverage = line(&quality, Measure::Coverage).worst;
    assert!((coverage - (1.0 - lost as f64 / count as f64)).abs() < 1e-12 && coverage < 0.8);
    assert_eq!(line(&quality, Measure::Impurity).worst, 0.0);
    let index = quality.rand_index.unwrap();
    assert!(index < 0.9, "{index}");
    let expected = [Measure::Coverage, Measure::Wholeness, Measure::RandIndex, Measure::Class];
    assert_eq!(failing(&quality), expected);
}

#[test]
fn where_nothing_is_scored_no_measure_has_a_value() {
    let quality = Truth::default().score(&Found::default());
    assert_eq!(quality.rand_index, None);
    for measure in Measure::ALL {
        assert!(measure.values(&quality).is_empty(), "{measure:?}");
    }
}

#[test]
fn nothing_found_fails_every_measure_that_has_a_value() {
    let truth = truth_of(corner());
    let quality = truth.score(&Found::default());
    let expected =
        [Measure::Coverage, Measure::Wholeness, Measure::RandIndex, Measure::Angle, Measure::Offset];
    assert_eq!(failing(&quality), expected);
    assert_eq!(line(&quality, Measure::Angle).worst, f64::INFINITY);
    assert_eq!(Measure::Angle.show(f64::INFINITY), "none");
}

#[test]
fn a_tilted_and_shifted_plane_is_off_by_its_angle_and_by_its_distance_in_the_middle() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    let (middle, plane) = (truth.surfaces[0].middle.unwrap(), truth.surfaces[0].plane.unwrap());
    let turn = nalgebra::Rotation3::new(Vector3::y() * 0.75_f64.to_radians());
    let shifted = middle + plane.normal * 0.012;
    found.clusters.get_mut(&1).unwrap().plane = Plane::through(&shifted, &(turn * plane.normal));
    let quality = truth.score(&found);
    assert!((line(&quality, Measure::Angle).worst - 0.75).abs() < 1e-6);
    assert!((line(&quality, Measure::Offset).worst - 0.012).abs() < 1e-5);
    assert_eq!(failing(&quality), [Measure::Angle, Measure::Offset]);
    let failure = &quality.failures[0];
    assert!(failure.contains("plane turned by 0.75 deg; plane off by 12.0 mm"), "{failure}");
}

#[test]
fn a_plane_that_faces_away_is_turned_by_half_a_circle() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    let plane = &mut found.clusters.get_mut(&1).unwrap().plane;
    *plane = Plane { normal: -plane.normal, offset: -plane.offset };
    let angle = line(&truth.score(&found), Measure::Angle).worst;
    assert!((angle - 180.0).abs() < 1e-6);
}

#[test]
fn areas_are_held_to_ten_percent_from_2_m2_on_and_to_twenty_five_below() {
    let mut world = corner();
    world.push(rectangle(
        "shelf",
        SurfaceClass::Horizontal,
        Isometry3::translation(1.0, -2.0, 2.0),
        [1.0, 1.0],
    ));
    let truth = truth_of(world);
    let mut found = perfect(&truth);
    for (index, surface) in truth.surfaces.iter().enumerate() {
        let cluster = found.clusters.get_mut(&(index as u64 + 1)).unwrap();
        cluster.area = Some(surface.seen_area * if surface.name == "side" { 0.88 } else { 1.2 });
    }
    let quality = truth.score(&found);
    let (large, small) = (line(&quality, Measure::AreaOfLarge), line(&quality, Measure::AreaOfSmall));
    assert!((large.held, large.of) == (0, 2) && (large.worst - 0.2).abs() < 1e-9, "{large:?}");
    assert!((small.held, small.of) == (1, 1) && (small.worst - 0.2).abs() < 1e-9, "{small:?}");
}

#[test]
fn a_method_that_computes_no_areas_is_not_held_to_them() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    for cluster in found.clusters.values_mut() {
        (cluster.area, cluster.class, cluster.certainty) = (None, None, None);
    }
    let mut pooled = Pooled::default();
    pooled.add("run", &truth.score(&found));
    for measure in [Measure::AreaOfLarge, Measure::Class, Measure::Nees, Measure::OffsetSigma] {
        assert_eq!(pooled.line(measure), None);
    }
    // One that computes them elsewhere is.
    found.clusters.get_mut(&1).unwrap().area = Some(6.0);
    let area = line(&truth.score(&found), Measure::AreaOfLarge);
    assert_eq!((area.held, area.of, area.worst), (1, 2, f64::INFINITY));
}

#[test]
fn a_plane_whose_certainty_is_not_stated_is_no_calibrated_one() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    found.clusters.get_mut(&1).unwrap().certainty = None;
    let quality = truth.score(&found);
    for measure in [Measure::Nees, Measure::OffsetSigma] {
        let line = line(&quality, measure);
        assert_eq!((line.of, line.worst), (2, f64::INFINITY), "{measure:?}");
    }
}

#[test]
fn nees_of_errors_drawn_from_the_stated_covariance_is_three_on_average() {
    let truth = truth_of(corner());
    let perfect = perfect(&truth);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let mut pooled = Pooled::default();
    let root = Matrix3::new(2e-3, 0.0, 0.0, 1e-3, 3e-3, 0.0, -1e-3, 2e-3, 4e-3);
    for _ in 0..2000 {
        let mut found = perfect.clone();
        for cluster in found.clusters.values_mut() {
            let stated = cluster.certainty.as_mut().unwrap();
            stated.covariance = root * root.transpose();
            cluster.plane = drawn(&stated.pose, &(root * normal3(&mut rng)));
        }
        pooled.add("run", &truth.score(&found));
    }
    let nees = pooled.line(Measure::Nees).unwrap();
    assert!(nees.of == 4000 && nees.holds && (nees.mean - 3.0).abs() < 0.15, "{nees:?}");
    let sigma = pooled.line(Measure::OffsetSigma).unwrap();
    assert!((sigma.median - 0.021_f64.sqrt() * 10_f64.powf(-1.5)).abs() < 1e-6, "{sigma:?}");
}

fn normal3(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

/// The plane of a pose, turned about its x and y and moved along its z.
fn drawn(pose: &Isometry3<f64>, error: &Vector3<f64>) -> Plane {
    let turn = nalgebra::Rotation3::new(Vector3::new(error.x, error.y, 0.0));
    let place = pose * Point3::new(0.0, 0.0, error.z);
    Plane::through(&place, &(pose * (turn * Vector3::z())))
}

#[test]
fn nees_asks_for_two_hundred_cases_and_for_a_covariance() {
    let truth = truth_of(corner());
    let mut found = perfect(&truth);
    assert!(!line(&truth.score(&found), Measure::Nees).holds);
    found.clusters.get_mut(&1).unwrap().certainty.as_mut().unwrap().covariance = Matrix3::zeros();
    assert_eq!(line(&truth.score(&found), Measure::Nees).worst, f64::INFINITY);
}

/// The score where the plane of the first surface is turned by `degrees`.
fn turned(truth: &Truth, degrees: f64) -> Quality {
    let mut found = perfect(truth);
    let cluster = found.clusters.get_mut(&1).unwrap();
    let stated = cluster.certainty.as_mut().unwrap();
    stated.pose *= Isometry3::rotation(Vector3::x() * degrees.to_radians());
    cluster.plane = Plane::through(&stated.pose.translation.vector.into(), &(stated.pose * Vector3::z()));
    truth.score(&found)
}

/// As where the cluster that holds most of a wall is described by the floor before it.
#[test]
fn a_plane_of_another_surface_fails_by_its_angle_and_has_no_nees() {
    let mut truth = truth_of(corner());
    for degrees in [45.1, 89.9, 90.0, 180.0] {
        let quality = turned(&truth, degrees);
        assert!((line(&quality, Measure::Angle).worst - degrees).abs() < 1e-4, "{degrees}");
        let nees = line(&quality, Measure::Nees);
        assert!(nees.of == 1 && nees.worst < 1.0, "{degrees}: {nees:?}");
    }
    assert_eq!(line(&turned(&truth, 10.0), Measure::Nees).of, 2);
    for seen_area in [truth.surfaces[0].seen_area, 1.5] {
        truth.surfaces[0].seen_area = seen_area;
        let failures = turned(&truth, 90.0).failures.join("\n");
        assert!(failures.contains("plane turned by 90.00 deg") && !failures.contains("NEES"), "{failures}");
    }
}

#[test]
fn runs_pool_their_values() {
    let truth = truth_of(corner());
    let (good, bad) = (truth.score(&perfect(&truth)), truth.score(&Found::default()));
    let mut pool = Pooled::default();
    pool.add("seed 1", &good);
    pool.add("seed 2", &bad);
    let coverage = pool.line(Measure::Coverage).unwrap();
    assert_eq!((pool.runs, pool.seen, coverage.held, coverage.of), (2, 4, 1, 2));
    assert_eq!((coverage.worst, coverage.median, coverage.holds), (0.0, 0.5, false));
    assert!(pool.failures.iter().all(|failure| failure.starts_with("seed 2: ")));
}
