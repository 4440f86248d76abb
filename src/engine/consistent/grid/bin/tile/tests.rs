//! What a processor's own instructions make of a tile against the same in plain Rust.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use proptest::prelude::*;

use super::*;

#[derive(Default, Debug, PartialEq)]
struct Sums(BTreeMap<i32, ScanSums>);

impl Sink for Sums {
    fn add(&mut self, key: LocalKey, sums: &ScanSums) {
        self.0.entry(key.0).or_default().merge(sums);
    }
}

/// What a tile puts into its voxels, and whether points lie beyond the region.
fn summed<L: Lanes>(lanes: L, mut tile: L::Tile) -> (Sums, bool) {
    let (mut sums, has_far) = (Sums::default(), tile.has_far());
    sum_by_voxel(lanes, &mut tile, &mut sums);
    (sums, has_far)
}

/// The same for each of the ways that the processor at hand has; all of it is that of [`Plain`].
fn agree<T: PartialEq>(of: &impl OnLanes<T>) -> Result<T, TestCaseError> {
    let plain = of.run(Plain);
    #[cfg(target_arch = "x86_64")]
    {
        use pulp::x86::{V3, V4};

        prop_assert!(same(V3::try_new().map(avx2::Avx2), of, &plain, "AVX2"), "AVX2");
        prop_assert!(same(V4::try_new().map(avx512::Avx512), of, &plain, "AVX-512"), "AVX-512");
    }
    Ok(plain)
}

/// Whether these make the same of it. Where the processor has none of them that is left out.
#[cfg(target_arch = "x86_64")]
fn same<T: PartialEq>(lanes: Option<impl Lanes>, of: &impl OnLanes<T>, plain: &T, name: &str) -> bool {
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    static NOTED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    if lanes.is_none() && NOTED.lock().unwrap().insert(name.to_owned()) {
        crate::left_out::leave_out(
            &format!("tile/tests.rs::agree, {name}"),
            &format!("this processor has no {name}"),
        );
    }
    lanes.is_none_or(|lanes| of.run(lanes) == *plain)
}

trait OnLanes<T> {
    fn run(&self, lanes: impl Lanes) -> T;
}

impl OnLanes<(Sums, bool)> for (Pixels<'_>, SensorRegion) {
    fn run(&self, lanes: impl Lanes) -> (Sums, bool) {
        summed(lanes, lanes.of_pixels(&self.0, &self.1))
    }
}

impl OnLanes<(Sums, bool)> for (Listed, SensorRegion) {
    fn run(&self, lanes: impl Lanes) -> (Sums, bool) {
        summed(lanes, lanes.of_points(&self.0, &self.1))
    }
}

fn eight<T: std::fmt::Debug>(of: impl Strategy<Value = T>) -> impl Strategy<Value = [T; SIDE]> {
    prop::collection::vec(of, SIDE).prop_map(|eight| eight.try_into().unwrap())
}

/// Any number in single precision, most of them where depths and coordinates are.
fn number() -> impl Strategy<Value = f32> {
    let near = (-9.0..9.0_f64).prop_map(|number| number as f32);
    prop_oneof![40 => near, 1 => prop::num::f32::ANY, 1 => Just(f32::INFINITY), 1 => Just(0.0)]
}

/// Large voxels, of which a tile is in few, and small ones.
fn region() -> impl Strategy<Value = SensorRegion> {
    let three = || prop::array::uniform3(-3.0..3.0_f64);
    (three(), three(), prop_oneof![0.01..0.1_f64, 1.0..9.0]).prop_map(|(way, turn, size)| {
        SensorRegion::new(&Isometry3::new(way.into(), turn.into()), size).unwrap()
    })
}

proptest! {
    #[test]
    fn pixels_are_put_where_the_plain_ones_are(
        depths in eight(eight(number())), columns in prop::array::uniform3(eight(-1e5..1e5_f64)),
        rows in eight(prop::array::uniform3(-1e5..1e5_f64)), region in region(),
    ) {
        let pixels = Pixels { depths: depths.each_ref(), columns: columns.each_ref(), rows: &rows };
        agree(&(pixels, region))?;
    }

    #[test]
    fn points_are_put_where_the_plain_ones_are(
        points in prop::array::uniform3(eight(eight(number()))), region in region(),
    ) {
        let points: Listed = points.map(|along| along.as_flattened().try_into().unwrap());
        agree(&(points, region))?;
    }
}

#[test]
fn as_many_voxels_as_points_are_more_than_passes() {
    let region = SensorRegion::new(&Isometry3::identity(), 0.1).unwrap();
    let along = |step: usize| std::array::from_fn(|i| 0.05 + (i * step % 8) as f32);
    let points: Listed = [along(1), along(3), std::array::from_fn(|i| 0.1 * i as f32)];
    let (sums, has_far) = agree(&(points, region)).unwrap();
    assert!(sums.0.len() > PASSES && !has_far, "{sums:?}");
}
