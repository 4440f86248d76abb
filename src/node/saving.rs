//! Maps on their way into a file, on a thread of its own: a slow disk holds up neither the engine nor the network.

use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tracing::{debug, warn};

use crate::engine::SavedMap;
use crate::msg::ros::TriggerResponse;
use crate::store::{self, StoreError};

/// A map that has been written: its number of scans and its bytes.
pub(super) type Written = Result<(u64, u64), StoreError>;

/// Starts the thread `cfodi-saver`, which writes what it is sent, one map after the other, and ends when the sender is gone.
///
/// # Errors
/// When the system gives no thread.
pub(super) fn start(path: PathBuf) -> std::io::Result<(Sender<Box<SavedMap>>, UnboundedReceiver<Written>)> {
    let (maps, waiting) = channel::<Box<SavedMap>>();
    let (written, results) = unbounded_channel();
    std::thread::Builder::new().name("cfodi-saver".to_owned()).spawn(move || {
        for map in waiting {
            let result = store::write(&path, &map).map(|bytes| (map.sequence(), bytes));
            if written.send(result).is_err() {
                return;
            }
        }
    })?;
    Ok((maps, results))
}

/// Who waits for a map to be written. At most one is under way, so that none piles up before a slow disk.
#[derive(Debug)]
pub(super) struct Saving<Request> {
    is_under_way: bool,
    /// Another was asked for since.
    is_due: bool,
    /// Calls that the map under way answers.
    asked: Vec<Request>,
    /// Calls that came after it was asked for.
    waiting: Vec<Request>,
}

impl<Request> Default for Saving<Request> {
    fn default() -> Self {
        Self { is_under_way: false, is_due: false, asked: Vec::new(), waiting: Vec::new() }
    }
}

impl<Request> Saving<Request> {
    /// Whether a map is to be asked for now; `call` waits for it, or for the next one.
    pub(super) fn begin(&mut self, call: Option<Request>) -> bool {
        let begins = !std::mem::replace(&mut self.is_under_way, true);
        let calls = if begins { &mut self.asked } else { &mut self.waiting };
        calls.extend(call);
        self.is_due |= !begins;
        begins
    }

    /// The calls that are answered by a map that has been written; whether the next is to be asked for.
    pub(super) fn end(&mut self) -> (Vec<Request>, bool) {
        let answered = std::mem::replace(&mut self.asked, std::mem::take(&mut self.waiting));
        self.is_under_way = std::mem::take(&mut self.is_due);
        (answered, self.is_under_way)
    }

    /// All that wait.
    pub(super) fn into_calls(self) -> impl Iterator<Item = Request> {
        self.asked.into_iter().chain(self.waiting)
    }
}

/// What a caller of `~/save` is told.
pub(super) fn response(written: &Written) -> TriggerResponse {
    match written {
        Ok((scans, bytes)) => {
            TriggerResponse { success: true, message: format!("{scans} scans saved, {bytes} bytes") }
        }
        Err(error) => TriggerResponse { success: false, message: error.to_string() },
    }
}

/// Says how a map was written that nobody has called for.
pub(super) fn log(written: &Written) {
    match written {
        Ok((scans, bytes)) => debug!("map of {scans} scans saved, {bytes} bytes"),
        Err(error) => warn!("the map was not saved: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_while_a_map_is_written_gets_the_next_one_called_for_or_not() {
        let mut saving = Saving::default();
        assert!(saving.begin(Some(1)) && !saving.begin(Some(2)) && !saving.begin(None));
        assert_eq!(saving.end(), (vec![1], true));
        assert_eq!(saving.end(), (vec![2], false));
        assert!(saving.begin(None), "a reset, say");
        assert!(!saving.begin(None), "and one more, which is in the map under way or not");
        assert_eq!(saving.end(), (vec![], true));
        assert_eq!(saving.end(), (vec![], false));
        assert!(saving.begin(Some(3)) && !saving.begin(Some(4)));
        assert!(saving.into_calls().eq([3, 4]));
    }
}
