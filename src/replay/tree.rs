//! What the transforms of a bag say about how frames hang together, those that were refused for their numbers included.
//!
//! For a name of the fixed frame alone: where a frame is at a time, [`Frames`](crate::tf::Frames) knows. Nothing is forgotten
//! here when time jumps back, and of several parents the newest counts. A link has a place here by the rule that holds there, so
//! that none leads in a circle.

use std::collections::BTreeMap;

use crate::msg::ros::TransformStamped;
use crate::tf::{FrameError, MAX_DEPTH, MAX_FRAMES, check, check_place};

/// The links between frames, each under the name of its child.
#[derive(Debug, Default)]
pub(super) struct Tree {
    links: BTreeMap<String, Link>,
    /// The parents of frames of which every link was refused for its numbers: it is known below what they hang, and not at which
    /// place.
    refused: BTreeMap<String, String>,
}

#[derive(Debug)]
struct Link {
    parent: String,
    /// Whether it is one of those that change.
    moves: bool,
}

impl Tree {
    /// The tree of all of these transforms, each with whether it is static.
    pub(super) fn of(transforms: impl Iterator<Item = (TransformStamped, bool)>) -> Self {
        let mut tree = Self::default();
        transforms.for_each(|(transform, is_static)| tree.note(&transform, is_static));
        tree
    }

    /// Notes a transform, whatever the tree of [`Frames`](crate::tf::Frames) makes of it.
    pub(super) fn note(&mut self, transform: &TransformStamped, is_static: bool) {
        let (parent, child) = (transform.header.frame_id.as_str(), transform.child_frame_id.as_str());
        let has_room = self.links.len() + self.refused.len() < MAX_FRAMES;
        let checked = check(transform, is_static).and_then(|()| self.check_place(parent, child));
        let known = self.links.get_mut(child);
        match (checked, known) {
            (Ok(()), Some(link)) => {
                link.moves = !is_static;
                if link.parent != parent {
                    parent.clone_into(&mut link.parent);
                }
            }
            (Ok(()), None) if has_room => {
                self.refused.remove(child);
                let link = Link { parent: parent.to_owned(), moves: !is_static };
                self.links.insert(child.to_owned(), link);
            }
            (Err(error), None) if is_about_numbers(&error) && has_room => {
                self.refused.insert(child.to_owned(), parent.to_owned());
            }
            _ => {}
        }
    }

    fn check_place(&self, parent: &str, child: &str) -> Result<(), FrameError> {
        let above = |frame: &str| self.links.get(frame).map(|link| link.parent.as_str());
        if above(child) == Some(parent) { Ok(()) } else { check_place(parent, child, above) }
    }

    /// Whether no transform has named any frame.
    pub(super) fn is_empty(&self) -> bool {
        self.links.is_empty() && self.refused.is_empty()
    }

    /// Whether a transform has named a frame.
    pub(super) fn has(&self, frame: &str) -> bool {
        let mut parents = self.links.values().map(|link| &link.parent).chain(self.refused.values());
        self.links.contains_key(frame) || self.refused.contains_key(frame) || parents.any(|it| it == frame)
    }

    /// The links from a frame up, no more than are followed where scans are placed.
    fn way(&self, frame: &str) -> impl Iterator<Item = &Link> {
        let up = |link: &&Link| self.links.get(&link.parent);
        std::iter::successors(self.links.get(frame), up).take(MAX_DEPTH)
    }

    /// The topmost frame above one, or itself.
    pub(super) fn top<'a>(&'a self, frame: &'a str) -> &'a str {
        self.way(frame).last().map_or(frame, |link| &link.parent)
    }

    /// Whether a frame moves in its topmost one.
    pub(super) fn moves(&self, frame: &str) -> bool {
        self.way(frame).any(|link| link.moves)
    }

    /// Where nothing moves a frame in its topmost one, and the link above that was refused: what lies above that link. The
    /// frame may move there, so that a map must not be made below.
    pub(super) fn beyond<'a>(&'a self, frame: &'a str) -> Option<&'a str> {
        let parent = self.refused.get(self.top(frame)).filter(|_| !self.moves(frame))?;
        Some(self.top(parent))
    }

    /// The root of the tree that a frame is in, refused links included where they matter; `None` where nothing names it.
    pub(super) fn root_of<'a>(&'a self, frame: &'a str) -> Option<&'a str> {
        self.has(frame).then(|| self.beyond(frame).unwrap_or_else(|| self.top(frame)))
    }

    /// The root of some frame.
    pub(super) fn any_root(&self) -> Option<&str> {
        self.links.keys().chain(self.refused.keys()).next().and_then(|frame| self.root_of(frame))
    }
}

/// Whether a transform with good names was refused.
const fn is_about_numbers(error: &FrameError) -> bool {
    matches!(error, FrameError::NonFinite { .. } | FrameError::BadNorm { .. } | FrameError::BadStamp { .. })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::msg::ros::Header;

    /// Links as parent and child: those that change, those that are static, and those whose rotation is none.
    pub(in crate::replay) fn tree(moving: &[&str], still: &[&str], refused: &[&str]) -> Tree {
        let transform = |pair: &str| {
            let (parent, child) = pair.split_once(' ').unwrap();
            TransformStamped {
                header: Header { frame_id: parent.to_owned(), ..Header::default() },
                child_frame_id: child.to_owned(),
                ..TransformStamped::default()
            }
        };
        let bad = |pair: &str| {
            let mut transform = transform(pair);
            transform.transform.rotation.w = 0.0;
            transform
        };
        let moving = moving.iter().map(|pair| (transform(pair), false));
        let still = still.iter().map(|pair| (transform(pair), true));
        Tree::of(moving.chain(still).chain(refused.iter().map(|pair| (bad(pair), false))))
    }

    #[test]
    fn a_refused_link_matters_where_nothing_below_it_moves() {
        let refused = &["map odom"];
        assert_eq!(tree(&[], &["odom base", "base camera"], refused).root_of("camera"), Some("map"));
        assert_eq!(tree(&["odom base"], &["base camera"], refused).root_of("camera"), Some("odom"));
        assert_eq!(tree(&["map odom"], &["odom camera"], refused).root_of("camera"), Some("map"));
        assert_eq!(tree(&["world map"], &[], refused).root_of("odom"), Some("world"));
        assert_eq!(tree(&[], &[], refused).root_of("camera"), None);
    }

    #[test]
    fn a_link_that_was_refused_once_and_is_good_now_counts_as_good_and_the_other_way_round() {
        for is_bad_first in [true, false] {
            let [bad, good] = [tree(&[], &[], &["map base"]), tree(&["map base"], &[], &[])];
            assert_eq!((bad.beyond("base"), good.beyond("base")), (Some("map"), None));
            let mut both = if is_bad_first { bad } else { good };
            let mut transform = TransformStamped::default();
            (transform.header.frame_id, transform.child_frame_id) = ("map".to_owned(), "base".to_owned());
            transform.transform.rotation.w = f64::from(u8::from(is_bad_first));
            both.note(&transform, false);
            assert_eq!(
                (both.beyond("base"), both.root_of("base"), both.moves("base")),
                (None, Some("map"), true)
            );
        }
    }

    #[test]
    fn a_link_that_closes_a_circle_is_none_and_the_root_stays() {
        let root_of_camera = |links: &[&str]| tree(links, &[], &[]).root_of("camera").map(str::to_owned);
        for loops in
            [&["base camera", "map base", "camera map"][..], &["base camera", "map base", "base map"]]
        {
            assert_eq!(root_of_camera(loops).as_deref(), Some("map"), "{loops:?}");
        }
        // As where scans are placed, what has come first stands.
        assert_eq!(root_of_camera(&["base camera", "base map", "map base"]).as_deref(), Some("base"));
        // A frame that changes its parent makes a place for what was under it.
        let turned = tree(&["a b", "x b", "b a"], &[], &[]);
        assert_eq!((turned.root_of("a"), turned.root_of("b")), (Some("x"), Some("x")));
    }

    #[test]
    fn no_chain_is_followed_without_end_and_of_ever_new_names_no_more_are_kept() {
        let names: Vec<_> = (0..MAX_DEPTH + 10).map(|i| format!("f{} f{i}", i + 1)).collect();
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        assert_eq!(tree(&names, &[], &[]).root_of("f0"), Some(format!("f{MAX_DEPTH}").as_str()));
        let names: Vec<_> = (0..MAX_FRAMES + 10).map(|i| format!("odom f{i}")).collect();
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        let many = tree(&names[..MAX_FRAMES / 2], &[], &names[MAX_FRAMES / 2..]);
        assert_eq!(many.links.len() + many.refused.len(), MAX_FRAMES);
    }
}
