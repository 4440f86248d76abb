//! Lines on their way to who reads them.
//!
//! **Kept true.** Lines come out in the order in which they came. Each that has found room comes out whole; how many have found none
//! is said behind those before them.

use std::io::Write;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What may wait (bytes): some thirty thousand lines.
const MOST: usize = 4 << 20;

/// Lines that wait to be written.
#[derive(Debug, Default)]
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    /// Lines have come, or one was written.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    lines: Vec<u8>,
    /// What is being written (bytes).
    leaving: usize,
    /// Lines that have found no room since that was said last.
    lost: u64,
    /// Goes up with each line that is written.
    written: u64,
    /// Somebody has waited in vain since a line was written.
    is_stuck: bool,
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a line, or counts it: behind one that found no room none has any until all before it are written.
    pub(super) fn put(&self, line: &[u8]) {
        let mut waiting = self.lock();
        if waiting.lost > 0 || waiting.lines.len() + waiting.leaving + line.len() > MOST {
            waiting.lost += 1;
        } else {
            waiting.lines.extend(line);
        }
        self.changed.notify_all();
    }

    /// Writes what comes, for ever.
    pub(super) fn write_to(&self, mut out: impl Write) {
        loop {
            for line in self.take().split_inclusive(|&byte| byte == b'\n') {
                // A reader who has gone misses it, and nothing else.
                drop(out.write_all(line));
                let mut waiting = self.lock();
                waiting.leaving -= line.len();
                waiting.written += 1;
                waiting.is_stuck = false;
                self.changed.notify_all();
            }
        }
    }

    /// What is to be written next.
    fn take(&self) -> Vec<u8> {
        let mut waiting = self.lock();
        while waiting.lines.is_empty() && waiting.lost == 0 {
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
        if waiting.lines.is_empty() {
            let lost = std::mem::take(&mut waiting.lost);
            waiting.lines =
                format!("lines of the log that found no room, for nobody read it: {lost}\n").into();
        }
        waiting.leaving = waiting.lines.len();
        std::mem::take(&mut waiting.lines)
    }

    /// Waits until nothing waits, or nothing was written for so long, or since somebody else has waited in vain.
    pub(super) fn flush(&self, patience: Duration) {
        let mut waiting = self.lock();
        let (mut written, mut since) = (waiting.written, Instant::now());
        while waiting.leaving > 0 || !waiting.lines.is_empty() || waiting.lost > 0 {
            if std::mem::replace(&mut written, waiting.written) != waiting.written {
                since = Instant::now();
            }
            waiting.is_stuck |= since.elapsed() >= patience;
            if waiting.is_stuck {
                return;
            }
            let left = patience.saturating_sub(since.elapsed());
            let woken = self.changed.wait_timeout(waiting, left);
            waiting = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead as _, BufReader, PipeReader, Read as _, pipe};
    use std::sync::Arc;

    use super::*;

    const LONG: Duration = Duration::from_secs(60);

    /// A queue whose lines go into a pipe.
    fn piped() -> (Arc<Queue>, PipeReader) {
        let (reader, writer) = pipe().unwrap();
        let queue = Arc::new(Queue::default());
        let lines = Arc::clone(&queue);
        std::thread::spawn(move || lines.write_to(writer));
        (queue, reader)
    }

    fn line(number: usize) -> String {
        format!("line {number} of a log, as long as one is that has something to tell\n")
    }

    fn is_empty(queue: &Queue) -> bool {
        let waiting = queue.lock();
        waiting.leaving == 0 && waiting.lines.is_empty() && waiting.lost == 0
    }

    #[test]
    fn a_burst_of_thousands_of_lines_comes_out_whole_and_in_order() {
        const LINES: usize = 20_000;
        let (queue, reader) = piped();
        (0..LINES).for_each(|number| queue.put(line(number).as_bytes()));
        let said = BufReader::new(reader).lines().take(LINES).map(Result::unwrap);
        assert!(said.eq((0..LINES).map(|number| line(number).trim_end().to_owned())));
        queue.flush(LONG);
        assert!(is_empty(&queue));
    }

    #[test]
    fn nobody_waits_for_a_reader_who_has_stopped_and_one_who_comes_back_is_told_how_many_lines_were_lost() {
        let (queue, mut reader) = piped();
        let many = 2 * MOST / line(0).len();
        (0..many).for_each(|number| queue.put(line(number).as_bytes()));
        let lost = queue.lock().lost;
        assert!(lost > 0 && queue.lock().lines.len() <= MOST);
        let begun = Instant::now();
        queue.flush(Duration::from_millis(10));
        // Whoever comes after one who has waited in vain does not wait again.
        queue.flush(LONG);
        assert!(begun.elapsed() < LONG);
        assert!(!is_empty(&queue));

        let reading = std::thread::spawn(move || {
            let mut said = Vec::new();
            while !said.ends_with(b"last\n") {
                let mut some = [0; 1 << 12];
                let length = reader.read(&mut some).unwrap();
                said.extend(&some[..length]);
            }
            String::from_utf8(said).unwrap()
        });
        let begun = Instant::now();
        while !is_empty(&queue) {
            assert!(begun.elapsed() < LONG);
            std::thread::yield_now();
        }
        queue.put(b"last\n");
        let said = reading.join().unwrap();
        let kept = many - lost as usize;
        let told = format!("lines of the log that found no room, for nobody read it: {lost}\nlast\n");
        assert_eq!(said, (0..kept).map(line).chain([told]).collect::<String>());
    }

    #[test]
    fn a_reader_who_has_gone_holds_up_nothing() {
        let (queue, reader) = piped();
        drop(reader);
        (0..100).for_each(|number| queue.put(line(number).as_bytes()));
        queue.flush(LONG);
        assert!(is_empty(&queue));
    }
}
