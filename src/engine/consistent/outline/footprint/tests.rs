use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

fn content() -> impl Strategy<Value = Content> {
    proptest::collection::vec(proptest::array::uniform2(0.0..1.0), 1..6)
        .prop_map(|points| Content::of_points(&points))
}

fn voxels() -> impl Strategy<Value = Vec<(Column, Content)>> {
    proptest::collection::vec((proptest::array::uniform2(-4..4), content()), 0..90)
}

fn of(voxels: &[(Column, Content)]) -> Footprint {
    let mut footprint = Footprint::new(Axis(2));
    voxels.iter().for_each(|&(column, content)| footprint.add(column, &content));
    footprint
}

/// The rim by its definition.
fn naive_rim(voxels: &[(Column, Content)]) -> Vec<Column> {
    let columns: BTreeSet<Column> = voxels.iter().map(|&(column, _)| column).collect();
    let lacks = |&column: &Column| (0..4).any(|side| !columns.contains(&beyond(column, side)));
    columns.iter().copied().filter(lacks).collect()
}

proptest! {
    #[test]
    fn it_depends_on_what_is_in_it_and_not_on_order_or_history(
        stay in voxels(), go in voxels(), turn in 0usize..90,
    ) {
        let whole = of(&stay);
        prop_assert_eq!(whole.rim_columns(), naive_rim(&stay));

        let mut mixed: Vec<_> = stay.iter().chain(&go).copied().collect();
        let middle = turn.min(mixed.len());
        mixed.rotate_left(middle);
        let mut running = of(&mixed);
        go.iter().rev().for_each(|&(column, content)| running.remove(column, &content));
        prop_assert_eq!(&running, &whole);

        let at = turn.min(stay.len());
        let mut halves = of(&stay[..at]);
        halves.merge(&of(&stay[at..]));
        prop_assert_eq!(&halves, &whole);
    }
}

#[test]
fn the_rim_of_columns_over_many_tiles_is_that_of_its_definition() {
    let is_hole = |x: i32, y: i32| (x * 7 + y * 13) % 29 == 0 || (x > 3 && y > 12);
    let columns = (-21..19).flat_map(|x| (-18..23).map(move |y| (x, y))).filter(|&(x, y)| !is_hole(x, y));
    let voxels: Vec<_> = columns.map(|(x, y)| ([x, y], Content::of([0.5; 2], [0.25; 2]))).collect();
    let mut footprint = of(&voxels);
    assert_eq!(footprint.rim_columns(), naive_rim(&voxels));
    let (gone, left): (Vec<_>, Vec<_>) = voxels.iter().partition(|([x, _], _)| *x < -5);
    gone.iter().for_each(|(column, content)| footprint.remove(*column, content));
    footprint.tidy();
    assert_eq!(footprint, of(&left));
    assert_eq!(footprint.rim_columns(), naive_rim(&left));
}

#[test]
fn a_column_of_several_voxels_has_their_mean_however_many_there_are() {
    let [low, high] = [[0.25, 0.5], [0.75, 1.0]].map(|point| Content::of_points(&[point]));
    let column = |pairs: usize| of(&[([0, 0], low), ([0, 0], high)].repeat(pairs)).content([0, 0]).unwrap();
    for pairs in [1, 1000, 8191] {
        assert_eq!((column(pairs).voxels, column(pairs).means()), (2 * pairs as u32, [0.5, 0.75]));
        assert_eq!(column(pairs).squares(), [0.3125, 0.625]);
    }
    let mut footprint = of(&[([0, 0], low), ([0, 0], high)].repeat(20_000));
    (0..19_999).for_each(|_| [low, high].iter().for_each(|content| footprint.remove([0, 0], content)));
    assert_eq!(footprint, of(&[([0, 0], low), ([0, 0], high)]), "what did not fit is whole again");
}

#[test]
fn the_axis_is_that_of_the_longest_part_of_the_normal_and_the_lowest_of_equals() {
    let of = |x, y, z| Axis::dominant(&UnitVector3::new_normalize(nalgebra::Vector3::new(x, y, z))).index();
    assert_eq!([of(0.1, -0.9, 0.3), of(0.0, 0.0, -1.0), of(1.0, 1.0, 1.0), of(0.1, -1.0, 1.0)], [1, 2, 0, 1]);
    let key = VoxelKey::new(3, 4, 5).unwrap();
    assert_eq!([0, 1, 2].map(|axis| Axis(axis).column(key)), [[4, 5], [3, 5], [3, 4]]);
}

#[test]
fn an_axis_is_kept_until_the_normal_leans_well_towards_another() {
    let kept = |from: usize, degrees: f64| {
        let (y, x) = degrees.to_radians().sin_cos();
        Axis(from).kept(&UnitVector3::new_normalize(nalgebra::Vector3::new(x, y, 0.0))).index()
    };
    assert_eq!([0.0, 44.0, 46.0, 49.0, 50.0, 90.0].map(|degrees| kept(0, degrees)), [0, 0, 0, 0, 1, 1]);
    assert_eq!([90.0, 46.0, 44.0, 41.0, 40.0, 0.0].map(|degrees| kept(1, degrees)), [1, 1, 1, 1, 0, 0]);
    assert_eq!([44.0, 46.0].map(|degrees| kept(2, degrees)), [0, 1]);
}

#[test]
fn along_an_axis_that_is_kept_a_normal_has_more_than_half_its_length() {
    let parts = || (0..=20).map(f64::from);
    let normals = parts().flat_map(|x| parts().map(move |y| nalgebra::Vector3::new(x, y, 20.0)));
    for normal in normals.map(UnitVector3::new_normalize) {
        for axis in [0, 1, 2].map(Axis) {
            assert!(normal[axis.kept(&normal).index()] > 0.51, "{normal:?} along {axis:?}");
        }
    }
}
