//! The story against the snapshots it was told, and the page against what a bag may hold.

use std::collections::BTreeMap;

use nalgebra::Point3;
use proptest::prelude::*;

use super::moment::{Look, Moment};
use super::page::escaped;
use super::row::row;
use super::{Facts, Figure, MOMENTS, Story, Taken, write_report};
use crate::cloud::CloudError;
use crate::engine::{ClusterId, Engine, Isometry3, Params, Points, Scan, Snapshot, Stamp, VoxelKey};
use crate::reason::Reason;
use crate::tf::{FrameError, Lack, LookupError};

/// A scan of a square metre of floor and the wall beside it; each one further along +x.
fn scan(number: u32) -> Scan {
    let ahead = f64::from(number) * 0.24;
    let floor = (0..10_000).map(|i| [(i % 100) as f32 * 0.01, (i / 100) as f32 * 0.01, -1.0]);
    let wall = (0..5_000).map(|i| [(i % 100) as f32 * 0.01, 1.3, (i / 100) as f32 * 0.01 - 0.7]);
    Scan {
        stamp: Stamp::from_nanos(i64::from(number) * 33_000_000),
        fixed_from_sensor: Isometry3::translation(ahead, 0.0, 1.0),
        points: Points::F32(floor.chain(wall).collect()),
    }
}

/// Takes scans through an engine as a replay does.
fn tell(story: &mut Story, engine: &mut Engine, scans: impl Iterator<Item = u32>) {
    for number in scans {
        let scan = scan(number);
        let update = engine.insert(&scan);
        let sensor = scan.sensor_origin();
        let (points, dense) = (scan.points.len() as u64, engine.dense_count() as u64);
        story.scan(&update, &Taken { points, dense, engine_ms: 0.25, sensor });
        if story.wants_moment() {
            story.moment(&engine.snapshot());
        }
    }
}

fn whole_story(bound: usize, scans: u32) -> (Story, Snapshot) {
    let (mut story, mut engine) = (Story::of_moments(bound), Engine::new(Params::paper()));
    tell(&mut story, &mut engine, 0..scans);
    story.finish(&engine.snapshot());
    (story, engine.snapshot())
}

/// What is shown of a map: voxels by key, clusters by id.
type Shown = (BTreeMap<VoxelKey, Look>, BTreeMap<ClusterId, Box<str>>);

fn shown(snapshot: &Snapshot) -> Shown {
    let voxels = snapshot.voxels.iter().map(|voxel| (voxel.key, Look::from(voxel)));
    let clusters = snapshot.clusters.iter().map(|cluster| (cluster.id, row(&cluster.into())));
    (voxels.collect(), clusters.collect())
}

/// The map at each moment, put together from the changes.
fn replayed(story: &Story) -> Vec<Shown> {
    let mut now = Shown::default();
    let apply = |moment: &Moment| {
        for (&number, look) in &moment.voxels {
            let key = story.latest.keys[number as usize];
            if let Some(look) = look {
                now.0.insert(key, *look)
            } else {
                now.0.remove(&key)
            };
        }
        for (&id, row) in &moment.clusters {
            if let Some(row) = row {
                now.1.insert(id, row.clone())
            } else {
                now.1.remove(&id)
            };
        }
        now.clone()
    };
    story.moments.iter().map(apply).collect()
}

fn page(story: &Story, facts: &Facts) -> String {
    let mut bytes = Vec::new();
    write_report(&mut bytes, story, facts).unwrap();
    String::from_utf8(bytes).unwrap()
}

/// The JSON that the viewer reads.
fn data(page: &str) -> serde_json::Value {
    let (_, after) = page.split_once("<script type=\"application/json\" id=\"story\">").unwrap();
    serde_json::from_str(after.split_once("</script>").unwrap().0).unwrap()
}

fn scans_of(story: &Story) -> Vec<u64> {
    story.moments.iter().map(|moment| moment.scan).collect()
}

#[test]
fn a_short_story_has_every_scan_and_a_long_one_every_second_fourth_and_so_on() {
    assert_eq!(scans_of(&whole_story(4, 4).0), [1, 2, 3, 4]);
    assert_eq!(scans_of(&whole_story(4, 5).0), [1, 3, 5]);
    // The eighth is the end, and one too many.
    assert_eq!(scans_of(&whole_story(4, 8).0), [1, 5, 8]);
    assert_eq!(scans_of(&whole_story(4, 17).0), [1, 9, 17]);
}

#[test]
fn moments_stay_within_their_bound_and_the_last_state_is_among_them() {
    for scans in 1..=40 {
        let (story, _) = whole_story(6, scans);
        assert!(story.moments.len() <= 6, "{scans} scans: {} moments", story.moments.len());
        assert_eq!(scans_of(&story).last(), Some(&u64::from(scans)));
    }
}

#[test]
fn a_moment_is_wanted_once_a_scan_and_not_before_the_first() {
    let (mut story, mut engine) = (Story::new(), Engine::new(Params::paper()));
    assert!(!story.wants_moment());
    tell(&mut story, &mut engine, 0..1);
    assert!(!story.wants_moment());
}

#[test]
fn the_changes_put_together_are_the_snapshots() {
    let (mut story, mut engine) = (Story::of_moments(4), Engine::new(Params::paper()));
    let mut snapshots = BTreeMap::new();
    for number in 0..23 {
        tell(&mut story, &mut engine, number..=number);
        snapshots.insert(u64::from(number) + 1, shown(&engine.snapshot()));
    }
    story.finish(&engine.snapshot());
    let expected: Vec<_> = scans_of(&story).iter().map(|scan| snapshots[scan].clone()).collect();
    assert!(expected.len() > 2 && replayed(&story) == expected);
}

#[test]
fn a_moment_holds_only_what_differs_from_the_one_before() {
    let (mut story, engine) = (Story::new(), &mut Engine::new(Params::paper()));
    tell(&mut story, engine, 0..2);
    let dense = engine.snapshot().voxels.len();
    assert!(story.moments[1].voxels.len() < dense / 2, "{} of {dense}", story.moments[1].voxels.len());
    // The same map after another scan: nothing to tell.
    let update = engine.insert(&Scan { points: Points::F32(Vec::new()), ..scan(2) });
    let dense = engine.dense_count() as u64;
    story.scan(&update, &Taken { points: 0, dense, engine_ms: 0.0, sensor: Point3::origin() });
    story.moment(&engine.snapshot());
    assert!(story.moments[2].voxels.is_empty() && story.moments[2].clusters.is_empty());
}

#[test]
fn voxels_that_were_forgotten_are_counted_no_longer() {
    let params = Params::default().with_max_voxels(200).unwrap();
    let (mut story, mut engine) = (Story::of_moments(2), Engine::new(params));
    tell(&mut story, &mut engine, 0..8);
    assert!(story.moments.iter().all(|moment| moment.scan < 8), "the newest scan is between two moments");
    let (last, dense) = (story.series.columns.last().unwrap(), engine.snapshot().voxels.len() as u64);
    assert!(dense > 0 && story.series.total().unwrap().newly_dense > dense);
    assert_eq!(last.dense, dense);
}

#[test]
fn the_numbers_of_a_scan_agree_with_the_snapshot() {
    let (mut story, mut engine) = (Story::of_moments(2), Engine::new(Params::paper()));
    for number in 0..12 {
        tell(&mut story, &mut engine, number..=number);
        let (last, snapshot) = (story.series.columns.last().unwrap(), engine.snapshot());
        assert_eq!(
            (last.dense, last.clusters),
            (snapshot.voxels.len() as u64, snapshot.clusters.len() as u64)
        );
        assert_eq!(last.points, 15_000);
    }
}

#[test]
fn the_page_counts_what_it_holds() {
    let (story, snapshot) = whole_story(MOMENTS, 5);
    let data = data(&page(&story, &Facts::default()));
    assert_eq!(data["moments"].as_array().unwrap().len(), 5);
    assert_eq!(data["story"]["voxel_count"], snapshot.voxels.len());
    assert_eq!(data["story"]["scans"]["dense"][4], snapshot.voxels.len());
    assert!(data["story"]["ids"].as_array().unwrap().iter().all(serde_json::Value::is_string));
}

#[test]
fn a_warning_stands_out_and_another_remark_does_not() {
    let [warnings, remarks] = ["cut", "in map"].map(|text| vec![text.to_owned()]);
    let text = page(&Story::new(), &Facts { warnings, remarks, ..Facts::default() });
    assert!(text.contains("<p>in map</p>\n<p class=\"note\">cut</p>"), "{text}");
}

#[test]
fn what_stands_between_backticks_in_a_remark_is_code() {
    let line = "frame `<a>` and `b`, not `c".to_owned();
    let text = page(&Story::new(), &Facts { warnings: vec![line], ..Facts::default() });
    let code = "frame <code>&lt;a&gt;</code> and <code>b</code>, not `c</p>";
    assert!(text.contains(code), "{text}");
}

#[test]
fn names_from_a_bag_do_no_harm() {
    let evil =
        "</script><script>alert(1)</script><img src=x onerror='alert(2)'>\"&\u{202e}{{story}}".to_owned();
    let facts = Facts {
        title: evil.clone(),
        fixed_frame: evil.clone(),
        parameters: vec![(evil.clone(), evil.clone())],
        warnings: vec![evil.clone()],
        remarks: vec![evil.clone()],
        figures: vec![Figure { title: evil.clone(), svg: format!("<svg>{evil}</svg>"), caption: evil }],
        ..Facts::default()
    };
    let (story, _) = whole_story(2, 1);
    let (harmless, harmful) = (page(&story, &Facts::default()), page(&story, &facts));
    for tag in ["<script", "</script", "<svg"] {
        assert_eq!(harmful.matches(tag).count(), harmless.matches(tag).count(), "{tag}");
    }
    // The one image is the figure's; no mark within a text was replaced.
    assert_eq!(harmful.matches("<img").count(), 1);
    assert!(harmful.contains("&lt;/script&gt;&lt;script&gt;alert(1)") && harmful.contains("{{story}}"));
    assert!(!harmful.contains('\u{202e}'));
    assert_eq!(data(&harmful), data(&harmless));
}

#[test]
fn the_heading_of_a_figure_is_the_one_in_its_drawing() {
    let figure = Figure { title: "Growth".to_owned(), ..Figure::default() };
    let text = page(&Story::new(), &Facts { figures: vec![figure], ..Facts::default() });
    assert_eq!(text.matches("Growth").count(), 1);
    assert!(text.contains("<img alt=\"Growth\""));
}

#[test]
fn a_story_without_a_scan_is_a_page() {
    let mut story = Story::new();
    story.finish(&Engine::new(Params::default()).snapshot());
    let text = page(&story, &Facts::default());
    assert_eq!(data(&text)["moments"], serde_json::json!([]));
    assert!(!text.contains("{{") && text.ends_with("</html>\n"));
}

#[test]
fn the_same_story_gives_the_same_bytes_and_asks_no_network() {
    let pages = [(); 2].map(|()| page(&whole_story(4, 9).0, &Facts::default()));
    assert_eq!(pages[0], pages[1]);
    // The name of SVG's namespace is the only address; nothing is fetched from it.
    let addresses = pages[0].replace("http://www.w3.org/2000/svg", "");
    assert!(!addresses.contains("http:") && !addresses.contains("https:") && !addresses.contains("url("));
    assert!(pages[0].contains("default-src 'none'"));
}

#[test]
fn a_skipped_message_is_explained() {
    let deep = FrameError::TooDeep { child: "a".to_owned(), max: 1 };
    let many = FrameError::TooManySamples { child: "a".to_owned(), max: 1 };
    let at = Stamp::default();
    let (fixed, sensor, lack) = ("a".to_owned(), "b".to_owned(), Lack::TooDeep { max: 1 });
    let chain = LookupError { fixed, sensor, at, lack };
    let reasons = [CloudError::EmptyFrameId.reason(), deep.reason(), many.reason(), chain.reason()];
    let skipped: BTreeMap<_, _> = reasons.into_iter().zip(1230..).collect();
    let text = page(&Story::new(), &Facts { skipped: skipped.clone(), ..Facts::default() });
    for (Reason { key, sentence }, count) in skipped {
        let count = format!("1\u{202f}{}", count - 1000);
        let row = format!("{count}</td><th scope=\"row\"><code>{key}</code></th><td>{sentence}</td>");
        assert!(sentence.len() > 10 && text.contains(&row), "{row}");
    }
    assert!(!text.contains("Points that were not used"));
}

#[test]
fn points_that_were_not_used_are_accounted_for() {
    let facts = Facts { points_unused: "30 invalid, 69 out of range".to_owned(), ..Facts::default() };
    let text = page(&Story::new(), &facts);
    assert!(text.contains("<p>Points that were not used: 30 invalid, 69 out of range.</p>"), "{text}");
}

#[test]
fn up_is_the_z_of_the_frame_that_is_named() {
    let facts = Facts { fixed_frame: "camera_depth_frame".to_owned(), ..Facts::default() };
    let text = page(&Story::new(), &facts);
    assert!(text.contains("up is the z of <code>camera_depth_frame</code>"), "{text}");
}

proptest! {
    #[test]
    fn escaped_text_has_no_sign_of_html_and_says_the_same(text in ".*") {
        let html = escaped(&text);
        prop_assert!(!html.contains(['<', '>', '"', '\'']));
        let back = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")]
            .iter()
            .fold(html, |html, (from, to)| html.replace(from, to));
        if !text.contains(|c| matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')) {
            prop_assert_eq!(back, text);
        }
    }
}
