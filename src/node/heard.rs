//! What the numbers of samples tell: which came already by another reader of the topic, which never came.
//!
//! A raw depth image is ten datagrams sent at once, and a stock socket buffer holds six. What is lost of them comes again
//! only to a reliable reader, which a best-effort publisher does not serve. So both kinds of reader are open, and what the
//! reliable one has of a publisher is not taken twice.
//!
//! Anyone on the network can make numbers up: none may silence a publisher for ever.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use crate::cloud::{CloudError, Decoded};

/// A publisher, as the middleware names it.
pub(super) type PublisherId = [u8; 16];

/// Where a message comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) publisher: PublisherId,
    /// Which of the publisher's messages it is: it counts them.
    pub(super) number: i64,
}

/// A scan as a reader has it.
#[derive(Debug)]
pub(super) struct Sample {
    pub(super) scan: Decoded,
    pub(super) origin: Origin,
}

/// A scan that is to be taken.
#[derive(Debug)]
pub(super) struct NextScan {
    pub(super) scan: Decoded,
    /// Scans that were sent before it and never arrived.
    pub(super) lost_before: u64,
}

/// How long nothing may come in the form that scans of a sensor are made of, until another that is offered is taken: one raw image may
/// get through a network that is too slow for them. Much longer than a camera takes to start anew.
pub(super) const SILENT: Duration = Duration::from_secs(60);

/// Publishers to remember; a driver that restarts is a new one each time.
const PUBLISHERS: usize = 1000;

/// By how many samples one may be overtaken: more than any reader keeps. What is older still has a number that was not made
/// by the publisher of the newest.
const LATE: i64 = 128;

/// Whether two samples are near enough to each other to be of one publisher at one time.
const fn are_near(a: i64, b: i64) -> bool {
    a.abs_diff(b) <= LATE.unsigned_abs()
}

/// The publisher's entry; when too many are remembered, all are dropped first.
fn entry<T: Default>(publishers: &mut BTreeMap<PublisherId, T>, publisher: PublisherId) -> &mut T {
    if publishers.len() >= PUBLISHERS {
        publishers.clear();
    }
    publishers.entry(publisher).or_default()
}

/// The publishers of one topic of scans.
#[derive(Debug, Default)]
pub(super) struct Known {
    heard: Heard,
    gaps: Gaps,
    /// When a scan came last, from the first on that was good, or an image that lacks its camera info alone: it would lack it in
    /// another form too.
    came: Option<Instant>,
}

impl Known {
    /// Whether a scan has come, within [`SILENT`], by which the sensor is taken in this form, or will be once its camera info is there.
    pub(super) fn comes(&self) -> bool {
        self.came.is_some_and(|came| came.elapsed() < SILENT)
    }

    /// The network is joined anew: its readers have heard nothing yet.
    pub(super) fn begin_anew(&mut self) {
        self.heard.begin_anew();
    }

    /// The topic was not read for a while: what was sent meanwhile is not lost.
    pub(super) fn begin_after_pause(&mut self) {
        self.gaps = Gaps::default();
    }

    /// Notes a scan, with or without a number.
    pub(super) fn note(&mut self, scan: &Decoded) {
        // Of a form that is taken any scan keeps it: the sensor is not silent.
        if self.came.is_some() || matches!(scan, Ok(_) | Err(CloudError::NoCameraInfo)) {
            self.came = Some(Instant::now());
        }
    }

    /// The scan of a sample, where it is to be taken. What could not be read as one is told as a scan that cannot be used, with
    /// nothing lost before it.
    pub(super) fn tell<E: ToString>(
        &mut self,
        sample: Result<Sample, E>,
        reliably: bool,
    ) -> Option<NextScan> {
        match sample {
            Ok(Sample { scan, origin: Origin { publisher, number } }) => {
                self.note(&scan);
                let takes = self.heard.takes(publisher, number, reliably);
                takes.then(|| NextScan { scan, lost_before: self.gaps.lost_before(publisher, number) })
            }
            Err(error) => {
                let tells = self.heard.tells_garbled(reliably);
                self.gaps.undecodable += u64::from(tells);
                let scan = Err(CloudError::Undecodable(error.to_string()));
                tells.then_some(NextScan { scan, lost_before: 0 })
            }
        }
    }
}

/// What has been heard of each publisher.
#[derive(Debug, Default)]
struct Heard {
    publishers: BTreeMap<PublisherId, Publisher>,
    /// A sample without so much as a header came reliably; it does not tell its publisher.
    garbled_reliably: bool,
}

#[derive(Debug, Default)]
struct Publisher {
    /// The newest number that came reliably.
    reliable: Option<i64>,
    /// The newest number that was taken from the best-effort reader.
    taken: Option<i64>,
}

impl Heard {
    /// What came by readers that are there no more was taken, and says nothing about what the new ones hear.
    fn begin_anew(&mut self) {
        self.garbled_reliably = false;
        for publisher in self.publishers.values_mut() {
            publisher.taken = publisher.taken.max(publisher.reliable.take());
        }
    }

    /// Notes a sample that tells no publisher; says whether it is to be told: once, where both readers have it.
    fn tells_garbled(&mut self, reliably: bool) -> bool {
        self.garbled_reliably |= reliably;
        reliably
            || !(self.garbled_reliably
                || self.publishers.values().any(|publisher| publisher.reliable.is_some()))
    }

    /// Whether a sample is to be taken that the reliable reader (`reliably`) or the best-effort one has. What the best-effort
    /// one has of a publisher is needed only while its numbers are far from those of the reliable one: a forged heartbeat can
    /// make that one wait for ever, or go on at a number of its own.
    fn takes(&mut self, publisher: PublisherId, number: i64, reliably: bool) -> bool {
        let heard = entry(&mut self.publishers, publisher);
        if reliably {
            heard.reliable = Some(number);
            return heard.taken.is_none_or(|taken| number > taken || !are_near(number, taken));
        }
        let takes = heard.reliable.is_none_or(|reliable| !are_near(number, reliable));
        if takes {
            heard.taken = Some(
                heard
                    .taken
                    .filter(|&taken| are_near(number, taken))
                    .map_or(number, |taken| taken.max(number)),
            );
        }
        takes
    }
}

/// What a publisher's numbers tell about scans that never arrived.
#[derive(Debug, Default)]
struct Gaps {
    newest: BTreeMap<PublisherId, Option<i64>>,
    /// Samples that arrived since the last good one and told no publisher: their numbers look like a gap.
    undecodable: u64,
}

impl Gaps {
    fn lost_before(&mut self, publisher: PublisherId, number: i64) -> u64 {
        let entry = entry(&mut self.newest, publisher);
        let newest = *entry.get_or_insert(number);
        let gap = number.saturating_sub(newest).saturating_sub(1).max(0);
        if number > newest || !are_near(number, newest) {
            *entry = Some(number);
        }
        gap.unsigned_abs().saturating_sub(std::mem::take(&mut self.undecodable))
    }
}

/// How a message lies to those that were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// After all of them.
    New,
    /// It was overtaken: it was lost on the way and sent again.
    Late,
    /// It is one of them.
    Known,
}

/// The messages that were taken of each publisher, where two readers have the same.
#[derive(Debug, Default)]
pub(super) struct Taken(BTreeMap<PublisherId, Option<Newest>>);

#[derive(Clone, Copy, Debug)]
struct Newest {
    number: i64,
    /// Which of the [`LATE`] numbers before were taken, or came before the first: the last bit is that of the one before.
    before: u128,
}

impl Taken {
    /// Whether anything was taken of a publisher.
    pub(super) fn knows(&self, publisher: PublisherId) -> bool {
        self.0.contains_key(&publisher)
    }

    /// Notes a message.
    pub(super) fn note(&mut self, publisher: PublisherId, number: i64) -> Order {
        let entry = entry(&mut self.0, publisher);
        let newest = entry.get_or_insert(Newest { number: number.saturating_sub(1), before: u128::MAX });
        if !are_near(number, newest.number) {
            *newest = Newest { number, before: 0 };
            return Order::New;
        }
        let ahead = number - newest.number;
        if ahead > 0 {
            let shifted = newest.before.checked_shl(ahead as u32).unwrap_or(0);
            *newest = Newest { number, before: shifted | 1 << (ahead - 1) };
            return Order::New;
        }
        let bit = if ahead == 0 { 0 } else { 1 << (-ahead - 1) };
        let is_known = bit == 0 || newest.before & bit != 0;
        newest.before |= bit;
        if is_known { Order::Known } else { Order::Late }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Publishers of different names.
    pub(in crate::node) fn publisher(number: u32) -> PublisherId {
        let mut name = [0; 16];
        name[..4].copy_from_slice(&number.to_le_bytes());
        name
    }

    /// A scan of this number that lacks its camera info.
    fn sample(publisher: PublisherId, number: i64) -> Sample {
        Sample { scan: Err(CloudError::NoCameraInfo), origin: Origin { publisher, number } }
    }

    /// A publisher of which an image came that lacks its camera info alone, so long ago.
    pub(in crate::node) fn came_before(silence: Duration) -> Known {
        Known { came: Instant::now().checked_sub(silence), ..Known::default() }
    }

    /// A camera info that comes more than ten seconds late must not have the driver pack PNGs for good.
    #[test]
    fn an_image_that_lacks_its_camera_info_alone_comes_and_one_that_is_bad_does_not() {
        for (error, comes) in [(CloudError::NoCameraInfo, true), (CloudError::EmptyFrameId, false)] {
            let mut known = Known::default();
            known.note(&Err(error.clone()));
            assert_eq!(known.comes(), comes, "{error}");
        }
    }

    #[test]
    fn of_a_form_that_is_taken_any_scan_says_that_it_is_not_silent() {
        let mut known = came_before(SILENT);
        assert!(!known.comes());
        known.note(&Err(CloudError::EmptyFrameId));
        assert!(known.comes());
    }

    #[test]
    fn ever_new_publishers_are_not_remembered_for_ever() {
        let (mut heard, mut gaps, mut taken) = (Heard::default(), Gaps::default(), Taken::default());
        for number in 0..10_000 {
            assert!(heard.takes(publisher(number), 1, false));
            assert_eq!(taken.note(publisher(number), 1), Order::New);
            assert_eq!(gaps.lost_before(publisher(number), i64::from(number)), 0);
            assert!(heard.publishers.len().max(gaps.newest.len()).max(taken.0.len()) <= PUBLISHERS);
        }
    }

    #[test]
    fn a_sample_is_taken_once_and_reliably_where_it_can_be() {
        let (mut heard, publisher) = (Heard::default(), PublisherId::default());
        assert!(heard.takes(publisher, 1, false));
        assert!(heard.takes(publisher, 2, false));
        assert!(!heard.takes(publisher, 1, true) && !heard.takes(publisher, 2, true));
        assert!(heard.takes(publisher, 3, true) && !heard.tells_garbled(false) && heard.tells_garbled(true));
        assert!(!heard.takes(publisher, 3, false) && !heard.takes(publisher, 4, false));
        assert!(heard.takes(publisher, 4, true));
    }

    #[test]
    fn a_made_up_number_by_best_effort_does_not_silence_the_reliable_publisher() {
        let (mut heard, publisher) = (Heard::default(), PublisherId::default());
        assert!(heard.takes(publisher, 1, false) && heard.takes(publisher, i64::MAX, false));
        assert!((2..500).all(|number| heard.takes(publisher, number, true)));
    }

    #[test]
    fn without_a_reliable_reader_every_sample_is_taken() {
        let (mut heard, publisher) = (Heard::default(), PublisherId::default());
        assert!([5, 7, 6].into_iter().all(|number| heard.takes(publisher, number, false)));
    }

    #[test]
    fn new_readers_are_not_held_against_a_reliable_one_that_is_gone() {
        let (mut known, publisher) = (Known::default(), PublisherId::default());
        let mut lost = |numbers: &[i64], reliably, begins_anew: bool| -> Vec<_> {
            if begins_anew {
                known.begin_anew();
            }
            let mut tell = |&number: &i64| {
                known.tell(Ok::<_, String>(sample(publisher, number)), reliably).map(|next| next.lost_before)
            };
            numbers.iter().map(&mut tell).collect()
        };
        assert_eq!(lost(&[1, 2, 3], true, false), [Some(0); 3]);
        assert_eq!(lost(&[3, 4], false, false), [None; 2]);
        assert_eq!(lost(&[4, 5], false, true), [Some(0); 2]);
        assert_eq!(lost(&[3, 5, 6], true, false), [None, None, Some(0)]);
        assert_eq!(lost(&[7], false, false), [None]);
    }

    #[test]
    fn what_was_sent_while_nobody_read_is_not_lost() {
        let mut known = Known::default();
        let mut lost = |number: i64, after_pause: bool| {
            if after_pause {
                known.begin_after_pause();
            }
            known.tell(Ok::<_, String>(sample(publisher(0), number)), false).unwrap().lost_before
        };
        assert_eq!(
            [(1, false), (3, false), (9000, true), (9002, false)].map(|(n, p)| lost(n, p)),
            [0, 1, 0, 1]
        );
    }

    #[test]
    fn after_the_network_was_joined_anew_a_sample_without_a_header_is_told_by_either_reader() {
        let mut heard = Heard::default();
        assert!(
            heard.takes(publisher(0), 1, true) && heard.tells_garbled(true) && !heard.tells_garbled(false)
        );
        heard.begin_anew();
        assert!(heard.tells_garbled(false));
    }

    #[test]
    fn made_up_numbers_neither_overflow_nor_hide_losses() {
        let mut gaps = Gaps::default();
        for number in [i64::MIN, i64::MAX, 0, -1, i64::MAX, i64::MIN, 0] {
            assert!(i64::try_from(gaps.lost_before(publisher(0), number)).is_ok());
        }
        gaps.lost_before(publisher(0), i64::MAX);
        gaps.lost_before(publisher(0), 1);
        assert_eq!(gaps.lost_before(publisher(0), 4), 2, "losses are counted again after one");
    }

    #[test]
    fn where_the_reliable_reader_is_silenced_the_other_is_heard_again() {
        let (mut heard, publisher) = (Heard::default(), PublisherId::default());
        assert!(heard.takes(publisher, 1, true));
        let taken = (2..500).filter(|&number| heard.takes(publisher, number, false)).count();
        assert_eq!(taken as i64, 498 - LATE, "it stays behind");
        assert!(!heard.takes(publisher, 450, true) && heard.takes(publisher, 500, true));
        assert!(!heard.takes(publisher, 501, false) && heard.takes(publisher, 501, true));
        assert!(heard.takes(publisher, 1 << 62, true));
        assert!((502..600).all(|number| heard.takes(publisher, number, false)), "it is elsewhere");
    }

    #[test]
    fn of_two_readers_of_a_topic_the_one_that_is_first_is_taken() {
        let (mut taken, publisher) = (Taken::default(), PublisherId::default());
        let mut notes = |numbers: &[i64]| -> Vec<_> {
            numbers.iter().map(|&number| taken.note(publisher, number)).collect()
        };
        assert_eq!(notes(&[4, 5, 7]), [Order::New; 3]);
        assert_eq!(notes(&[3, 4, 5, 7]), [Order::Known; 4]);
        assert_eq!(notes(&[6, 6, 8]), [Order::Late, Order::Known, Order::New]);
        assert_eq!(notes(&[i64::MAX, 9, 10, 10]), [Order::New, Order::New, Order::New, Order::Known]);
        assert_eq!(notes(&[8, 138, 10, 11]), [Order::Late, Order::New, Order::Known, Order::Late]);
        assert_eq!(notes(&[i64::MIN, i64::MAX]), [Order::New; 2]);
    }

    #[test]
    fn a_gap_in_the_numbers_is_a_loss_unless_garbled_samples_explain_it() {
        let (mut gaps, publisher) = (Gaps::default(), PublisherId::default());
        assert_eq!(gaps.lost_before(publisher, 7), 0);
        assert_eq!(gaps.lost_before(publisher, 8), 0);
        assert_eq!(gaps.lost_before(publisher, 11), 2);
        gaps.undecodable = 1;
        assert_eq!(gaps.lost_before(publisher, 14), 1);
        assert_eq!(gaps.lost_before(publisher, 13), 0);
        assert_eq!(gaps.lost_before(publisher, 15), 0);
        gaps.undecodable = 1;
        assert_eq!(gaps.lost_before(publisher, 16), 0);
        assert_eq!(gaps.lost_before(publisher, 18), 1);
    }
}
