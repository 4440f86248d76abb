//! The live node: a middleware's events in, messages out.
//!
//! It begins with a [`Setup`], which [`args`] has checked. [`transport`] is what it needs of a [`middleware`]; [`dds`] is that
//! over ROS 2's DDS, and the only module that imports `ros2_client`; `zenoh`, with the feature of that name, is it over Zenoh;
//! `live` joins clouds with their transforms and hands scans to the worker; `inputs` finds the words about what is heard
//! and what could be; `compressed` says when compressed depth images are read; [`process`] is all of it as a process; `publish` turns the worker's outputs into messages;
//! [`record`] keeps them; `parameters` answers the parameter services.

mod clock;
mod compressed;
mod counts;
pub mod dds;
#[cfg(test)]
mod fake;
mod heard;
mod inputs;
mod kept;
mod live;
pub mod middleware;
mod own_thread;
mod parameters;
mod places;
pub mod process;
mod publish;
mod readers;
pub mod record;
pub mod resume;
pub mod rosout;
mod saving;
mod seeds;
mod speak;
mod throttle;
mod topics;
pub mod transport;
mod vitals;
#[cfg(feature = "zenoh")]
pub mod zenoh;

pub use self::clock::now;
pub use self::live::LiveError;
pub use self::topics::check_names;
pub use crate::args::{self, Setup};

#[cfg(not(any(feature = "humble", feature = "jazzy")))]
compile_error!("feature `node` needs the ROS 2 distribution that it talks to: feature `jazzy` or `humble`");
