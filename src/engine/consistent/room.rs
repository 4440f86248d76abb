//! Lists that keep little room to spare.

/// Puts an item into a list. Room is made by quarters: by doubling, a third of it would lie idle.
pub(super) fn insert<T>(list: &mut Vec<T>, place: usize, item: T) {
    if list.len() == list.capacity() {
        list.reserve_exact((list.len() / 4).max(8));
    }
    list.insert(place, item);
}
