//! Lines for whoever looks on. A reader who has gone (`cfodi ... | head -1`) misses what is said, and nothing else: no result
//! is lost by it, and the status stays.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

/// Writes a line of the log to stderr.
pub fn say(line: impl Display) {
    // Where not even this can be written there is no place to say so.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes what was asked for to stdout.
///
/// # Errors
/// Where it cannot be written though somebody reads: a disk is full.
pub fn tell(text: impl Display) -> io::Result<()> {
    let failed = |error: io::Error| io::Error::new(error.kind(), format!("cannot write to stdout: {error}"));
    unless_closed(writeln!(io::stdout(), "{text}")).map_err(failed)
}

fn unless_closed(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_who_has_gone_is_no_failure_and_a_full_disk_is_one() {
        let (reader, mut writer) = io::pipe().unwrap();
        drop(reader);
        assert_eq!(writer.write_all(b"map").unwrap_err().kind(), ErrorKind::BrokenPipe);
        unless_closed(writer.write_all(b"map")).unwrap();
        let full = unless_closed(Err(ErrorKind::StorageFull.into()));
        assert_eq!(full.unwrap_err().kind(), ErrorKind::StorageFull);
    }
}
