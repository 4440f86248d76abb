//! An office building as a formula: storeys of furnished rooms on both sides of a corridor. On one side the doors stand open,
//! and the floor of a storey is one surface; on the other they are shut, and what is in a room ends there.
//!
//! Every space is a box, so that a ray ends where it leaves its box, or goes on in the next where a door stands there; all of
//! an image takes some milliseconds. Lengths are metres, angles radians; x runs along the corridor, z is up.

use std::f32::consts::TAU;

/// Rooms on one side of a storey's corridor.
const ROOMS: usize = 16;
/// From one room to the next, from one storey to the next.
const ROOM_PITCH: f32 = 5.0;
const STOREY_PITCH: f32 = 3.0;
const HEIGHT: f32 = 2.7;
const HALF_WALL: f32 = 0.1;
/// The corridor is as wide to each side; behind its wall the rooms begin.
const CORRIDOR: f32 = 1.2;
const ROOM_BEGIN: f32 = CORRIDOR + 2.0 * HALF_WALL;
const ROOM_END: f32 = ROOM_BEGIN + 5.0;
/// Where the door of a room begins and ends, from the room's begin, and how high it is.
const DOOR: [f32; 2] = [1.0, 1.9];
const DOOR_HEIGHT: f32 = 2.05;
/// A table and a cupboard: opposite corners, from the room's begin and from the corridor's middle.
const FURNITURE: [[[f32; 3]; 2]; 2] =
    [[[3.0, 2.2, 0.0], [3.8, 3.8, 0.74]], [[0.9, 5.9, 0.0], [2.1, ROOM_END, 1.9]]];

/// Height of the camera above the floor.
const CAMERA: f32 = 1.2;
/// Way from one image of a drive to the next: 0.3 m/s at 30 Hz.
const STEP: f32 = 0.3 / 30.0;
/// The sides of the corridor with shut and with open doors.
const SHUT: f32 = 1.0;
const OPEN: f32 = -1.0;

/// A box of air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Space {
    Corridor,
    /// With the side of the corridor, -1 or 1.
    Room(usize, f32),
    Door(usize, f32),
}

/// A view of the building.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) storey: usize,
    space: Space,
    /// In the storey.
    at: [f32; 3],
    /// From x towards y, and downwards.
    pub(crate) yaw: f32,
    pub(crate) pitch: f32,
}

/// A room or what of the corridor lies between two: the building is their list, in the order in which it is visited. The
/// corridor comes before the rooms, so that the next ones are always beside what is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place(pub(crate) usize);

impl Place {
    /// Views from its middle in which most of it is seen.
    pub(crate) const VIEWS: usize = 18;
    /// A part of the corridor, a room with a shut door and one with an open door.
    pub(crate) const KINDS: usize = 3;

    /// The two rooms of this number, that with the shut door first.
    pub(crate) const fn rooms(number: usize) -> [Self; 2] {
        [Self(number * Self::KINDS + 1), Self(number * Self::KINDS + 2)]
    }

    /// Its storey, its number there and what it is.
    fn space(self) -> (usize, usize, Space) {
        let (number, kind) = (self.0 / Self::KINDS, self.0 % Self::KINDS);
        let number = if kind == 0 { number + 1 } else { number };
        let (storey, room) = (number / ROOMS, number % ROOMS);
        (storey, room, [Space::Corridor, Space::Room(room, SHUT), Space::Room(room, OPEN)][kind])
    }

    /// One of the views from its middle.
    pub(crate) fn view(self, number: usize) -> View {
        let yaw = (number % 6) as f32 * TAU / 6.0;
        let pitch = [0.0, 0.7, -0.75][number / 6];
        self.look([0.5 * ROOM_PITCH, 0.5 * (ROOM_BEGIN + ROOM_END)], yaw, pitch)
    }

    /// Image by image a drive into a room, with looks to both sides.
    pub(crate) fn drive(self, image: usize) -> View {
        let way = image as f32 * STEP;
        let (_, _, space) = self.space();
        let forwards = if let Space::Room(_, side) = space { side * TAU / 4.0 } else { 0.0 };
        self.look([1.6, ROOM_BEGIN + 0.5 + way], forwards + 0.25 * (TAU * way).sin(), 0.3)
    }

    /// From here, counted from the room's begin and the corridor's middle.
    fn look(self, [x, y]: [f32; 2], yaw: f32, pitch: f32) -> View {
        let (storey, room, space) = self.space();
        let side = if let Space::Room(_, side) = space { side } else { 0.0 };
        let at = [room as f32 * ROOM_PITCH + x, side * y, CAMERA];
        View { storey, space, at, yaw, pitch }
    }
}

impl View {
    /// Where the camera is in the building.
    pub(crate) fn place(&self) -> [f32; 3] {
        let [x, y, z] = self.at;
        [x, y, z + self.storey as f32 * STOREY_PITCH]
    }

    /// How often this direction fits between the camera and what it meets; infinite where that is more than `most`.
    #[inline]
    pub(crate) fn cast(&self, direction: [f32; 3], most: f32) -> f32 {
        let inverse = direction.map(f32::recip);
        let mut space = self.space;
        loop {
            let [low, high] = space.corners();
            let walls: [f32; 3] = std::array::from_fn(|axis| {
                let wall = if direction[axis] > 0.0 { high[axis] } else { low[axis] };
                (wall - self.at[axis]) * inverse[axis]
            });
            let far = walls[0].min(walls[1]).min(walls[2]);
            if let Space::Room(room, side) = space
                && let Some(near) = self.furniture(room, side, inverse, far)
            {
                return if near <= most { near } else { f32::INFINITY };
            }
            if far > most {
                return f32::INFINITY;
            }
            // Only walls along the corridor have doors.
            let way = direction[1].signum();
            let next = (far == walls[1]).then(|| space.beyond(way, self.along(direction, far)));
            let Some(next) = next.flatten() else { return far };
            space = next;
        }
    }

    /// Place along the corridor and height after that way.
    fn along(&self, direction: [f32; 3], way: f32) -> [f32; 2] {
        [0, 2].map(|axis| self.at[axis] + way * direction[axis])
    }

    fn furniture(&self, room: usize, side: f32, inverse: [f32; 3], most: f32) -> Option<f32> {
        let mut nearest = None;
        for corners in FURNITURE {
            let (mut enters, mut leaves) = (0.0_f32, nearest.unwrap_or(most));
            for axis in 0..3 {
                let (shift, turn) = [(room as f32 * ROOM_PITCH, 1.0), (0.0, side), (0.0, 1.0)][axis];
                let [a, b] =
                    corners.map(|corner| (corner[axis] * turn + shift - self.at[axis]) * inverse[axis]);
                (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
            }
            if enters < leaves {
                nearest = Some(enters);
            }
        }
        nearest
    }
}

impl Space {
    /// Those with the least and the greatest coordinates, in the storey.
    fn corners(self) -> [[f32; 3]; 2] {
        let begin = |room| room as f32 * ROOM_PITCH;
        let sorted = |a: f32, b: f32| [a.min(b), a.max(b)];
        let (x, y, height) = match self {
            Self::Corridor => ([HALF_WALL, begin(ROOMS) - HALF_WALL], [-CORRIDOR, CORRIDOR], HEIGHT),
            Self::Room(room, side) => (
                [begin(room) + HALF_WALL, begin(room + 1) - HALF_WALL],
                sorted(side * ROOM_BEGIN, side * ROOM_END),
                HEIGHT,
            ),
            Self::Door(room, side) => {
                (DOOR.map(|edge| begin(room) + edge), sorted(side * CORRIDOR, side * ROOM_BEGIN), DOOR_HEIGHT)
            }
        };
        [[x[0], y[0], 0.0], [x[1], y[1], height]]
    }

    /// What lies beyond the wall in this way along y, at this place along the corridor and this height.
    fn beyond(self, way: f32, [x, z]: [f32; 2]) -> Option<Self> {
        let (room, side) = match self {
            Self::Door(room, side) if way == side => return Some(Self::Room(room, side)),
            Self::Door(..) => return Some(Self::Corridor),
            Self::Corridor if way == OPEN => ((x / ROOM_PITCH) as usize, way),
            Self::Room(room, side) if side == OPEN && way == -side => (room, side),
            _ => return None,
        };
        let within = x - room as f32 * ROOM_PITCH;
        (within > DOOR[0] && within < DOOR[1] && z < DOOR_HEIGHT).then_some(Self::Door(room, side))
    }
}
