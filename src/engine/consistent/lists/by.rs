//! Lists whose places are named by a type of their own: a node is no place in a list of blocks.

use std::marker::PhantomData;
use std::ops::{Deref, Index, IndexMut};

/// A number that names a place in a list.
pub(crate) trait Place: Copy {
    /// The name of a place.
    fn at(place: usize) -> Self;

    fn place(self) -> usize;
}

/// A `Vec<T>` indexed by `I`.
#[derive(Clone, Debug)]
pub(crate) struct By<I, T> {
    list: Vec<T>,
    by: PhantomData<I>,
}

impl<I: Place, T> By<I, T> {
    pub(crate) const fn new() -> Self {
        Self { list: Vec::new(), by: PhantomData }
    }

    /// `None` beyond the end of the list.
    pub(crate) fn get(&self, at: I) -> Option<&T> {
        self.list.get(at.place())
    }

    /// All items with their names, in the order of their places.
    pub(crate) fn each(&self) -> impl Iterator<Item = (I, &T)> {
        self.list.iter().enumerate().map(|(place, item)| (I::at(place), item))
    }

    /// The item at `at`; a list that is too short is first filled up with defaults.
    pub(crate) fn grow_to(&mut self, at: I) -> &mut T
    where
        T: Default,
    {
        if self.list.len() <= at.place() {
            self.list.resize_with(at.place() + 1, T::default);
        }
        &mut self.list[at.place()]
    }

    pub(crate) fn push(&mut self, item: T) {
        self.list.push(item);
    }

    /// Fills the list up with defaults, or cuts it off.
    pub(crate) fn set_len(&mut self, len: usize)
    where
        T: Default,
    {
        self.list.resize_with(len, T::default);
    }
}

impl<I, T> FromIterator<T> for By<I, T> {
    fn from_iter<L: IntoIterator<Item = T>>(items: L) -> Self {
        Self { list: items.into_iter().collect(), by: PhantomData }
    }
}

impl<I: Place, T> Default for By<I, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<I: Place, T> Index<I> for By<I, T> {
    type Output = T;

    fn index(&self, at: I) -> &T {
        &self.list[at.place()]
    }
}

impl<I: Place, T> IndexMut<I> for By<I, T> {
    fn index_mut(&mut self, at: I) -> &mut T {
        &mut self.list[at.place()]
    }
}

/// All items, in the order of their places.
impl<I, T> Deref for By<I, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::graph::NodeId;

    #[test]
    fn a_list_reaches_as_far_as_it_is_asked_to_and_no_further() {
        let mut by = By::<NodeId, u8>::default();
        assert_eq!(by.get(NodeId(0)), None);
        *by.grow_to(NodeId(2)) = 7;
        by[NodeId(0)] = 5;
        assert_eq!((by.to_vec(), by.get(NodeId(3))), (vec![5, 0, 7], None));
        *by.grow_to(NodeId(1)) += 1;
        assert_eq!(by.to_vec(), [5, 1, 7]);
        assert!(by.each().eq([(NodeId(0), &5), (NodeId(1), &1), (NodeId(2), &7)]));
    }
}
