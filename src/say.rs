//! Lines for whoever looks on. A reader who has gone (`cfodi ... | head -1`) misses what is said, and nothing else: no result
//! is lost by it, and the status stays.
//!
//! One who reads on later (a pager, a terminal that is held, a collector of logs whose disk is full) is not waited for either, least
//! of all by the thread that hears the network and its signals: once [`start`] has been called, the thread `cfodi-log` writes what is
//! said, in the order in which it was.

mod queue;

use std::backtrace::{Backtrace, BacktraceStatus};
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::panic::{self, PanicHookInfo};
use std::sync::{Arc, OnceLock};
use std::thread::Builder;
use std::time::Duration;

use self::queue::Queue;

/// How long a reader who takes nothing is waited for where the order of lines or the end of the process asks for that.
const PATIENCE: Duration = Duration::from_secs(1);

static LOG: OnceLock<Arc<Queue>> = OnceLock::new();

/// From now on nobody waits for who reads stderr, where panics are told as well; without a thread to be had, all still do.
pub fn start() {
    let queue = Arc::new(Queue::default());
    let lines = Arc::clone(&queue);
    if Builder::new().name("cfodi-log".to_owned()).spawn(move || lines.write_to(io::stderr())).is_ok() {
        drop(LOG.set(queue));
        panic::set_hook(Box::new(tell_of));
    }
}

/// Writes a line of the log to stderr.
pub fn say(line: impl Display) {
    // Where not even this can be written there is no place to say so.
    drop(Stderr.write_all(format!("{line}\n").as_bytes()));
}

/// Writes what was asked for to stdout, behind what was said: both may be one pipe.
///
/// # Errors
/// Where it cannot be written though somebody reads: a disk is full.
pub fn tell(text: impl Display) -> io::Result<()> {
    flush();
    let failed = |error: io::Error| io::Error::new(error.kind(), format!("cannot write to stdout: {error}"));
    unless_closed(writeln!(io::stdout(), "{text}")).map_err(failed)
}

fn unless_closed(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Waits until what was said is written, or its reader has taken nothing for a second.
pub fn flush() {
    if let Some(queue) = LOG.get() {
        queue.flush(PATIENCE);
    }
}

/// Ends the process with this status, once what was said is written as by [`flush`].
pub fn exit(status: i32) -> ! {
    flush();
    std::process::exit(status)
}

/// Each text that is written to it is said: lines with their ends.
#[derive(Clone, Copy, Debug)]
pub struct Stderr;

impl Write for Stderr {
    fn write(&mut self, lines: &[u8]) -> io::Result<usize> {
        match LOG.get() {
            Some(queue) => queue.put(lines),
            None => io::stderr().write_all(lines)?,
        }
        Ok(lines.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// In the words of the standard library, whose own hook would wait for the reader.
fn tell_of(panic: &PanicHookInfo<'_>) {
    let thread = std::thread::current();
    let backtrace = Backtrace::capture();
    let backtrace = match backtrace.status() {
        BacktraceStatus::Captured => format!("stack backtrace:\n{backtrace}"),
        _ => "note: run with `RUST_BACKTRACE=1` environment variable to display a backtrace".to_owned(),
    };
    say(format_args!("\nthread '{}' {panic}\n{backtrace}", thread.name().unwrap_or("<unnamed>")));
    // It may abort the process.
    flush();
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
