//! The clusters as JSON: `C.json`.

use std::io::{self, Write};

use serde_json::{Map, Value, json};

use crate::engine::Snapshot;
use crate::msg::clusters::{Session, SurfaceCluster, SurfaceClusterArray};

/// Fields of 64 bits: texts in JSON, whose numbers hold no more than 53.
const WIDE: [&str; 3] = ["id", "point_count", "merged_from"];

/// Writes the clusters as a list of objects, with the fields of `SurfaceCluster.msg`.
///
/// `uint64` are texts; what is not known (NaN in the message) is `null`.
///
/// # Errors
///
/// Those of `out`.
pub fn write_clusters(
    out: &mut (impl Write + ?Sized),
    session: &Session,
    snapshot: &Snapshot,
) -> io::Result<()> {
    let clusters = SurfaceClusterArray::snapshot(session, snapshot).clusters;
    writeln!(out, "[")?;
    for (i, cluster) in clusters.iter().enumerate() {
        let comma = if i + 1 < clusters.len() { "," } else { "" };
        writeln!(out, "{}{comma}", cluster_json(cluster))?;
    }
    writeln!(out, "]")
}

/// One cluster as an object.
fn cluster_json(cluster: &SurfaceCluster) -> Value {
    let mut fields = match serde_json::to_value(cluster) {
        Ok(Value::Object(fields)) => fields,
        // A structure of numbers and lists always is an object.
        _ => Map::new(),
    };
    for name in WIDE {
        if let Some(field) = fields.get_mut(name) {
            *field = as_text(field);
        }
    }
    Value::Object(fields)
}

fn as_text(value: &Value) -> Value {
    match value {
        Value::Array(list) => list.iter().map(as_text).collect(),
        Value::Number(number) => json!(number.to_string()),
        other => other.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_numbers_are_texts_and_what_is_unknown_is_null() {
        let cluster = SurfaceCluster {
            id: u64::MAX,
            merged_from: vec![1 << 60],
            area: f32::NAN,
            voxel_count: 7,
            ..SurfaceCluster::default()
        };
        let json = cluster_json(&cluster);
        assert_eq!(json["id"], "18446744073709551615");
        assert_eq!(json["merged_from"][0], "1152921504606846976");
        assert_eq!((&json["area"], &json["voxel_count"]), (&Value::Null, &json!(7)));
        assert_eq!(json["plane"]["coef"], json!([0.0, 0.0, 0.0, 0.0]));
    }
}
