//! What is drawn of a map.

use super::*;

fn shown(snapshot: &Snapshot) -> Viewer {
    Viewer::of(&Markers::default().update(&session(), snapshot))
}

#[test]
fn a_cluster_with_a_boundary_is_a_filled_polygon_with_its_edges_and_its_name() {
    let viewer = shown(&map(vec![square(12)], 0));
    assert_eq!(viewer.identities(), [(NAMES, 0), (NORMALS, 0), (OUTLINES, 0), (SURFACES, 0)]);
    let [surface, outline, name, normals] = [SURFACES, OUTLINES, NAMES, NORMALS].map(|ns| viewer.get(ns, 0));
    let kinds = [surface.kind, outline.kind, name.kind, normals.kind];
    assert_eq!(
        kinds,
        [Marker::TRIANGLE_LIST, Marker::LINE_LIST, Marker::TEXT_VIEW_FACING, Marker::LINE_LIST]
    );
    assert_eq!((surface.points.len(), outline.points.len(), normals.points.len()), (6, 8, 2));
    assert_eq!(name.text, "12 floor");
    assert!(name.pose.position.z > 0.0 && name.scale.z >= 0.1);
    assert_eq!(
        (surface.header.frame_id.as_str(), surface.lifetime),
        ("odom", crate::msg::ros::Duration::default())
    );
    // A scale of 0 hides all points of a list of triangles.
    assert_eq!(surface.scale, crate::msg::ros::Vector3 { x: 1.0, y: 1.0, z: 1.0 });
}

#[test]
fn what_is_behind_a_surface_shows_through_unless_it_is_a_floor() {
    let wall = Cluster { class: SurfaceClass::Wall, ..square(1) };
    let opacity = |cluster| shown(&map(vec![cluster], 0)).get(SURFACES, 0).color.a;
    assert!(opacity(wall) < 1.0);
    assert_eq!(opacity(square(1)), 1.0);
}

#[test]
fn far_from_the_origin_points_are_given_from_the_middle_of_the_surface() {
    let away = Vector3::new(2e6, -1e6, 30.0);
    let near = square(1);
    let far = Cluster {
        boundary: near.boundary.iter().map(|corner| corner + away).collect(),
        pose: Isometry3::translation(away.x, away.y, away.z),
        centroid: near.centroid + away,
        ..near.clone()
    };
    let [near, far] = [near, far].map(|cluster| shown(&map(vec![cluster], 0)));
    for ns in [SURFACES, OUTLINES] {
        let (near, far) = (near.get(ns, 0), far.get(ns, 0));
        assert_eq!(near.points, far.points);
        let place = far.pose.position;
        assert_eq!([place.x, place.y, place.z], <[f64; 3]>::from(away));
        assert_eq!(far.pose.orientation, near.pose.orientation);
    }
}

#[test]
fn a_cluster_without_a_boundary_is_its_voxels() {
    let viewer = shown(&map(vec![heap(12)], 0));
    assert_eq!(viewer.identities(), [(CLUSTERS, 0), (NAMES, 0), (NORMALS, 0)]);
    let cubes = viewer.get(CLUSTERS, 0);
    assert_eq!((cubes.kind, cubes.points.len(), cubes.text.as_str()), (Marker::CUBE_LIST, 1, "12"));
    assert_eq!(viewer.get(NAMES, 0).text, "12");
}

#[test]
fn voxels_in_no_cluster_are_grey_cubes_of_one_marker() {
    let viewer = shown(&map(vec![square(1)], 3));
    let cubes = viewer.get(UNCLUSTERED, 0);
    assert_eq!((cubes.kind, cubes.points.len()), (Marker::CUBE_LIST, 3));
    assert!(cubes.color.r == cubes.color.g && cubes.color.g == cubes.color.b);
    assert_eq!(viewer.get(NORMALS, 0).points.len(), 2);
}

#[test]
fn what_is_tentative_is_paler_and_has_no_name() {
    let tentative = Cluster { state: ClusterState::Tentative, ..square(1) };
    let [pale, full] = [tentative, square(1)].map(|cluster| shown(&map(vec![cluster], 0)));
    assert!(!pale.identities().contains(&(NAMES, 0)));
    for ns in [SURFACES, OUTLINES] {
        let [pale, full] = [&pale, &full].map(|viewer| viewer.get(ns, 0).color);
        assert!(pale.a < full.a && [pale.r, pale.g, pale.b] == [full.r, full.g, full.b]);
    }
}

#[test]
fn what_has_nothing_to_show_is_not_sent_empty() {
    let flat = Cluster { boundary: vec![Point3::origin(); 3], ..square(1) };
    let viewer = shown(&map(vec![flat], 0));
    assert!(!viewer.identities().contains(&(SURFACES, 0)));
    assert_eq!(shown(&map(Vec::new(), 0)), Viewer::default());
}

/// A round cluster of so many vertices, the larger the higher its id.
fn ring(id: u64, vertices: u32) -> Cluster {
    let corner = |i: u32| {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(vertices);
        Point3::new(turn.cos(), turn.sin(), 0.0)
    };
    Cluster { boundary: (0..vertices).map(corner).collect(), area: Some(id as f64), ..square(id) }
}

#[test]
fn the_largest_surfaces_that_fit_are_shown_and_the_others_said() {
    // A ring of 5000 vertices takes 24,994 points: four fit.
    let round = |id: u64| ring(id, 5000);
    let four = map((1..=4).map(round).collect(), 0);
    assert_eq!((slots_of(&four), left_out(&four)), (vec![0, 1, 2, 3], [None, None]));
    let six = map((1..=6).map(round).collect(), 0);
    assert_eq!(slots_of(&six).len(), 4);
    let names: Vec<_> = (0..4).map(|slot| shown(&six).get(SURFACES, slot).text.clone()).collect();
    assert_eq!(names, ["3", "4", "5", "6"]);
    let [surfaces, cubes] = left_out(&six);
    assert_eq!(surfaces.unwrap(), "~/markers shows 4 of 6 surfaces, the largest that fit into 100000 points");
    assert_eq!(cubes, None);
}

#[test]
fn a_surface_too_large_for_any_message_leaves_the_room_to_the_others() {
    let snapshot = map(vec![square(1), ring(2, 5000), ring(3, 30_000)], 0);
    let viewer = shown(&snapshot);
    let names: Vec<_> = (0..2).map(|slot| viewer.get(SURFACES, slot).text.clone()).collect();
    assert_eq!((slots_of(&snapshot), names), (vec![0, 1], vec!["1".to_owned(), "2".to_owned()]));
    let [surfaces, _] = left_out(&snapshot);
    assert_eq!(surfaces.unwrap(), "~/markers shows 2 of 3 surfaces, the largest that fit into 100000 points");
}

fn slots_of(snapshot: &Snapshot) -> Vec<i32> {
    let viewer = shown(snapshot);
    viewer.0.keys().filter(|(ns, _)| ns == SURFACES).map(|(_, slot)| *slot).collect()
}

#[test]
fn no_more_cubes_are_shown_than_a_viewer_can_take() {
    let snapshot = map(vec![heap(1)], MAX_CUBES as u32);
    let viewer = shown(&snapshot);
    assert_eq!(viewer.get(CLUSTERS, 0).points.len() + viewer.get(UNCLUSTERED, 0).points.len(), MAX_CUBES);
    assert_eq!(
        left_out(&snapshot)[1].as_deref(),
        Some("~/markers shows the first 20000 of 20001 voxels as cubes")
    );
}
