//! Transforms that nobody sends who means well: each costs itself at most, and memory stays bounded.

use super::*;

const YEAR: f64 = 365.25 * 86400.0;

#[test]
fn a_name_of_a_megabyte_is_refused_and_not_kept() {
    let mut frames = robot();
    let long = "x".repeat(1 << 20);
    for (parent, child) in [(long.as_str(), "camera"), ("odom", long.as_str())] {
        let refused = frames.insert(&message(parent, child, 0.0, &shift(1.0)), true).unwrap_err();
        assert_eq!(refused, FrameError::LongName { bytes: 1 << 20, max: 256 });
        assert!(refused.to_string().len() < 100);
    }
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.5));
}

#[test]
fn quaternions_that_turn_nothing_are_refused() {
    let quaternion = |[x, y, z, w]: [f64; 4]| ros::Quaternion { x, y, z, w };
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let bad = [
        ([0.0; 4], "bad_norm"),
        ([1e-300, 0.0, 0.0, 0.0], "bad_norm"),
        ([0.0, 0.0, 0.0, f64::MIN_POSITIVE / 8.0], "bad_norm"),
        ([1.0, 1.0, 1.0, 1.0], "bad_norm"),
        ([f64::MAX, f64::MAX, 0.0, 0.0], "bad_norm"),
        ([nan, 0.0, 0.0, 1.0], "non_finite"),
        ([0.0, inf, 0.0, 0.0], "non_finite"),
    ];
    for (numbers, reason) in bad {
        let mut frames = robot();
        let mut message = message("odom", "base_link", 2.5, &shift(9.0));
        message.transform.rotation = quaternion(numbers);
        assert_eq!(frames.insert(&message, false).unwrap_err().reason().key, reason, "{numbers:?}");
        assert_eq!(frames.dynamic("odom", "base_link", 2.5, 5.0), Inserted::Stored);
        assert_eq!(frames.x("odom", "camera", 2.5), Ok(5.5));
    }
}

#[test]
fn translations_without_an_end_are_refused_and_the_greatest_numbers_are_an_error_of_the_lookup_at_most() {
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let refused = robot().insert(&message("odom", "base_link", 2.5, &shift(x)), false);
        assert_eq!(refused.unwrap_err().reason().key, "non_finite");
    }
    let mut frames = robot();
    frames.dynamic("odom", "base_link", 3.0, -f64::MAX);
    frames.dynamic("odom", "base_link", 3.1, f64::MAX);
    // Between the two lies no number that could be computed, or a finite one.
    assert!(
        frames.x("odom", "camera", 3.05).is_ok_and(f64::is_finite)
            || frames.x("odom", "camera", 3.05).is_err()
    );
    frames.dynamic("odom", "base_link", 4.0, 1.0);
    assert_eq!(frames.x("odom", "camera", 4.0), Ok(1.5));
}

#[test]
fn the_smallest_numbers_are_numbers_like_any() {
    let mut frames = robot();
    frames.dynamic("odom", "base_link", 3.0, f64::MIN_POSITIVE / 4.0);
    assert_eq!(frames.x("odom", "camera", 3.0), Ok(0.5));
}

#[test]
fn a_cycle_of_any_length_is_refused_and_leaves_the_tree_as_it_was() {
    let mut frames = robot();
    for length in [2, 3, 100] {
        let name = |i: usize| format!("c{length}_{}", i % length);
        for i in 0..length - 1 {
            frames.fixed(&name(i), &name(i + 1), 1.0);
        }
        let closing = frames.insert(&message(&name(length - 1), &name(0), 0.0, &shift(1.0)), true);
        assert_eq!(closing.unwrap_err().reason().key, "cycle");
        assert_eq!(frames.root_of(&name(length - 1)), Some(name(0).as_str()));
    }
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.5));
}

#[test]
fn a_chain_is_followed_so_far_and_no_further() {
    let mut frames = Frames::new();
    let name = |i: usize| format!("f{i}");
    for i in 0..MAX_DEPTH {
        frames.fixed(&name(i), &name(i + 1), 1.0);
    }
    assert_eq!(frames.x("f0", &name(MAX_DEPTH), 0.0), Ok(MAX_DEPTH as f64));
    let refused = frames.insert(&message(&name(MAX_DEPTH), "deeper", 0.0, &shift(1.0)), true).unwrap_err();
    assert_eq!(refused, FrameError::TooDeep { child: "deeper".into(), max: MAX_DEPTH });
    // Put under another frame as a whole it comes to lie deeper, and its end is not looked up any more.
    frames.fixed("above", "f0", 1.0);
    assert_eq!(frames.x("above", &name(MAX_DEPTH), 0.0), Err("tf_too_deep"));
    assert_eq!(frames.x("above", &name(MAX_DEPTH - 1), 0.0), Ok(MAX_DEPTH as f64));
}

#[test]
fn the_samples_of_a_frame_are_bounded_and_time_makes_room_again() {
    let mut frames = Frames::new();
    let insert = |frames: &mut Frames, nanos: i64| {
        let mut message = message("odom", "camera", 0.0, &shift(1.0));
        message.header.stamp = Stamp::from_nanos(nanos).into();
        frames.insert(&message, false).map_err(|error| error.reason().key)
    };
    // By turns far from each other and from the newest: none of them can be spared.
    let newest = 900_000_000;
    assert_eq!(insert(&mut frames, newest), Ok(Inserted::Stored));
    for nanos in 1..MAX_FRAME_SAMPLES as i64 {
        assert_eq!(insert(&mut frames, nanos + nanos % 2 * 400_000_000), Ok(Inserted::Stored));
    }
    assert_eq!(insert(&mut frames, 200_000_000), Err("too_many_samples"));
    assert_eq!(insert(&mut frames, newest + 1_000_000), Err("too_many_samples"));
    assert_eq!(insert(&mut frames, newest + 1), Ok(Inserted::Stored), "as good as stored");
    let later = 10_000_000_001;
    assert_eq!(
        insert(&mut frames, newest + later),
        Err("too_many_samples"),
        "the flood may still be looked up"
    );
    assert_eq!(insert(&mut frames, newest + 2 * later), Ok(Inserted::Stored));
    frames.sanity_check();
}

#[test]
fn a_frame_of_2000_hz_can_be_looked_up_at_any_time_as_if_all_were_kept() {
    // In order, in pairs the wrong way round, and the same with blocks of ten.
    for block in [1, 2, 10] {
        let mut frames = Frames::new();
        let x = |seconds: f64| (0.7 * seconds).sin();
        let mut insert = |count: i64| {
            let seconds = count as f64 * 0.0005;
            let mut message = message("odom", "camera", 0.0, &shift(x(seconds)));
            message.header.stamp = Stamp::from_nanos(count * 500_000).into();
            assert_eq!(frames.insert(&message, false), Ok(Inserted::Stored), "at {seconds} s");
        };
        (0..60_000 / block).for_each(|from| (0..block).rev().for_each(|i| insert(from * block + i)));
        frames.sanity_check();
        // The newest may have been spared.
        for tick in 80_001..119_996 {
            let found = frames.lookup("odom", "camera", Stamp::from_nanos(tick * 250_000)).unwrap();
            let expected = x(tick as f64 * 0.00025);
            assert!((found.translation.x - expected).abs() < 1e-5, "{tick}, {block}: {found}");
        }
    }
}

/// When a flood plays (s): at the time of the others, and long after it.
const FLOODS: [f64; 2] = [0.0, 1e6];

#[test]
fn the_samples_of_all_frames_are_bounded_and_those_of_another_time_make_room() {
    for flood in FLOODS {
        let mut frames = Frames::new();
        frames.dynamic("odom", "other", flood, 1.0);
        let each = 5_000;
        for i in 0..MAX_SAMPLES {
            let mut message = message("odom", &format!("flood{}", i / each), flood, &shift(1.0));
            message.header.stamp.nanosec = 1000 + (i % each) as u32;
            let inserted = frames.insert(&message, false);
            assert_eq!(inserted.is_ok(), i < MAX_SAMPLES - 1, "{i}: {inserted:?}");
        }
        let refused = frames.insert(&message("odom", "other", flood + 1.0, &shift(1.0)), false).unwrap_err();
        assert_eq!(refused, FrameError::TooManySamples { child: "other".into(), max: MAX_SAMPLES });
        // What the flood holds is of no use twelve seconds later, nor long before it.
        assert_eq!(frames.dynamic("odom", "camera", 12.0, 3.0), Inserted::Stored);
        assert_eq!(frames.x("odom", "camera", 12.0), Ok(3.0));
        assert_eq!(frames.edges.len(), 1);
    }
}

#[test]
fn thousands_of_made_up_frames_make_room_once_they_are_out_of_date() {
    for flood in FLOODS {
        let mut frames = Frames::new();
        frames.fixed("base_link", "camera", 0.5);
        for i in 0..MAX_FRAMES - 1 {
            frames.insert(&message("odom", &format!("flood{i}"), flood, &shift(1.0)), false).unwrap();
        }
        let refused = frames.insert(&message("odom", "base_link", flood + 1.0, &shift(1.0)), false);
        assert_eq!(refused.unwrap_err().reason().key, "too_many_frames");
        assert_eq!(frames.dynamic("odom", "base_link", 11.0, 2.0), Inserted::Stored);
        assert_eq!(frames.x("odom", "camera", 11.0), Ok(2.5));
        assert_eq!(frames.edges.len(), 2, "the static one and the new one");
    }
}

#[test]
fn stamps_of_any_year_are_taken_and_the_next_good_one_is_too() {
    // The wire's seconds reach from 1901 to 2038.
    for year in [-68.8, 0.0, 68.0] {
        let mut frames = robot();
        let stray = message("odom", "base_link", year * YEAR - START, &shift(1.0));
        frames.insert(&stray, false).unwrap();
        frames.insert(&message("odom", "base_link", 3.0, &shift(7.0)), false).unwrap();
        frames.insert(&message("map", "odom", 3.0, &shift(0.0)), false).unwrap();
        assert_eq!(frames.x("odom", "camera", 3.0), Ok(7.5), "{year} years after 1970");
        frames.sanity_check();
    }
    for sec in [i32::MIN, i32::MAX] {
        let mut stray = message("odom", "base_link", 0.0, &shift(1.0));
        stray.header.stamp = ros::Time { sec, nanosec: 999_999_999 };
        let mut frames = robot();
        frames.insert(&stray, false).unwrap();
        let stamp = stray.header.stamp.stamp().unwrap();
        assert!(frames.lookup("odom", "camera", stamp).is_ok());
    }
}

proptest! {
    #[test]
    fn any_numbers_leave_the_tree_sound(
        steps in prop::collection::vec(
            (0..4_usize, 0..4_usize, any::<(i32, u32, bool)>(), any::<[f64; 3]>(), any::<[f64; 4]>(), any::<bool>()),
            0..40),
    ) {
        let names = ["a", "b", "c", ""];
        let mut frames = robot();
        for (parent, child, (sec, nanosec, is_static), [x, y, z], [qx, qy, qz, qw], is_unit) in steps {
            let mut message = message(names[parent], names[child], 0.0, &shift(0.0));
            message.header.stamp = ros::Time { sec, nanosec };
            message.transform.translation = ros::Vector3 { x, y, z };
            if !is_unit {
                message.transform.rotation = ros::Quaternion { x: qx, y: qy, z: qz, w: qw };
            }
            let _ = frames.insert(&message, is_static);
            frames.sanity_check();
            for pair in [("a", "b"), ("c", "a")] {
                let found = frames.lookup(pair.0, pair.1, Stamp::from_nanos(i64::from(sec) * 1_000_000_000));
                prop_assert!(found.is_err() || found.unwrap().translation.vector.iter().all(|v| v.is_finite()));
            }
        }
        // Time may have jumped back over all that was dynamic.
        frames.fixed("good", "next", 2.0);
        prop_assert_eq!(frames.x("good", "next", 1.0), Ok(2.0));
    }
}
