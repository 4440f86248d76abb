//! How long a message is offered again that some reader keeps from being sent.
//!
//! RustDDS 0.15.1 takes no message while some reader has not acknowledged the last so many. One that it has just found
//! counts as if it had acknowledged none of all that were ever sent, until its first `ACKNACK` some milliseconds later: it
//! is waited for. One that is stopped, behind a wall, or slower than what is sent, stays so.

use std::cell::RefCell;
use std::time::Duration;

use tokio::time::{Instant, sleep};

/// What readers are waited for, in any [`REST`]: whatever they do, the engine's outputs find room meanwhile.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time until a message is offered again; then twice as long, up to the most: it is encoded anew each time.
const AGAIN: Duration = Duration::from_millis(2);
const SELDOM: Duration = Duration::from_millis(64);

/// Time after which there is patience again.
pub(super) const REST: Duration = Duration::from_secs(5);

/// How long is waited, in all.
pub(super) struct Patience(RefCell<Spent>);

struct Spent {
    since: Instant,
    time: Duration,
}

impl Spent {
    fn none() -> Self {
        Self { since: Instant::now(), time: Duration::ZERO }
    }

    fn left(&mut self) -> Duration {
        if self.since.elapsed() >= REST {
            *self = Self::none();
        }
        PATIENCE.saturating_sub(self.time)
    }
}

impl Patience {
    pub(super) fn new() -> Self {
        Self(RefCell::new(Spent::none()))
    }

    /// Offers a message until it is taken; gives it back where a reader keeps it from being sent, and has had time for
    /// acknowledging. `offer` gives back what is not taken.
    pub(super) async fn offer<M, E>(
        &self,
        mut message: M,
        offer: impl AsyncFn(M) -> Result<Option<M>, E>,
    ) -> Result<Option<M>, E> {
        let mut pause = AGAIN;
        while let Some(refused) = offer(message).await? {
            pause = pause.min(self.0.borrow_mut().left());
            if pause.is_zero() {
                return Ok(Some(refused));
            }
            sleep(pause).await;
            self.0.borrow_mut().time += pause;
            message = refused;
            pause = (2 * pause).min(SELDOM);
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_are_waited_for_so_long_in_any_rest_and_no_longer() {
        let mut spent = Spent::none();
        assert_eq!(spent.left(), PATIENCE);
        spent.time = PATIENCE / 2;
        assert_eq!(spent.left(), PATIENCE / 2);
        spent.time = 2 * PATIENCE;
        assert_eq!(spent.left(), Duration::ZERO);
        spent.since -= REST;
        assert_eq!(spent.left(), PATIENCE);
    }
}
