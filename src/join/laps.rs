//! Which lap a cloud is of: the stamps of a bag in a loop, or of a simulator that is reset, begin again and again.
//!
//! Such a jump back sets all sensors back, and each is noticed by its own next cloud, in any order. Keeps true: jumps that several sensors
//! make once each begin one lap, however their clouds interleave. A jump begins a lap only where its sensor is in the newest one already;
//! else another sensor has begun it, and it is how this one gets there. What a sensor sends late, after another has begun a lap, is of the
//! lap before. A sensor whose own clock goes on by more than [`JUMP_BACK`] meanwhile was not set back, and is in the newest lap from then
//! on; so is one that sends seldom and late. Only stamps of the same sensor are compared: another's clock may be off.

use std::collections::BTreeMap;

use super::{Key, SENSORS};
use crate::engine::{JUMP_BACK, Stamp};

/// The laps so far, and in which of them each sensor is.
#[derive(Debug, Default)]
pub(super) struct Laps {
    newest: u64,
    sensors: BTreeMap<Key, Arrival>,
}

/// What has come of a sensor, whether or not a transform comes for it.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    lap: u64,
    /// The newest stamp in that lap.
    newest: Stamp,
    /// The same, of what came while that lap was the newest of all.
    current: Stamp,
}

impl Laps {
    /// The newest lap.
    pub(super) const fn newest(&self) -> u64 {
        self.newest
    }

    /// The lap of a sensor's last cloud.
    pub(super) fn of(&self, sensor: &Key) -> Option<u64> {
        self.sensors.get(sensor).map(|arrival| arrival.lap)
    }

    /// The sensors that have sent a cloud since all were forgotten.
    pub(super) fn sensors(&self) -> impl Iterator<Item = &Key> {
        self.sensors.keys()
    }

    /// Takes note of a sensor's next cloud; gives its lap.
    pub(super) fn arrive(&mut self, sensor: Key, stamp: Stamp) -> u64 {
        if self.sensors.len() >= SENSORS {
            self.sensors.clear();
        }
        let first = Arrival { lap: self.newest, newest: stamp, current: stamp };
        let before = self.sensors.get(&sensor).copied();
        let arrival = before.map_or(first, |before| self.next(before, stamp));
        self.sensors.insert(sensor, arrival);
        arrival.lap
    }

    fn next(&mut self, before: Arrival, stamp: Stamp) -> Arrival {
        let has_jumped = stamp.jump_back_from(before.newest).is_some();
        self.newest += u64::from(has_jumped && before.lap == self.newest);
        let goes_on = stamp.seconds_since(before.current) > JUMP_BACK;
        let lap = if has_jumped || goes_on { self.newest } else { before.lap };
        let newest = if has_jumped { stamp } else { before.newest.max(stamp) };
        let current = if lap == self.newest { newest } else { before.current };
        Arrival { lap, newest, current }
    }

    /// Forgets all sensors: their stamps may be any again.
    pub(super) fn forget(&mut self) {
        self.sensors.clear();
    }

    /// Forgets the sensors that have sent nothing since a jump back to this stamp.
    pub(super) fn forget_before(&mut self, jump: Stamp) {
        self.sensors.retain(|_, arrival| jump.jump_back_from(arrival.newest).is_none());
    }
}
