//! Tests that are left out, noted for the last line of `tests/run.sh`: see `left_out.sh`.

use std::fs::File;
use std::io::Write;

/// Notes that a test, or a part of it, is left out; `test` is its file and its name.
pub(crate) fn leave_out(test: &str, why: &str) {
    eprintln!("{test} left out: {why}");
    if let Some(list) = std::env::var_os("CFODI_LEFT_OUT") {
        let mut list = File::options().append(true).create(true).open(list).unwrap();
        // In one piece, for others write too.
        list.write_all(format!("{test}\t{why}\n").as_bytes()).unwrap();
    }
}
