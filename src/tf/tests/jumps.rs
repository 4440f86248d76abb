//! Stamps that jump back: what is forgotten, and what is not.

use super::*;

#[test]
fn a_bag_that_loops_clears_the_dynamic_transforms_and_keeps_the_static_ones() {
    let mut frames = robot();
    assert_eq!(
        frames.dynamic("odom", "base_link", 1.0, 5.0),
        Inserted::Stored,
        "one second back is a late message"
    );
    assert_eq!(frames.dynamic("odom", "base_link", 0.999, 6.0), Inserted::JumpedBack);
    assert_eq!(frames.frame_names(), ["base_link", "camera", "odom"], "map -> odom is of the time before");
    assert_eq!(frames.x("odom", "camera", 0.999), Ok(6.5));
    assert_eq!(frames.x("odom", "camera", 1.5), Err("tf_too_late"));
    assert_eq!(frames.dynamic("map", "odom", 0.0, 1.0), Inserted::Stored);
}

#[test]
fn a_frame_of_two_publishers_whose_stamps_lie_apart_clears_what_others_have_once() {
    let mut frames = robot();
    frames.dynamic("map", "tag", 2.0, 0.0);
    assert_eq!(frames.dynamic("map", "tag", 0.5, 0.0), Inserted::JumpedBack);
    let found = frames.dynamic("map", "tag", 2.1, 0.0);
    assert!(matches!(found, Inserted::ToAndFro { apart } if (apart - 1.6).abs() < 1e-9), "{found:?}");
    for step in 0..50 {
        let now = 2.2 + 0.1 * f64::from(step);
        assert_eq!(frames.dynamic("odom", "base_link", now, now), Inserted::Stored);
        assert_eq!(frames.dynamic("map", "tag", now - 1.6, 0.0), Inserted::Stored);
        assert_eq!(frames.dynamic("map", "tag", now, 0.0), Inserted::Stored);
    }
    assert_eq!(frames.x("odom", "camera", 3.0).unwrap(), 3.5);
    assert_eq!(frames.jumps(), 1);
    // A bag that begins again is still told by the others.
    assert_eq!(frames.dynamic("odom", "base_link", 2.2, 0.0), Inserted::JumpedBack);
    assert_eq!(frames.frame_names(), ["base_link", "camera", "odom"]);
}

#[test]
fn nor_does_one_whose_late_publisher_sends_several_times_as_often_clear_it_again_and_again() {
    for often in [2, 3, 5] {
        let mut frames = robot();
        for step in 0..100 {
            let now = 2.2 + 0.1 * f64::from(step);
            frames.dynamic("map", "tag", now, 0.0);
            for part in 0..often {
                let late = now - 1.6 + 0.1 * f64::from(part) / f64::from(often);
                frames.dynamic("map", "tag", late, 0.0);
            }
            assert_eq!(frames.dynamic("odom", "base_link", now, now), Inserted::Stored);
        }
        assert_eq!(frames.jumps(), 1, "{often} times");
    }
}

/// One whose clock is an hour ahead, until somebody ends it.
#[test]
fn a_frame_of_two_publishers_goes_on_as_one_when_the_later_one_has_been_silent() {
    let mut frames = robot();
    let now = |step: u32| 10.0 + 0.1 * f64::from(step);
    for step in 0..30 {
        frames.dynamic("odom", "base_link", now(step) + 3600.0, 0.0);
        frames.dynamic("odom", "base_link", now(step), now(step));
    }
    let jumps = frames.jumps();
    let back = (30..400)
        .find(|&step| frames.dynamic("odom", "base_link", now(step), now(step)) == Inserted::JumpedBack);
    assert_eq!((back, frames.jumps()), (Some(130), jumps + 1), "after ten seconds alone");
    frames.dynamic("odom", "base_link", now(131), now(131));
    assert_eq!(frames.x("odom", "camera", now(131)), Ok(now(131) + 0.5));
}

#[test]
fn a_bag_that_loops_is_no_frame_of_two_publishers_when_it_comes_to_its_end_again() {
    let mut frames = Frames::new();
    for lap in 0..3 {
        for step in 0..40 {
            let expected = if lap > 0 && step == 0 { Inserted::JumpedBack } else { Inserted::Stored };
            assert_eq!(
                frames.dynamic("odom", "base_link", 0.1 * f64::from(step), 0.0),
                expected,
                "{lap} {step}"
            );
        }
    }
}

/// As a map's poses at keyframes are sent.
#[test]
fn nor_is_one_whose_frame_comes_less_than_once_a_second() {
    for (step, steps) in [(1.1, 30), (2.0, 10), (5.0, 4), (20.0, 4)] {
        let mut frames = Frames::new();
        for lap in 0..4 {
            for count in 0..steps {
                let expected = if lap > 0 && count == 0 { Inserted::JumpedBack } else { Inserted::Stored };
                let seconds = step * f64::from(count);
                assert_eq!(
                    frames.dynamic("odom", "base_link", seconds, 0.0),
                    expected,
                    "{seconds} s of lap {lap}, every {step} s"
                );
            }
        }
    }
}

#[test]
fn an_overtaken_transform_of_such_a_frame_is_of_use_at_the_end_of_a_lap_too() {
    let mut frames = Frames::new();
    for seconds in [0.0, 5.0, 10.0, 15.0, 0.0, 5.0, 10.0] {
        frames.dynamic("odom", "base_link", seconds, 0.0);
    }
    frames.dynamic("map", "tag", 15.1, 0.0);
    assert_eq!(frames.jumps(), 1);
    assert!(frames.is_of_use(&message("odom", "base_link", 15.0, &shift(0.0))));
}

#[test]
fn an_overtaken_transform_does_not_bring_back_what_its_frame_was_before() {
    let mut frames = robot();
    assert!(frames.is_of_use(&message("odom", "base_link", 1.9, &shift(0.0))));
    let moved = Inserted::Reparented { before: "odom".into() };
    assert_eq!(frames.dynamic("map", "base_link", 2.0, 0.0), moved);
    assert!(!frames.is_of_use(&message("odom", "base_link", 1.9, &shift(0.0))), "another parent");
    assert!(frames.is_of_use(&message("map", "base_link", 1.9, &shift(0.0))));
    assert!(!frames.is_of_use(&message("base_link", "camera", 1.9, &shift(0.0))), "it is static");
}

#[test]
fn two_publishers_that_send_less_than_once_a_second_are_found_at_their_second_turn() {
    for (period, late, by) in [(2.0, 1.5, 0.1), (2.0, 30.0, 0.1), (5.0, 7.0, 2.0), (1.5, 2.2, 0.7)] {
        let mut frames = Frames::new();
        let found = (0..6).map(|turn| {
            let now = period * f64::from(turn);
            let of_first = frames.dynamic("map", "tag", now, 0.0);
            [of_first, frames.dynamic("map", "tag", now + by - late, 0.0)]
        });
        let found: Vec<_> = found.flatten().collect();
        assert_eq!(found[..2], [Inserted::Stored, Inserted::JumpedBack], "every {period} s, {late} s late");
        assert!(matches!(found[2], Inserted::ToAndFro { apart } if apart > JUMP_BACK), "{found:?}");
        assert!(found[3..].iter().all(|inserted| *inserted == Inserted::Stored), "{found:?}");
        assert_eq!(frames.jumps(), 1);
    }
}

#[test]
fn something_moves_below_a_frame_where_dynamic_transforms_lead_there_from_it() {
    let mut frames = Frames::new();
    frames.fixed("hall", "post", 0.0);
    frames.dynamic("map", "odom", 0.0, 0.0);
    frames.fixed("odom", "base_link", 0.0);
    assert_eq!(
        ["map", "odom", "base_link", "hall", "nowhere"].map(|frame| frames.moves_below(frame)),
        [true, false, false, false, false]
    );
    let above = |frame| frames.is_above(frame, "odom");
    assert_eq!(["map", "odom", "base_link", "hall"].map(above), [true, true, false, false]);
}

#[test]
fn a_jump_back_frees_the_places_of_what_it_clears() {
    let mut frames = Frames::new();
    frames.dynamic("b", "c", 5.0, 0.0);
    frames.dynamic("a", "b", 5.0, 0.0);
    // With c still under b, b under c would be a cycle; what stays after the jump allows it.
    assert_eq!(frames.dynamic("c", "b", 0.0, 1.0), Inserted::JumpedBack);
    assert_eq!(frames.x("c", "b", 0.0), Ok(1.0));
}

#[test]
fn a_scan_from_before_the_transforms_clears_them_only_when_they_are_far_ahead() {
    let mut frames = robot();
    assert!(!frames.forget_after(at(1.0)));
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.5));
    assert!(frames.forget_after(at(0.5)));
    assert_eq!(frames.frame_names(), ["base_link", "camera"]);
    assert!(!frames.forget_after(at(-99.0)), "nothing dynamic is left");
}
