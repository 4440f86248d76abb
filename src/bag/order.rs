//! In which order files are read that lie in one folder and nothing lists.

use super::bag_file::BagFile;
use super::survey::times;

/// Where files were recorded side by side, as one of clouds and one of transforms, has them read in the order of their first
/// messages, each from when its time has come; says whether it is so. They stay as they are where one does not tell its times,
/// and where each ends before another begins.
pub(super) fn side_by_side(files: &mut [BagFile]) -> bool {
    let times: Option<Vec<_>> = files.iter().map(times).collect();
    let Some(times) = times.filter(|times| overlap(times)) else { return false };
    for (bag_file, (begins, _)) in files.iter_mut().zip(times) {
        bag_file.begins = Some(begins);
    }
    files.sort_by_key(|bag_file| bag_file.begins);
    true
}

/// Whether of some times, from the first to the last message, one begins before another has ended. What has no message has 0.
fn overlap(times: &[(u64, u64)]) -> bool {
    let mut times: Vec<_> = times.iter().filter(|(_, ends)| *ends > 0).collect();
    times.sort_unstable();
    // The first that begins before one of those before it has ended begins before the one next to it has.
    times.windows(2).any(|next| next[1].0 < next[0].1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_overlap_where_one_begins_before_another_has_ended() {
        for (times, is_so) in [
            (&[][..], false),
            (&[(5, 9)], false),
            (&[(5, 9), (10, 12), (0, 4)], false),
            (&[(5, 9), (9, 12)], false),
            (&[(0, 0), (0, 0), (5, 9)], false),
            (&[(5, 9), (0, 6)], true),
            (&[(0, 1), (2, 9), (3, 4)], true),
        ] {
            assert_eq!(overlap(times), is_so, "{times:?}");
        }
    }
}
