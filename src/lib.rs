//! Surfaces from a moving Kinect, live: a ROS 2 node after the paper "Revealing cluster formation over huge volatile robotic
//! data", to its letter or with clusters that are right after every scan.
//!
//! Data flows one way: bytes -> message -> [`engine::Scan`] -> [`engine::Engine`] -> [`engine::Snapshot`] -> message
//! -> bytes; imports point inwards. `ARCHITECTURE.md` draws the graph. Without default features the engine, the
//! decoders, the messages and the configuration remain. All of it is for unix: files have the
//! permissions, links and other names of that.

#[cfg(feature = "node")]
pub mod args;
#[cfg(feature = "bag")]
pub mod bag;
pub mod cloud;
mod colour;
pub mod config;
pub mod count;
pub mod engine;
#[cfg(feature = "bag")]
pub mod experiment;
pub mod export;
#[cfg(feature = "bag")]
pub mod join;
#[cfg(test)]
#[cfg(target_arch = "x86_64")]
#[path = "../tests/support/left_out.rs"]
mod left_out;
pub mod line;
pub mod link;
pub mod memory;
pub mod msg;
#[cfg(feature = "node")]
pub mod node;
pub mod rand_index;
#[cfg(feature = "bag")]
mod reach;
pub mod reason;
mod replace;
#[cfg(feature = "bag")]
pub mod replay;
#[cfg(feature = "bag")]
pub mod report;
#[cfg(feature = "bag")]
mod residual;
#[cfg(feature = "node")]
pub mod say;
#[cfg(feature = "node")]
pub mod signals;
#[cfg(feature = "sim")]
pub mod sim;
#[cfg(feature = "node")]
pub mod stop;
#[cfg(feature = "store")]
pub mod store;
#[cfg(feature = "bag")]
pub mod tf;
mod thread;
pub mod worker;
#[cfg(feature = "bag")]
pub mod yaml;
