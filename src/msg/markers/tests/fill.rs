//! Triangles cover what the boundary encloses less the holes, once.

use proptest::prelude::*;

use super::*;
use crate::engine::{Engine, Params, Points, Scan};
use crate::msg::markers::fill::triangles;

/// Columns of a floor on a side.
const SIDE: usize = 14;

/// What the engine makes of a floor of which only these columns are there, turned about x: its outlines have notches, holes
/// and corners that touch.
fn clusters(there: &[bool], turn: f64) -> Vec<Cluster> {
    let size = Params::default().voxel_size();
    let mut points = Vec::new();
    for place in (0..SIDE * SIDE).filter(|&place| there[place]) {
        for i in 0..36 {
            let at = |column: usize, step: usize| (column as f64 + (step as f64 + 0.5) / 6.0) * size;
            points.push([at(place % SIDE, i % 6), at(place / SIDE, i / 6), 0.0]);
        }
    }
    let turn = Isometry3::rotation(Vector3::x() * turn);
    let sensor = Isometry3::translation(0.5, 0.5, 1.5);
    let local = |p: [f64; 3]| (sensor.inverse_transform_point(&(turn * Point3::from(p)))).coords.into();
    let points = Points::F64(points.into_iter().map(local).collect());
    let mut engine = Engine::new(Params::default());
    engine.insert(&Scan { stamp: Stamp::default(), fixed_from_sensor: sensor, points });
    engine.snapshot().clusters
}

/// On the axes of the cluster's pose.
fn flat(cluster: &Cluster, point: &Point3<f64>) -> [f64; 2] {
    let local = cluster.pose.inverse_transform_point(point);
    [local.x, local.y]
}

fn area(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    0.5 * ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

/// Even-odd over all rings.
fn lies_inside(cluster: &Cluster, [x, y]: [f64; 2]) -> bool {
    let rings = std::iter::once(&cluster.boundary).chain(&cluster.holes);
    let crossings = rings.map(|ring| {
        let ring: Vec<_> = ring.iter().map(|point| flat(cluster, point)).collect();
        let edges = ring.iter().zip(ring.iter().cycle().skip(1));
        let crosses = |a: &[f64; 2], b: &[f64; 2]| {
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        };
        edges.filter(|(a, b)| crosses(a, b)).count()
    });
    crossings.sum::<usize>() % 2 == 1
}

fn fills(cluster: &Cluster) -> Result<(), TestCaseError> {
    let flattened =
        |ring: &Vec<Point3<f64>>| area(&ring.iter().map(|p| flat(cluster, p)).collect::<Vec<_>>());
    let wanted = flattened(&cluster.boundary) + cluster.holes.iter().map(flattened).sum::<f64>();
    let triangles = triangles(&mut Earcut::new(), cluster);
    let mut covered = 0.0;
    for corners in &triangles {
        let corners = corners.map(|corner| flat(cluster, &corner));
        let own = area(&corners);
        prop_assert!(own > 0.0);
        covered += own;
        let middle = [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0);
        // Triangles of no width to speak of lie on an edge.
        if own > 1e-9 {
            for corner in corners {
                let near = [0, 1].map(|axis| 0.98 * corner[axis] + 0.02 * middle[axis]);
                prop_assert!(lies_inside(cluster, near) && lies_inside(cluster, middle), "{corners:?}");
            }
        }
    }
    prop_assert!((covered - wanted).abs() < 1e-9 * wanted.max(1.0), "{covered} of {wanted} m^2");
    let vertices = cluster.boundary.len() + cluster.holes.iter().map(Vec::len).sum::<usize>();
    prop_assert!(triangles.len() <= vertices + 2 * cluster.holes.len() - 2);
    Ok(())
}

proptest! {
    #[test]
    fn triangles_cover_the_polygon_less_its_holes_once(
        there in prop::collection::vec(prop::bool::weighted(0.8), SIDE * SIDE),
        turn in -1.5..1.5_f64,
    ) {
        for cluster in clusters(&there, turn) {
            fills(&cluster)?;
        }
    }
}

#[test]
fn a_floor_with_a_hole_is_filled_to_its_area() {
    let there: Vec<_> = (0..SIDE * SIDE)
        .map(|place| !(5..9).contains(&(place % SIDE)) || !(5..9).contains(&(place / SIDE)))
        .collect();
    let clusters = clusters(&there, 0.0);
    let [floor] = &clusters[..] else { panic!("{} clusters", clusters.len()) };
    assert_eq!(floor.holes.len(), 1);
    fills(floor).unwrap();
    let triangles = triangles(&mut Earcut::new(), floor);
    let covered: f64 = triangles.iter().map(|t| area(&t.map(|corner| flat(floor, &corner)))).sum();
    assert!((covered - floor.area.unwrap()).abs() < 1e-9);
    for [a, b, c] in triangles {
        assert!((b - a).cross(&(c - a)).dot(&floor.normal) > 0.0, "clockwise seen from above");
    }
}
