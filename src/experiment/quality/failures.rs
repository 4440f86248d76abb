//! What does not hold, in words that a developer can act on.

use super::measure::Measure;
use super::plane::is_another;
use super::score::{ClusterScore, Quality, SurfaceScore};
use crate::count::count_of;
use crate::engine::MIN_RELIABLE_VOXELS;

/// How many clusters or surfaces a line names.
const NAMED: usize = 3;

/// Surfaces in their order, then clusters, the largest first and the small ones together, then what is of the whole run.
pub(super) fn failures(quality: &Quality) -> Vec<String> {
    let surfaces = quality.surfaces.iter().filter_map(|surface| of_surface(surface, quality));
    let mut mixed: Vec<_> = quality.clusters.iter().filter(|cluster| is_mixed(cluster)).collect();
    mixed.sort_by_key(|cluster| std::cmp::Reverse(cluster.scored));
    let (large, small): (Vec<_>, Vec<_>) = mixed.into_iter().partition(|cluster| cluster.is_large());
    let small = (!small.is_empty())
        .then(|| format!("mixed clusters below {MIN_RELIABLE_VOXELS} voxels: {}", small.len()));
    let whole = [Measure::Coverage, Measure::RandIndex, Measure::Class].into_iter().filter_map(|measure| {
        let value = measure.values(quality).first().copied()?;
        let fails = !measure.bar().holds_for(value);
        fails.then(|| format!("{}: {}", measure.name(), measure.show(value)))
    });
    surfaces.chain(large.into_iter().map(of_cluster)).chain(small).chain(whole).collect()
}

fn is_mixed(cluster: &ClusterScore) -> bool {
    let counts = cluster.of_seen || cluster.is_large();
    counts && !Measure::Impurity.bar().holds_for(cluster.impurity())
}

fn of_surface(surface: &SurfaceScore, quality: &Quality) -> Option<String> {
    let mut wrong = Vec::new();
    if !Measure::Wholeness.bar().holds_for(surface.wholeness()) {
        wrong.push(split(surface));
    }
    // The measures of a run with this surface alone are those of the surface.
    let alone =
        Quality { surfaces: vec![surface.clone()], clusters: Vec::new(), failures: Vec::new(), ..*quality };
    let described = [
        (Measure::Angle, "plane turned by"),
        (Measure::Offset, "plane off by"),
        (Measure::AreaOfLarge, "area wrong by"),
        (Measure::AreaOfSmall, "area wrong by"),
    ];
    if surface.described.is_some() {
        for (measure, words) in described {
            let values = measure.values(&alone);
            let bad = values.into_iter().filter(|value| !measure.bar().holds_for(*value));
            wrong.extend(bad.map(|value| format!("{words} {}", measure.show(value))));
        }
        let right = Measure::Class.values(&alone).first().copied().unwrap_or(1.0);
        if !Measure::Class.bar().holds_for(right) {
            wrong.push(format!("class right on {} of the area", Measure::Class.show(right)));
        }
        // Of small surfaces the angle is not judged, but of such a one nothing else is wrong with its plane.
        let angle = surface.described.and_then(|described| described.angle);
        if let Some(angle) =
            angle.filter(|angle| is_another(*angle) && Measure::Angle.values(&alone).is_empty())
        {
            wrong.push(format!("plane turned by {}", Measure::Angle.show(angle)));
        }
        // A chi-squared value of 3 degrees of freedom is above this once in a thousand.
        wrong.extend(
            Measure::Nees
                .values(&alone)
                .into_iter()
                .filter(|nees| *nees > 16.3)
                .map(|nees| format!("NEES {nees:.1}")),
        );
    }
    let named = format!("{} ({:.1} m2, {} scored)", surface.name, surface.seen_area, surface.scored);
    (!wrong.is_empty()).then(|| format!("{named}: {}", wrong.join("; ")))
}

fn split(surface: &SurfaceScore) -> String {
    let percent = |count: u32| 100.0 * f64::from(count) / f64::from(surface.scored.max(1));
    let holders = surface.holders.iter().take(NAMED);
    let mut parts: Vec<_> =
        holders.map(|(number, count)| format!("cluster {number} holds {:.1} %", percent(*count))).collect();
    if surface.holders.len() > NAMED {
        let rest: u32 = surface.holders[NAMED..].iter().map(|(_, count)| count).sum();
        let others = count_of(surface.holders.len() - NAMED, "other");
        parts.push(format!("{others} {:.1} %", percent(rest)));
    }
    parts.push(format!("in no cluster {:.1} %", percent(surface.scored - surface.clustered)));
    parts.join(", ")
}

fn of_cluster(cluster: &ClusterScore) -> String {
    let surfaces = cluster.surfaces.iter().take(NAMED).map(|(name, count)| format!("{count} of {name}"));
    format!(
        "cluster {} ({}, {} scored) is mixed: {}",
        cluster.number,
        count_of(cluster.voxels, "voxel"),
        cluster.scored,
        surfaces.collect::<Vec<_>>().join(", ")
    )
}
