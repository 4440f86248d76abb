//! Lists like [`By`](super::by::By) whose copies share what neither has changed.
//!
//! A list is kept in pages of [`PAGE`] items. A copy of it shares them, and each of the two has a page for itself from the first
//! change that it makes there. So a copy of a list of a map costs a pointer for each page, whatever the items hold, and what goes
//! on changing pays for what it changes. No page ever moves either: a list that grows does not pause to copy itself, but for the
//! pointers.

use std::array;
use std::marker::PhantomData;
use std::ops::{Index, IndexMut};
use std::sync::Arc;

use super::by::Place;
use super::room;

/// Items that are shared, and copied, together.
const PAGE: usize = 16;

/// A copy-on-write `Vec<T>` indexed by `I`, in pages of [`PAGE`].
#[derive(Clone, Debug)]
pub(crate) struct Shared<I, T> {
    /// Beyond the end of the list the last one holds default items.
    pages: Vec<Arc<[T; PAGE]>>,
    len: usize,
    names: PhantomData<I>,
}

impl<I, T> Shared<I, T> {
    pub(crate) const fn new() -> Self {
        Self { pages: Vec::new(), len: 0, names: PhantomData }
    }

    pub(crate) const fn len(&self) -> usize {
        self.len
    }

    /// What part of the pages is shared with another list, at the same places.
    #[cfg(test)]
    pub(crate) fn shared_with(&self, other: &Self) -> f64 {
        let shared = self.pages.iter().zip(&other.pages).filter(|(a, b)| Arc::ptr_eq(a, b));
        shared.count() as f64 / self.pages.len() as f64
    }

    /// The places of each page that is not shared with another list.
    #[cfg(test)]
    pub(crate) fn copied_since(&self, other: &Self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let pages = self.pages.iter().zip(&other.pages).enumerate();
        pages.filter(|(_, (a, b))| !Arc::ptr_eq(a, b)).map(|(page, _)| page * PAGE..(page + 1) * PAGE)
    }

    /// All items, in the order of their places.
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = &T> {
        (0..self.len).map(|place| &self.pages[place / PAGE][place % PAGE])
    }
}

impl<I: Place, T> Shared<I, T> {
    /// `None` beyond the end of the list.
    pub(crate) fn get(&self, at: I) -> Option<&T> {
        (at.place() < self.len).then(|| &self[at])
    }

    /// All items with their names, in the order of their places.
    pub(crate) fn each(&self) -> impl Iterator<Item = (I, &T)> {
        self.iter().enumerate().map(|(place, item)| (I::at(place), item))
    }
}

impl<I, T: Clone + Default> Shared<I, T> {
    pub(crate) fn push(&mut self, item: T) {
        let place = self.len;
        self.set_len(place + 1);
        *self.at(place) = item;
    }

    /// Fills the list up with defaults, or cuts it off; one that has become much shorter than it was gives most of its room back.
    pub(crate) fn set_len(&mut self, len: usize) {
        let pages = len.div_ceil(PAGE);
        let cut_off = len..self.len.min(pages * PAGE);
        self.pages.resize_with(pages, || Arc::new(array::from_fn(|_| T::default())));
        cut_off.for_each(|place| *self.at(place) = T::default());
        self.len = len;
        room::shrink(&mut self.pages);
    }

    fn at(&mut self, place: usize) -> &mut T {
        &mut Arc::make_mut(&mut self.pages[place / PAGE])[place % PAGE]
    }
}

impl<I: Place, T: Clone + Default> Shared<I, T> {
    /// The item at `at`; a list that is too short is first filled up with defaults.
    pub(crate) fn grow_to(&mut self, at: I) -> &mut T {
        if self.len <= at.place() {
            self.set_len(at.place() + 1);
        }
        self.at(at.place())
    }

    pub(crate) fn take(&mut self, at: I) -> T {
        std::mem::take(&mut self[at])
    }

    pub(crate) fn swap(&mut self, a: I, b: I) {
        let (first, second) = (self.take(a), self.take(b));
        self[a] = second;
        // Last, for `b` may be `a`.
        self[b] = first;
    }
}

impl<I, T: Clone + Default> FromIterator<T> for Shared<I, T> {
    fn from_iter<L: IntoIterator<Item = T>>(items: L) -> Self {
        let mut list = Self::new();
        items.into_iter().for_each(|item| list.push(item));
        list
    }
}

impl<I, T> Default for Shared<I, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<I: Place, T> Index<I> for Shared<I, T> {
    type Output = T;

    fn index(&self, at: I) -> &T {
        assert!(at.place() < self.len, "place {} of {}", at.place(), self.len);
        &self.pages[at.place() / PAGE][at.place() % PAGE]
    }
}

impl<I: Place, T: Clone + Default> IndexMut<I> for Shared<I, T> {
    fn index_mut(&mut self, at: I) -> &mut T {
        assert!(at.place() < self.len, "place {} of {}", at.place(), self.len);
        self.at(at.place())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::engine::consistent::graph::NodeId;

    fn all<T: Clone>(list: &Shared<NodeId, T>) -> Vec<T> {
        list.iter().cloned().collect()
    }

    #[test]
    fn a_list_reaches_as_far_as_it_is_asked_to_and_no_further() {
        let mut list = Shared::<NodeId, u8>::default();
        assert_eq!(list.get(NodeId(0)), None);
        *list.grow_to(NodeId(2)) = 7;
        list[NodeId(0)] = 5;
        assert_eq!((all(&list), list.get(NodeId(3))), (vec![5, 0, 7], None));
        *list.grow_to(NodeId(1)) += 1;
        assert_eq!(all(&list), [5, 1, 7]);
        assert!(list.each().eq([(NodeId(0), &5), (NodeId(1), &1), (NodeId(2), &7)]));
    }

    #[test]
    fn a_list_that_has_become_much_shorter_gives_its_room_back() {
        let mut list: Shared<NodeId, u8> = (0..250).cycle().take(1000 * PAGE).collect();
        list.set_len(100 * PAGE);
        assert!(list.pages.len() == 100 && list.pages.capacity() < 250, "{}", list.pages.capacity());
    }

    #[test]
    fn a_copy_shares_all_pages_but_those_that_were_changed_since() {
        let mut list: Shared<NodeId, usize> = (0..10 * PAGE).collect();
        let copy = list.clone();
        list[NodeId(0)] = 7;
        list[NodeId(1)] = 8;
        assert_eq!(list.shared_with(&copy), 0.9);
    }

    #[test]
    fn what_is_swapped_with_itself_stays() {
        let mut list: Shared<NodeId, u8> = (1..3).collect();
        list.swap(NodeId(0), NodeId(0));
        assert_eq!(all(&list), [1, 2]);
    }

    #[test]
    #[should_panic(expected = "place 3 of 3")]
    fn there_is_nothing_beyond_the_end_though_its_page_goes_on() {
        let list: Shared<NodeId, u8> = (0..3).collect();
        println!("{}", list[NodeId(3)]);
    }

    #[derive(Clone, Debug)]
    enum Change {
        Push(u8),
        SetLen(usize),
        Reach(u32, u8),
        Set(usize, u8),
        Swap(usize, usize),
        Copy,
    }

    fn change() -> impl Strategy<Value = Change> {
        prop_oneof![
            4 => any::<u8>().prop_map(Change::Push),
            1 => (0..5 * PAGE).prop_map(Change::SetLen),
            1 => (0..5 * PAGE as u32, any::<u8>()).prop_map(|(at, item)| Change::Reach(at, item)),
            4 => any::<(usize, u8)>().prop_map(|(at, item)| Change::Set(at, item)),
            2 => any::<(usize, usize)>().prop_map(|(a, b)| Change::Swap(a, b)),
            1 => Just(Change::Copy),
        ]
    }

    proptest! {
        #[test]
        fn a_list_and_its_copies_are_what_plain_vectors_are(changes in prop::collection::vec(change(), 0..200)) {
            let (mut list, mut plain) = (Shared::<NodeId, u8>::new(), Vec::new());
            let mut copies = Vec::new();
            for change in changes {
                let node = |at: usize| NodeId((at % plain.len().max(1)) as u32);
                match change {
                    Change::Push(item) => {
                        list.push(item);
                        plain.push(item);
                    }
                    Change::SetLen(len) => {
                        list.set_len(len);
                        plain.resize(len, 0);
                    }
                    Change::Reach(at, item) => {
                        plain.resize(plain.len().max(at as usize + 1), 0);
                        plain[at as usize] = item;
                        *list.grow_to(NodeId(at)) = item;
                    }
                    Change::Set(at, item) if !plain.is_empty() => {
                        let at = node(at);
                        (list[at], plain[at.place()]) = (item, item);
                    }
                    Change::Swap(a, b) if !plain.is_empty() => {
                        let [a, b] = [a, b].map(node);
                        list.swap(a, b);
                        plain.swap(a.place(), b.place());
                    }
                    Change::Set(..) | Change::Swap(..) => {}
                    Change::Copy => copies.push((list.clone(), plain.clone())),
                }
                prop_assert_eq!(list.len(), plain.len());
                prop_assert_eq!(all(&list), &plain[..]);
            }
            for (copy, plain) in copies {
                prop_assert_eq!(all(&copy), plain);
            }
        }
    }
}
