//! A bounded choice among values that go by, of which nobody knows how many there will be.
//!
//! Kept are the multiples of a stride, which doubles whenever they are too many: always at least half of `most` values,
//! evenly spread, the first one among them. What is kept depends on the number of values alone.

#[derive(Clone, Debug)]
pub(super) struct Thinned<T> {
    most: usize,
    stride: u64,
    /// By ascending index.
    kept: Vec<(u64, T)>,
}

impl<T> Thinned<T> {
    /// Keeps at most `most` values, 2 or more.
    pub(super) fn new(most: usize) -> Self {
        Self { most: most.max(2), stride: 1, kept: Vec::new() }
    }

    /// Offers the value of `index`, which counts up from 0; it is made only where it is kept.
    pub(super) fn offer(&mut self, index: u64, value: impl FnOnce() -> Option<T>) {
        if !index.is_multiple_of(self.stride) {
            return;
        }
        if self.kept.len() == self.most {
            self.stride *= 2;
            let stride = self.stride;
            self.kept.retain(|(index, _)| index.is_multiple_of(stride));
            if !index.is_multiple_of(stride) {
                return;
            }
        }
        self.kept.extend(value().map(|value| (index, value)));
    }

    /// Of `count` values: the first and those kept next to a third and to two thirds of the way to the last; the last
    /// one is not among them, and none is there twice.
    pub(super) fn between(self, count: u64) -> Vec<T> {
        let last = count.saturating_sub(1);
        let mut chosen: Vec<usize> =
            (0..3).filter_map(|third| self.nearest(last * third / 3, last)).collect();
        chosen.dedup();
        let is_chosen = |(place, (_, value))| chosen.contains(&place).then_some(value);
        self.kept.into_iter().enumerate().filter_map(is_chosen).collect()
    }

    /// The place of the value kept next to `wanted`, of those before `end`.
    fn nearest(&self, wanted: u64, end: u64) -> Option<usize> {
        let before = self.kept.iter().enumerate().filter(|(_, (index, _))| *index < end);
        before.min_by_key(|(_, (index, _))| index.abs_diff(wanted)).map(|(place, _)| place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(most: usize, count: u64) -> Thinned<u64> {
        let mut thinned = Thinned::new(most);
        (0..count).for_each(|index| thinned.offer(index, || Some(index)));
        thinned
    }

    fn kept(most: usize, count: u64) -> Vec<u64> {
        thinned(most, count).kept.into_iter().map(|(_, value)| value).collect()
    }

    #[test]
    fn the_stride_doubles_when_the_values_are_too_many() {
        assert_eq!(kept(4, 4), [0, 1, 2, 3]);
        assert_eq!(kept(4, 5), [0, 2, 4]);
        assert_eq!(kept(4, 8), [0, 2, 4, 6]);
        assert_eq!(kept(4, 9), [0, 4, 8]);
        for count in 5..500 {
            assert!((2..=4).contains(&kept(4, count).len()), "{count}");
        }
    }

    #[test]
    fn four_moments_are_the_first_the_thirds_and_the_last_which_is_not_kept_here() {
        assert_eq!(thinned(12, 10).between(10), [0, 3, 6]);
        assert_eq!(thinned(12, 100).between(100), [0, 32, 64]);
        assert_eq!(thinned(12, 6511).between(6511), [0, 2048, 4096]);
    }

    #[test]
    fn of_fewer_than_four_values_each_is_there_once() {
        assert_eq!(thinned(12, 0).between(0), [0; 0]);
        assert_eq!(thinned(12, 1).between(1), [0; 0]);
        assert_eq!(thinned(12, 2).between(2), [0]);
        assert_eq!(thinned(12, 3).between(3), [0, 1]);
        assert_eq!(thinned(12, 4).between(4), [0, 1, 2]);
    }

    #[test]
    fn a_value_that_is_not_kept_is_not_made() {
        let (mut thinned, mut made) = (Thinned::new(4), 0);
        for index in 0..1000 {
            thinned.offer(index, || {
                made += 1;
                Some(index)
            });
        }
        assert!(made < 30, "{made}");
    }
}
