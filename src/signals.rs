//! The signals that ask the program to end: SIGINT, SIGTERM, and SIGHUP, by which a terminal or an ssh session that goes ends
//! what runs in it, unless that is to be ignored (`nohup`). And SIGXFSZ, which asks for nothing and is not to end it.

use std::io;

use tokio::runtime;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// SIGXFSZ, but on MIPS and PA-RISC (signal(7)).
const FILE_TOO_LARGE: i32 = 25;

/// Has a file that would grow larger than the process may make it (`ulimit -f`, `LimitFSIZE=`) be the failure of that write, as
/// on a full disk, instead of the end of the program.
///
/// # Errors
/// Where the system does not give the signal.
pub fn outlive_limit_of_files() -> io::Result<()> {
    let runtime = runtime::Builder::new_current_thread().enable_io().build()?;
    let _within = runtime.enter();
    // What was caught once stays so for the life of the process.
    signal(SignalKind::from_raw(FILE_TOO_LARGE)).map(drop)
}

/// The signals that ask it to end, from the moment on that this is made.
#[derive(Debug)]
pub struct Signals {
    interrupt: Signal,
    terminate: Signal,
    /// `None` where it is ignored.
    hangup: Option<Signal>,
}

impl Signals {
    /// Catches them; has to be called within a runtime.
    ///
    /// # Errors
    /// Where the system does not give them.
    pub fn new() -> io::Result<Self> {
        let hangup = SignalKind::hangup();
        let is_ignored = std::fs::read_to_string("/proc/self/status")
            .is_ok_and(|status| ignores(&status, hangup.as_raw_value()));
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: if is_ignored { None } else { Some(signal(hangup)?) },
        })
    }

    /// Resolves at the next of them.
    pub async fn any(&mut self) {
        let hangup = async {
            match &mut self.hangup {
                Some(hangup) => hangup.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = hangup => {}
        }
    }
}

/// Whether a process of this `/proc/PID/status` ignores a signal: bit n - 1 of `SigIgn` is signal n (proc(5)).
fn ignores(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_ignored_whose_bit_is_set() {
        let status = "Name:\tcfodi\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000000002\n";
        assert_eq!([1, 2, 13, 15].map(|signal| ignores(status, signal)), [true, false, true, false]);
        assert!(!ignores("Name:\tcfodi\n", 1));
    }
}
