//! Whatever comes in: all ways in equal a naive oracle, and nothing panics.

use proptest::prelude::*;

use super::*;
use crate::cloud::convert::{convert_fast, convert_plain};

/// Values at which a sign, a limit or a class of number changes.
fn coordinate() -> impl Strategy<Value = f64> {
    let special =
        prop::sample::select(vec![0.0, -0.0, NAN, f64::INFINITY, f64::NEG_INFINITY, 0.4, 6.0, 1e-40, 1e300]);
    prop_oneof![3 => -8.0..8.0_f64, 1 => special]
}

fn form() -> impl Strategy<Value = Form> {
    let kinds = prop::array::uniform3(prop::sample::select(vec![PointField::FLOAT32, PointField::FLOAT64]));
    let all_single = Just([PointField::FLOAT32; 3]);
    let order = Just(["x", "y", "z"]).prop_shuffle();
    let kinds = prop_oneof![kinds, all_single];
    (kinds, order, prop::array::uniform4(0..5_u32), 0..9_u32, any::<bool>()).prop_map(
        |(kinds, order, gaps, row_padding, is_bigendian)| {
            let mut end = 0;
            let mut fields = Vec::new();
            for ((name, datatype), gap) in order.into_iter().zip(kinds).zip(gaps) {
                fields.push((name, end + gap, datatype));
                end += gap + if datatype == PointField::FLOAT64 { 8 } else { 4 };
            }
            Form { fields, point_step: end + gaps[3], row_padding, is_bigendian }
        },
    )
}

/// A few points, or more than are judged together, in few rows or in many.
fn points() -> impl Strategy<Value = (u32, Vec<[f64; 3]>)> {
    let sizes =
        prop_oneof![8 => (0..5_u32, 0..7_u32), 1 => (1..3_u32, 200..600_u32), 1 => (200..600_u32, 1..3_u32)];
    sizes.prop_flat_map(|(height, width)| {
        let count = (height * width) as usize;
        (Just(height), prop::collection::vec(prop::array::uniform3(coordinate()), count))
    })
}

fn filter() -> impl Strategy<Value = CloudFilter> {
    let optical = prop::sample::select(vec![Optical::Auto, Optical::Yes, Optical::No]);
    optical.prop_map(|optical| CloudFilter { optical, ..KINECT })
}

fn measured([x, y, z]: [f64; 3], optical: bool) -> bool {
    [x, y, z].iter().all(|v| v.is_finite())
        && [x, y, z].iter().any(|v| v.abs() > 0.0)
        && !(optical && z <= 0.0)
}

fn in_range([x, y, z]: [f64; 3], optical: bool) -> bool {
    (0.4..=6.0).contains(&if optical { z } else { (x * x + y * y + z * z).sqrt() })
}

proptest! {
    #[test]
    fn any_layout_equals_the_naive_oracle(
        form in form(), (height, points) in points(), filter in filter(),
        frame in prop::sample::select(vec!["base_link", "kinect_depth"]),
    ) {
        let optical = filter.optical.of_frame(frame);
        let single = |name| form.fields.iter().any(|&(n, _, kind)| n == name && kind == PointField::FLOAT32);
        let single = ["x", "y", "z"].map(single);
        let stored = |p: &[f64; 3]| [0, 1, 2].map(|i| if single[i] { f64::from(p[i] as f32) } else { p[i] });
        let sent: Vec<_> = points.iter().map(stored).collect();
        let valid: Vec<_> = sent.iter().copied().filter(|&p| measured(p, optical)).collect();
        let kept: Vec<_> = valid.iter().copied().filter(|&p| in_range(p, optical)).collect();

        let cloud = taken(&form.message(frame, height, &points), &filter).unwrap();
        prop_assert_eq!(wide(&cloud.points), kept.clone());
        prop_assert_eq!(cloud.total as usize, sent.len());
        prop_assert_eq!(cloud.invalid as usize, sent.len() - valid.len());
        prop_assert_eq!(cloud.out_of_range as usize, valid.len() - kept.len());
    }

    #[test]
    fn the_fast_path_equals_the_plain_one_on_any_bytes(
        form in form(), height in 1..4_u32, width in 1..9_u32, bytes in prop::collection::vec(any::<u8>(), 4096),
        optical in any::<bool>(),
    ) {
        let mut message = form.message("f", height, &vec![[1.0; 3]; (height * width) as usize]);
        for field in &mut message.fields {
            field.datatype = PointField::FLOAT32;
        }
        message.is_bigendian = false;
        message.data = bytes;
        let layout = Layout::check(&Description::of(&message), message.data.len(), u32::MAX).unwrap().unwrap();
        let everything = CloudFilter { min_range: 0.0, max_range: f64::MAX, ..KINECT };
        let gate = Gate::new(&everything, optical);
        let fast = convert_fast(&layout, &message.data, &gate).unwrap();
        prop_assert_eq!(fast, convert_plain(&layout, &message.data, &gate));
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..512)) {
        let _ = by_seed(&bytes, KINECT);
        let _ = by_big_endian_seed(&bytes, KINECT);
    }

    #[test]
    fn a_damaged_message_never_panics_and_both_ways_in_agree(
        form in form(), (height, points) in points(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = cdr(&form.message(OPTICAL_FRAME, height, &points));
        for (index, value) in damage {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        let owned = cdr_encoding::from_bytes::<PointCloud2, LittleEndian>(&bytes).map(|(m, _)| decode(&m, &KINECT));
        match (by_seed(&bytes, KINECT), owned) {
            (Ok(seed), Ok(owned)) => prop_assert_eq!(seed, owned),
            (Err(_), Err(_)) => {}
            (seed, owned) => prop_assert!(false, "{seed:?} but {owned:?}"),
        }
    }
}
