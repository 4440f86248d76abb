//! A fixed frame that is none: it moves, and takes the sensor with it, so that what is seen from several places lies in one.
//!
//! Keeps true: it is told only where the frame has been seen to move, for some publish what stands still on `/tf` too, and never of a
//! frame that stands still by its name: a map that corrects its `odom` moves it as well.

use nalgebra::Isometry3;

use super::{Join, is_map};

/// Further than this, or by more, a frame moves (m, rad): what jitters or drifts does not.
const MOVES: f64 = 0.25;

/// The fixed frame in another one.
#[derive(Debug)]
pub(super) struct Riding {
    /// The frame that it is moved in by transforms, and the sensor with it.
    above: String,
    /// Where it was in that first.
    first: Isometry3<f64>,
    /// Whether it has been elsewhere.
    has_moved: bool,
}

impl Riding {
    fn note(&mut self, place: &Isometry3<f64>) {
        let moved = self.first.inverse() * place;
        self.has_moved |= moved.translation.vector.norm() > MOVES || moved.rotation.angle() > MOVES;
    }
}

impl Join {
    /// A warning of a fixed frame that has moved in another one while no transform moves a sensor in it. To be asked now and then
    /// while clouds come.
    pub fn riding(&mut self, fixed_frame: &str) -> Option<String> {
        if is_map(fixed_frame) {
            return None;
        }
        // Where nobody knows where the sensor stood, it may well move in that frame.
        let carried = self
            .sensors()
            .filter(|sensor| !self.is_of_no_sensor(sensor, fixed_frame))
            .find_map(|sensor| self.frames.carried(fixed_frame, sensor, is_map));
        let Some((above, place)) = carried.map(|(above, place)| (above.to_owned(), place)) else {
            self.riding = None;
            return None;
        };
        let known = self.riding.take().filter(|riding| riding.above == above);
        let mut riding = known.unwrap_or(Riding { above, first: place, has_moved: false });
        riding.note(&place);
        let Riding { above, has_moved, .. } = &*self.riding.insert(riding);
        has_moved.then(|| {
            format!(
                "the fixed frame `{fixed_frame}` moves in `{above}` and takes the sensor with it: what is seen from several places \
                 lies in one, and the map is smeared; choose -p fixed_frame:={above}"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::engine::{Points, Stamp};
    use crate::join::Moment;
    use crate::msg::ros::{Header, Transform, TransformStamped, Vector3};

    /// What is said in the end of a fixed frame where a camera sends clouds by these links, as parent and child; those of the first
    /// list come on `/tf` and move by so much (m) in a second.
    fn said(moving: &[&str], still: &[&str], fixed_frame: &str, by: f64) -> Option<String> {
        let mut join = Join::new(1);
        let mut said = None;
        for second in 0..4 {
            let stamp = Stamp::from_nanos(second * 1_000_000_000);
            let link = |pair: &&str, x: f64| {
                let (parent, child) = pair.split_once(' ').unwrap();
                let header = Header { stamp: stamp.into(), frame_id: parent.to_owned() };
                let transform =
                    Transform { translation: Vector3 { x, y: 0.0, z: 0.0 }, ..Transform::default() };
                TransformStamped { header, child_frame_id: child.to_owned(), transform }
            };
            for pair in moving {
                join.transform(&link(pair, by * second as f64), false).unwrap();
            }
            for pair in still {
                join.transform(&link(pair, 1.0), true).unwrap();
            }
            let points = Points::F32(vec![[0.0, 0.0, 1.0]]);
            let frame_id = "camera".to_owned();
            join.cloud(
                0,
                Cloud { stamp, frame_id, points, total: 1, invalid: 0, out_of_range: 0 },
                Moment::default(),
            );
            join.ready(fixed_frame);
            said = join.riding(fixed_frame);
        }
        said
    }

    #[test]
    fn a_fixed_frame_that_takes_the_sensor_with_it_is_told_with_one_that_does_not() {
        let still = &["base_link camera_link", "camera_link camera"];
        for moving in
            [&["odom base_link"][..], &["map odom", "odom base_link"], &["odom foot", "foot base_link"]]
        {
            for fixed_frame in ["base_link", "camera_link", "camera"] {
                let line = said(moving, still, fixed_frame, 0.5).unwrap();
                assert!(
                    line.starts_with(&format!("the fixed frame `{fixed_frame}` moves in `odom`")),
                    "{line}"
                );
                assert!(line.ends_with("choose -p fixed_frame:=odom"), "{line}");
            }
            assert_eq!(said(moving, still, "odom", 0.5), None);
        }
        let of_one = &["map robot1/odom", "robot1/odom base_link"];
        let line = said(of_one, &["base_link camera"], "base_link", 0.5).unwrap();
        assert!(line.ends_with("choose -p fixed_frame:=robot1/odom"), "{line}");
        // By other names.
        let line =
            said(&["site foot"], &["hall site", "foot base_link", "base_link camera"], "base_link", 0.5);
        let line = line.unwrap();
        assert!(line.starts_with("the fixed frame `base_link` moves in `hall`"), "{line}");
    }

    #[test]
    fn a_frame_in_which_the_sensor_moves_or_that_stands_still_takes_none_with_it() {
        let robot = &["map odom", "odom base_link"][..];
        for (moving, still, fixed_frame, by) in [
            (robot, &["base_link camera"][..], "map", 0.5),
            (robot, &["base_link camera"], "odom", 0.5),
            // Of a camera that a map corrects alone, of one on a wall, also by who sends that again and again, on a pan-tilt, and
            // beside a robot.
            (&["map odom"], &["odom camera"], "odom", 0.5),
            (&[], &["hall camera"], "hall", 0.5),
            (&["site hall"], &["hall camera"], "hall", 0.0),
            (&["odom base_link", "base_link tilt"], &["tilt camera"], "base_link", 0.5),
            (robot, &["hall camera", "hall map"], "hall", 0.5),
            (robot, &["hall camera"], "base_link", 0.5),
            // Clouds that come in the frame of a map, in which the sensor moves.
            (&["map camera", "camera body"], &[], "camera", 0.5),
            (&["map robot1/odom", "robot1/odom base_link"], &["base_link camera"], "robot1/odom", 0.5),
        ] {
            assert_eq!(said(moving, still, fixed_frame, by), None, "{moving:?} {still:?} {fixed_frame}");
        }
    }
}
