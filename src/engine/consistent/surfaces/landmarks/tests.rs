//! What landmarks find is what a scan of all clusters finds.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use proptest::prelude::*;

use super::*;
use crate::engine::ClusterId;
use crate::engine::consistent::class::evidence::{Uprights, edges, middle};
use crate::engine::consistent::surfaces::Surfaces;

/// The clusters that are told of, by component.
type Told<'a> = BTreeMap<ComponentId, &'a Cluster>;

/// The floor of the storey of a cluster, from the heights of all clusters that can be one.
fn plain_floor(cluster: &Cluster, told: &Told, apart: f64) -> Option<f64> {
    let ten_degrees = 10.0_f64.to_radians();
    let is_level = |cluster: &&&Cluster| {
        cluster.normal.z >= ten_degrees.cos() && cluster.area.is_some_and(|area| area >= FLOOR_AREA)
    };
    let levels: Vec<_> =
        told.values().filter(is_level).map(|level| (middle(level), level.area.unwrap())).collect();
    let is_floor = |&&(height, area): &&(f64, f64)| {
        let reach = if area < PIT { STOREY } else { GHOST };
        let is_above = |other: f64| (height..=height + reach).contains(&other);
        !levels.iter().any(|&(other, larger)| is_above(other) && larger > GHOST_SHARE * area)
    };
    let mut heights: Vec<_> = levels.iter().filter(is_floor).map(|(height, _)| *height).collect();
    heights.sort_by(f64::total_cmp);
    let mut floors: Vec<f64> = Vec::new();
    for height in heights {
        if floors.last().is_none_or(|floor| height >= floor + STOREY) {
            floors.push(height);
        }
    }
    floors.into_iter().rfind(|floor| *floor <= middle(cluster) + SUNK.max(apart))
}

/// What a cluster stands beside, looked for among all others.
fn plain_uprights(cluster: &Cluster, told: &Told) -> Uprights {
    Uprights::of(cluster, edges(cluster).as_ref(), told.values().copied())
}

impl Surfaces {
    /// Asserts that floor and neighbours are found as by a scan of all clusters; returns how many neighbours there are.
    pub(in crate::engine::consistent) fn check_landmarks(&self) -> usize {
        let clusters = self.clusters.each();
        let told: Told =
            clusters.filter_map(|(id, cluster)| Some((id, cluster.as_ref()?.told.as_deref()?))).collect();
        let mut anew = Landmarks { cell: self.landmarks.cell, ..Landmarks::new(1.0) };
        told.iter().for_each(|(&component, cluster)| anew.set(component, Some(cluster)));
        assert_eq!(self.landmarks, anew);
        let neighbours = told.values().map(|cluster| {
            assert_eq!(self.landmarks.floor_below(middle(cluster), 0.0), plain_floor(cluster, &told, 0.0));
            let found = self.uprights(cluster);
            assert_eq!(found, plain_uprights(cluster, &told), "beside {:?}", cluster.id);
            found.neighbours.len()
        });
        neighbours.sum()
    }
}

/// A rectangle somewhere.
fn rectangle(place: [f64; 3], [yaw, pitch, roll]: [f64; 3], sides: [f64; 2]) -> Cluster {
    let pose = Isometry3::from_parts(
        Translation3::from(Vector3::from(place)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    );
    Cluster::rectangle(1, pose, sides)
}

/// Upright, level and sloped rectangles, from a leaf of a door to a long wall.
fn any_cluster() -> impl Strategy<Value = Cluster> {
    let place = [-6.0..6.0, -6.0..6.0, -0.5..6.5];
    let half_pi = std::f64::consts::FRAC_PI_2;
    let roll = prop_oneof![
        4 => Just(half_pi),
        4 => half_pi - 0.4..half_pi + 0.4,
        2 => Just(0.0),
        1 => -3.0..3.0,
    ];
    let yaw = prop_oneof![Just(0.0), Just(half_pi), -3.2..3.2];
    let sides = (prop_oneof![0.3..1.5, 1.0..25.0], 0.1..3.0);
    (place, yaw, prop_oneof![Just(0.0), -0.4..0.4], roll, sides).prop_map(
        |(place, yaw, pitch, roll, (long, short))| rectangle(place, [yaw, pitch, roll], [long, short]),
    )
}

proptest! {
    #[test]
    fn what_is_told_last_is_found_as_by_a_scan_of_all(
        steps in prop::collection::vec((0_u32..20, prop::option::weighted(0.8, any_cluster())), 1..80),
        voxel_size in prop_oneof![Just(0.08), 0.25..2.0, Just(f64::MAX)],
        apart in prop_oneof![Just(0.0), 0.0..0.5],
    ) {
        let mut landmarks = Landmarks::new(voxel_size);
        let mut told = BTreeMap::new();
        for (component, cluster) in steps {
            let component = ComponentId(component);
            landmarks.set(component, cluster.as_ref());
            told.remove(&component);
            let id = ClusterId::new(u64::from(component.0) + 1).unwrap();
            told.extend(cluster.map(|cluster| (component, Cluster { id, ..cluster })));
        }
        let told: Told = told.iter().map(|(component, cluster)| (*component, cluster)).collect();
        for cluster in told.values() {
            prop_assert_eq!(landmarks.floor_below(middle(cluster), apart), plain_floor(cluster, &told, apart));
            let edges = edges(cluster);
            let near = edges.map(|edges| landmarks.near(&edges)).unwrap_or_default();
            let found = Uprights::of(cluster, edges.as_ref(), near.iter().map(|other| told[other]));
            prop_assert_eq!(found, plain_uprights(cluster, &told));
        }
    }
}

#[test]
fn a_mirror_image_below_a_floor_is_no_floor_and_the_floor_below_a_platform_is() {
    let mut landmarks = Landmarks::new(0.08);
    let mut put = |component, height, sides| {
        let level = rectangle([0.0, 0.0, height], [0.0; 3], sides);
        landmarks.set(ComponentId(component), Some(&level));
        landmarks.floor_below(1.0, 0.0)
    };
    assert_eq!(put(0, -0.09, [1.0, 1.3]), Some(-0.09), "nothing else is known");
    assert_eq!(put(1, 0.0, [8.0, 4.0]), Some(0.0));
    assert_eq!(put(2, 0.2, [20.0, 10.0]), Some(0.0), "a platform of six times the floor that is seen");
    assert_eq!(put(3, 0.5, [80.0, 80.0]), Some(0.0), "too high for what lies below to be its image");
}

#[test]
fn a_pit_in_a_floor_is_no_floor_however_deep_it_is() {
    for depth in [0.12, 0.35, 1.4, 2.4] {
        let mut landmarks = Landmarks::new(0.08);
        landmarks.set(ComponentId(0), Some(&rectangle([0.0; 3], [0.0; 3], [8.0, 4.0])));
        landmarks.set(ComponentId(1), Some(&rectangle([9.0, 0.0, -depth], [0.0; 3], [3.0, 1.0])));
        assert_eq!(landmarks.floor_below(0.0, 0.0), Some(0.0), "{depth}");
        assert_eq!(
            (landmarks.floor_below(-depth, 0.0), landmarks.lowest_floor()),
            (None, Some(0.0)),
            "{depth}"
        );
        // As much of it that it may be a room.
        landmarks.set(ComponentId(1), Some(&rectangle([9.0, 0.0, -depth], [0.0; 3], [3.0, 3.0])));
        assert_eq!(landmarks.floor_below(0.0, 0.0), Some(-depth), "{depth}");
    }
}

#[test]
fn a_wall_at_a_slant_is_in_the_cells_along_it_and_not_in_those_of_the_square_around_it() {
    let half_pi = std::f64::consts::FRAC_PI_2;
    let mut landmarks = Landmarks::new(0.08);
    landmarks.set(ComponentId(0), Some(&rectangle([0.0; 3], [0.5 * half_pi, 0.0, half_pi], [80.0, 2.5])));
    let plan: BTreeSet<_> = landmarks.uprights.iter().map(|([x, y, _], _)| [x, y]).collect();
    assert!(plan.len() < 200, "{}", plan.len());
    let is_near = |x, y, z| !landmarks.near(&[Point3::new(x, y, z)]).is_empty();
    assert!(is_near(20.0, 20.0, 0.0) && is_near(-28.0, -28.0, 0.0) && !is_near(20.0, -20.0, 0.0));
    assert!(!is_near(20.0, 20.0, 9.0), "three storeys above");
    landmarks.set(ComponentId(0), None);
    assert_eq!(landmarks, Landmarks::new(0.08));
}

#[test]
fn a_wall_of_large_voxels_is_in_no_more_cells_than_one_of_as_many_small_ones() {
    let half_pi = std::f64::consts::FRAC_PI_2;
    let cells = |voxel_size: f64| {
        let mut landmarks = Landmarks::new(voxel_size);
        let sides = [80.0, 20.0].map(|voxels| voxels * voxel_size);
        landmarks.set(ComponentId(0), Some(&rectangle([0.0; 3], [0.5 * half_pi, 0.0, half_pi], sides)));
        landmarks.uprights.len()
    };
    let few = cells(0.25);
    for voxel_size in [1.0, 10.0, 1e3, 1e5] {
        assert!(
            (10..=few).contains(&cells(voxel_size)),
            "{} cells of voxels of {voxel_size} m",
            cells(voxel_size)
        );
    }
}

#[test]
fn every_storey_has_a_floor() {
    let mut landmarks = Landmarks::new(0.08);
    let level = |height: f64| rectangle([0.0, 0.0, height], [0.0; 3], [4.0, 3.0]);
    for (component, height) in (0..).zip([0.75, 2.8, 3.55, 0.0, 1e17, 3e17]) {
        landmarks.set(ComponentId(component), Some(&level(height)));
    }
    let floors = [
        (0.0, Some(0.0)),
        (-0.05, Some(0.0)),
        (0.75, Some(0.0)),
        (1.3, Some(0.0)),
        (2.6, Some(0.0)),
        (2.76, Some(2.8)),
        (2.8, Some(2.8)),
        (3.55, Some(2.8)),
        (4.0, Some(2.8)),
        (9.0, Some(2.8)),
        (-1.0, None),
        (2e17, Some(1e17)),
        (4e17, Some(3e17)),
    ];
    for (middle, floor) in floors {
        assert_eq!(landmarks.floor_below(middle, 0.0), floor, "below {middle}");
    }
}

#[test]
fn a_floor_that_leans_is_level_with_itself_wherever_most_of_it_is() {
    let mut landmarks = Landmarks::new(0.08);
    let mut floor = rectangle([0.0; 3], [0.0, 0.02, 0.0], [26.0, 4.0]);
    // Most points are in the room at one end of a corridor.
    floor.centroid.z += 0.09;
    landmarks.set(ComponentId(0), Some(&floor));
    assert_eq!(landmarks.floor_below(middle(&floor), 0.0), Some(middle(&floor)));
}

#[test]
fn a_ramp_is_no_floor() {
    let mut landmarks = Landmarks::new(0.08);
    let degrees = |angle: f64| rectangle([0.0; 3], [0.0, 0.0, angle.to_radians()], [3.0, 1.2]);
    landmarks.set(ComponentId(0), Some(&degrees(12.0)));
    assert_eq!(landmarks.floor_below(0.0, 0.0), None);
    landmarks.set(ComponentId(0), Some(&degrees(8.0)));
    assert!(landmarks.floor_below(0.0, 0.0).is_some());
}
