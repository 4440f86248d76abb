//! The story as JSON for the page's viewer.
//!
//! Voxels are packed (see [`super::pack`]); everything else is plain. `viewer/data.js` reads it.

use std::collections::BTreeSet;
use std::io::{self, Write};

use serde_json::{Value, json};

use super::moment::{Look, Moment};
use super::pack::{base64, keys, push};
use super::row::{FIELDS, number, time};
use super::series::Column;
use super::story::Story;
use crate::colour::cluster_colour;
use crate::engine::ClusterId;

/// Writes the story. No byte of it is `<`, `>` or `&`, so that it stands safely in a script element.
pub(super) fn write_story(out: &mut dyn Write, story: &Story) -> io::Result<()> {
    let ids = Ids::of(&story.moments);
    let head = json!({
        "voxel_size": story.voxel_size,
        "voxel_count": story.latest.keys.len(),
        "keys": keys(&story.latest.keys),
        "fields": FIELDS,
        "ids": ids.0.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "colours": base64(&ids.colours()),
        "merges": story.merges.iter().map(|merge| json!([
            merge.scan,
            merge.into.to_string(),
            merge.from.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ])).collect::<Vec<_>>(),
        "start": story.series.first.map_or_else(|| json!([0, 0]), |first| time(first.into())),
        "scans": scans(&story.series.columns),
    });
    write!(out, "{{\"story\":{},\"moments\":[", escaped(&head.to_string()))?;
    let mut looks = vec![None; story.latest.keys.len()];
    for (i, moment) in story.moments.iter().enumerate() {
        let comma = if i == 0 { "" } else { "," };
        write!(out, "{comma}\n{}", escaped(&moment_text(moment, &ids, &mut looks)))?;
    }
    write!(out, "]}}")
}

/// Within JSON these characters stand in strings only.
fn escaped(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Every cluster that a moment tells of, ascending: its place in the list is its number on the page.
struct Ids(Vec<ClusterId>);

impl Ids {
    fn of(moments: &[Moment]) -> Self {
        let all: BTreeSet<_> = moments.iter().flat_map(|moment| moment.clusters.keys().copied()).collect();
        Self(all.into_iter().collect())
    }

    fn number(&self, id: ClusterId) -> Option<u64> {
        self.0.binary_search(&id).ok().map(|place| place as u64)
    }

    fn colours(&self) -> Vec<u8> {
        self.0.iter().flat_map(|&id| cluster_colour(Some(id))).collect()
    }
}

fn moment_text(moment: &Moment, ids: &Ids, looks: &mut [Option<Look>]) -> String {
    let rows: Vec<&str> = moment.clusters.values().flatten().map(|row| &**row).collect();
    let gone = moment.clusters.iter().filter(|(_, row)| row.is_none());
    let gone: Vec<_> = gone.filter_map(|(&id, _)| ids.number(id)).collect();
    let head = json!([moment.scan, time(moment.stamp.into()), moment.unclustered]);
    let voxels = base64(&voxels(moment, ids, looks));
    format!(
        "{{\"head\":{head},\"voxels\":\"{voxels}\",\"gone\":{},\"clusters\":[{}]}}",
        json!(gone),
        rows.join(",")
    )
}

/// Each voxel that changed: steps from the number of the one before, twice, + 1 where the normal is told; then 0 = gone,
/// 1 = in no cluster, 2 + number of its cluster; then the normal in three bytes.
fn voxels(moment: &Moment, ids: &Ids, looks: &mut [Option<Look>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut last = 0;
    for (&number, &look) in &moment.voxels {
        let before = std::mem::replace(&mut looks[number as usize], look);
        // A moment that took in another one may tell of a voxel that has come back to what it was.
        if before == look {
            continue;
        }
        let new_normal = look.filter(|look| before.is_none_or(|before| before.normal != look.normal));
        push(&mut bytes, (u64::from(number - last) << 1) | u64::from(new_normal.is_some()));
        push(
            &mut bytes,
            look.map_or(0, |look| look.cluster.and_then(|id| ids.number(id)).map_or(1, |n| 2 + n)),
        );
        if let Some(look) = new_normal {
            bytes.extend(look.normal.map(i8::cast_unsigned));
        }
        last = number;
    }
    bytes
}

/// The columns turned into rows, one a quantity.
fn scans(columns: &[Column]) -> Value {
    let row = |value: &dyn Fn(&Column) -> Value| columns.iter().map(value).collect::<Value>();
    json!({
        "count": row(&|column| json!(column.scans)),
        "points": row(&|column| number(column.points as f64 / column.scans as f64)),
        "engine_ms": row(&|column| number(column.engine_ms / column.scans as f64)),
        "slowest_ms": row(&|column| number(column.slowest_ms)),
        "newly_dense": row(&|column| json!(column.newly_dense)),
        "clusters": row(&|column| json!(column.clusters)),
        "dense": row(&|column| json!(column.dense)),
        "sensor": row(&|column| column.sensor.coords.iter().map(|&x| number(x)).collect()),
    })
}
