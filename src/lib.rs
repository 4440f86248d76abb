//! Surfaces from a moving Kinect, live.

pub mod engine;
pub mod msg;
