//! The topics that are heard beside those of sensors, in one table: they are the same over any middleware and in a bag.

use super::topic::{Qos, Topic};
use super::types;

/// Transforms that change.
pub const TF: Topic = Topic::new("/tf", types::TRANSFORMS, Qos::reliable(100));
/// Transforms that hold for all time: what each of many publishers keeps of them comes at once.
pub const TF_STATIC: Topic = Topic::new("/tf_static", types::TRANSFORMS, Qos::latched(100));
/// The simulated time, of which the newest alone counts.
pub const CLOCK: Topic = Topic::new("/clock", types::CLOCK, Qos::best_effort(1));

/// The topics that are heard beside those of sensors, each with the quality of service that it is listened to with.
pub const TOPICS: [Topic; 3] = [TF, TF_STATIC, CLOCK];

/// The topic of transforms that hold for all time, or of those that change, as a robot offers it. Its lasting ones are in one
/// message, which it keeps; who listens keeps more, for others have theirs.
pub const fn of_robot(is_static: bool) -> Topic {
    if is_static { Topic { qos: Qos::latched(1), ..TF_STATIC } } else { TF }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_robot_offers_fits_who_listens() {
        for (row, is_static) in [(TF, false), (TF_STATIC, true)] {
            let offered = of_robot(is_static);
            assert_eq!(offered.named(), row.named());
            assert!(offered.qos.reliable && row.qos.reliable, "{}", row.name);
            assert_eq!([offered.qos.latched, row.qos.latched], [is_static; 2], "{}", row.name);
        }
    }
}
