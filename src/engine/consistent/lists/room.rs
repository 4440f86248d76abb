//! Lists that keep little room to spare.

/// Puts an item into a list. Room is made by quarters: by doubling, a third of it would lie idle.
pub(crate) fn insert<T>(list: &mut Vec<T>, place: usize, item: T) {
    if list.len() == list.capacity() {
        list.reserve_exact((list.len() / 4).max(8));
    }
    list.insert(place, item);
}

/// Gives back most of the room of a list that has become much shorter than it was. As much as it takes is left for what comes.
pub(crate) fn shrink<T>(list: &mut Vec<T>) {
    if list.len() < list.capacity() / 4 {
        list.shrink_to(2 * list.len());
    }
}
