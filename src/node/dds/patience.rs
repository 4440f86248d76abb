//! How long a message is offered again that some reader keeps from being sent.
//!
//! RustDDS 0.15.1 takes no message while some reader has not acknowledged the last so many. One that it has just found
//! counts as if it had acknowledged none of all that were ever sent, until its first `ACKNACK`: it is waited for. That comes some
//! milliseconds later where the reader knows the publisher; one that was there before the node has yet to be told of it, and Fast
//! DDS then answers after as much as a second. A reader that is stopped, behind a wall, or slower than what is sent, stays so.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use tokio::time::{Instant, sleep};

/// What readers are waited for, in any [`REST`]: whatever they do, the engine's outputs find room meanwhile.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time until a message is offered again; then twice as long, up to the most: it is encoded anew each time.
const AGAIN: Duration = Duration::from_millis(2);
const SELDOM: Duration = Duration::from_millis(64);

/// Time after which there is patience again.
pub(super) const REST: Duration = Duration::from_secs(5);

/// For how long it may be a reader that has just been found, since an offer was refused and none before that for [`REST`].
const FOUND: Duration = Duration::from_secs(2);

/// How long is waited, in all, and since when offers are refused.
pub(super) struct Patience {
    spent: RefCell<Spent>,
    refusals: Cell<Option<Refusals>>,
}

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

/// Offers that were refused, with less than [`REST`] between one and the next.
#[derive(Clone, Copy)]
struct Refusals {
    first: Instant,
    last: Instant,
}

impl Refusals {
    fn with(before: Option<Self>, now: Instant) -> Self {
        let lasting = before.filter(|before| now.duration_since(before.last) < REST);
        Self { first: lasting.map_or(now, |lasting| lasting.first), last: now }
    }

    fn may_pass(&self) -> bool {
        self.last.duration_since(self.first) < FOUND
    }
}

impl Patience {
    pub(super) fn new() -> Self {
        Self { spent: RefCell::new(Spent::none()), refusals: Cell::default() }
    }

    /// Whether it may be a reader that has just been found that keeps messages from being sent.
    pub(super) fn may_be_of_new_reader(&self) -> bool {
        self.refusals.get().is_none_or(|refusals| refusals.may_pass())
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
            self.refusals.set(Some(Refusals::with(self.refusals.get(), Instant::now())));
            pause = pause.min(self.spent.borrow_mut().left());
            if pause.is_zero() {
                return Ok(Some(refused));
            }
            sleep(pause).await;
            self.spent.borrow_mut().time += pause;
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

    /// Whether each offer that is refused at these milliseconds may be so for a reader that has just been found.
    fn pass<const N: usize>(refused: [u64; N]) -> [bool; N] {
        let (start, mut refusals) = (Instant::now(), None);
        refused.map(|at| {
            let now = Refusals::with(refusals, start + Duration::from_millis(at));
            refusals = Some(now);
            now.may_pass()
        })
    }

    #[test]
    fn who_refuses_has_just_been_found_for_2_s_and_not_again_before_there_was_rest() {
        assert_eq!(
            pass([0, 500, 1_999, 2_000, 6_999, 12_000, 13_999, 14_000]),
            [true, true, true, false, false, true, true, false]
        );
    }

    #[test]
    fn a_slow_reader_that_takes_some_is_none_that_has_just_been_found() {
        assert_eq!(pass([0, 1_500, 3_000, 7_500, 12_400]), [true, true, false, false, false]);
    }
}
