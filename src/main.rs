//! The `cfodi` binary.

fn main() {}
