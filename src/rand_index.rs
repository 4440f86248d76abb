//! How far two clusterings agree: the adjusted Rand index (Hubert and Arabie, 1985).

use std::collections::BTreeMap;

/// The adjusted Rand index of two labellings of the same items: 1 = the same partition, about 0 = by chance.
///
/// `pairs` holds the two labels of each item. With fewer than two items, or where both labellings are trivial in the
/// same way, the index is 1.
pub fn adjusted_rand_index<A: Ord + Copy, B: Ord + Copy>(pairs: &[(A, B)]) -> f64 {
    let couples = |n: u64| (n * n.saturating_sub(1) / 2) as f64;
    let all = couples(pairs.len() as u64);
    let together: f64 = counts(pairs.iter().copied()).map(couples).sum();
    let first: f64 = counts(pairs.iter().map(|pair| pair.0)).map(couples).sum();
    let second: f64 = counts(pairs.iter().map(|pair| pair.1)).map(couples).sum();
    let by_chance = if all > 0.0 { first * second / all } else { 0.0 };
    let most = f64::midpoint(first, second);
    if most > by_chance { (together - by_chance) / (most - by_chance) } else { 1.0 }
}

fn counts<T: Ord>(labels: impl Iterator<Item = T>) -> impl Iterator<Item = u64> {
    let mut counts = BTreeMap::new();
    for label in labels {
        *counts.entry(label).or_default() += 1;
    }
    counts.into_values()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_matter_and_chance_gives_about_zero() {
        let same = [(1, 'b'), (1, 'b'), (2, 'a'), (2, 'a'), (3, 'c')];
        assert!((adjusted_rand_index(&same) - 1.0).abs() < 1e-12);
        // Worked by hand: couples 2 together of 15, rows 2 x 3, columns 3 x 2.
        let mixed = [(0, 0), (0, 0), (0, 1), (1, 1), (1, 2), (1, 2)];
        let expected = (2.0 - 6.0 * 3.0 / 15.0) / (4.5 - 6.0 * 3.0 / 15.0);
        assert!((adjusted_rand_index(&mixed) - expected).abs() < 1e-12);
        let independent: Vec<_> = (0..3000).map(|i| (i % 3, i / 3 % 5)).collect();
        assert!(adjusted_rand_index(&independent).abs() < 1e-2);
    }

    #[test]
    fn trivial_labellings_agree() {
        assert_eq!(adjusted_rand_index::<u8, u8>(&[]), 1.0);
        assert_eq!(adjusted_rand_index(&[(1, 2)]), 1.0);
        assert_eq!(adjusted_rand_index(&[(1, 2), (1, 2)]), 1.0);
    }
}
