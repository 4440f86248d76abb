//! What a fuzzer runs on any bytes: one module a target, each with `run(bytes)`, which panics where something does not hold.
//!
//! `fuzz/fuzz_targets/` calls them under cargo-fuzz, `tests/fuzz.rs` on the seeds and on bounded random bytes.
#![allow(dead_code, unreachable_pub, reason = "each fuzz target uses a part of it")]

pub mod bytes;
pub mod cloud;
pub mod depth;
pub mod engine;
pub mod mcap;
pub mod params;
pub mod reader;
pub mod scans;
pub mod snapshot;
