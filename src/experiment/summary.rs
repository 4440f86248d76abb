//! Means, growth and shares: what the figures say, in numbers.

use serde::Serialize;

use super::live::arrival;
use super::method::Method;
use super::results::{Measured, Results};
use super::statistics::{largest, last_quarter_over_second, line, mean, median};
use crate::engine::{Mode, Params, PipelineStep};

/// The experiment in numbers; `None` (`null` in JSON) where there is nothing to take a number of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Scans taken in.
    pub scans: usize,
    /// Their valid points.
    pub points: u64,
    /// From the first stamp to the last (s).
    pub recorded_s: Option<f64>,
    /// Time that the scans would take at 30 Hz (s), as figure 3d takes them.
    pub stream_s: f64,
    /// What all methods worked with.
    pub parameters: ParametersSummary,
    /// CFODI first, then mode `consistent`, STATIC last.
    pub methods: Vec<MethodSummary>,
    /// The maps of figure 2.
    pub figure2: Vec<MomentSummary>,
}

/// Parameters by their names in the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "each is documented at `Params`")]
pub struct ParametersSummary {
    pub voxel_size: f64,
    pub min_points: u32,
    pub depth: u8,
    pub max_normal_angle: f64,
    pub min_vicinity: u32,
    pub expansion_interval: u32,
    /// This and what follows are asked for by mode `consistent` alone.
    pub noise_model: &'static str,
    pub pose_sigma: f64,
    pub clearing: bool,
    pub max_voxels: u64,
    pub keep_radius: f64,
}

/// One method in numbers: means are over the scans, `last` is after the last one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodSummary {
    /// As the paper calls it.
    pub method: &'static str,
    /// Dense voxels.
    pub dense_voxels_last: Option<u32>,
    /// Clusters.
    pub clusters_mean: Option<f64>,
    /// Clusters.
    pub clusters_last: Option<u32>,
    /// Clusters of 10 voxels or more.
    pub large_clusters_mean: Option<f64>,
    /// Clusters of 10 voxels or more.
    pub large_clusters_last: Option<u32>,
    /// Those of one voxel.
    pub single_clusters_last: Option<u32>,
    /// Share of the dense voxels that are in clusters.
    pub share_in_clusters_last: Option<f64>,
    /// Angle between a voxel's normal and its cluster's, mean over all voxels in clusters (rad).
    pub normal_error_mean_rad: Option<f64>,
    /// Angle between a voxel's normal and its cluster's, mean over all voxels in clusters (rad).
    pub normal_error_last_rad: Option<f64>,
    /// How much larger that error is than STATIC's, mean over the scans (rad).
    pub normal_error_above_static_rad: Option<f64>,
    /// Agreement of the partitions of the last map: 1 = the same, about 0 = by chance.
    pub rand_index_to_static_last: Option<f64>,
    /// Time of a scan (ms).
    pub ms_mean: Option<f64>,
    /// Time of a scan (ms).
    pub ms_median: Option<f64>,
    /// Time of a scan (ms).
    pub ms_max: Option<f64>,
    /// Its parts.
    pub steps_ms_mean: StepsMs,
    /// Growth: slope of the line through time over dense voxels (ms for 1000 voxels).
    pub ms_per_1000_dense_voxels: Option<f64>,
    /// Growth: mean time in the last quarter of the scans over that in the second.
    pub last_quarter_over_second: Option<f64>,
    /// At 30 scans a second.
    pub live: Live,
}

/// Mean times of the steps of a scan (ms); `None` where the method has no such step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepsMs {
    /// Points into voxels.
    pub bin: Option<f64>,
    /// Normals of the voxels.
    pub normals: Option<f64>,
    /// Partial clusters.
    pub partials: Option<f64>,
    /// Global clusters.
    pub globals: Option<f64>,
}

/// What a method managed when scans arrived 30 times a second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Live {
    /// Scans taken in.
    pub scans: usize,
    /// Their points.
    pub points: u64,
    /// Share of these points in all points.
    pub share_of_points: Option<f64>,
}

/// A map of figure 2.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MomentSummary {
    /// The file.
    pub file: String,
    /// Number of the scan after which it is drawn, from 1.
    pub scan: usize,
    /// From the first stamp (s).
    pub recorded_s: Option<f64>,
    /// Clusters.
    pub clusters: usize,
}

impl Results {
    /// The experiment in numbers.
    pub fn summary(&self) -> Summary {
        let seconds = self.seconds();
        let moments = self.moments.iter().enumerate().map(|(place, moment)| MomentSummary {
            file: format!("{}.png", super::figures::figure2_name(place)),
            scan: moment.scan + 1,
            recorded_s: seconds.as_ref().map(|seconds| seconds[moment.scan]),
            clusters: moment.snapshot.clusters.len(),
        });
        Summary {
            scans: self.records.len(),
            points: self.points(),
            recorded_s: seconds.as_ref().and_then(|seconds| seconds.last().copied()),
            stream_s: arrival(self.records.len() as u64).as_secs_f64(),
            parameters: ParametersSummary::of(&self.params),
            methods: Method::ALL.into_iter().map(|method| self.summary_of(method)).collect(),
            figure2: moments.collect(),
        }
    }

    fn summary_of(&self, method: Method) -> MethodSummary {
        let quality: Vec<_> = self.of_method(method).map(|measured| measured.quality).collect();
        let ms: Vec<f64> = self.of_method(method).map(Measured::ms).collect();
        let clusters: Vec<f64> = quality.iter().map(|q| f64::from(q.clusters)).collect();
        let large: Vec<f64> = quality.iter().map(|q| f64::from(q.large_clusters)).collect();
        let errors: Vec<f64> = quality.iter().filter_map(|q| q.normal_error).collect();
        let last = quality.last();
        MethodSummary {
            method: method.name(),
            dense_voxels_last: last.map(|q| q.dense_voxels),
            clusters_mean: mean(&clusters),
            clusters_last: last.map(|q| q.clusters),
            large_clusters_mean: mean(&large),
            large_clusters_last: last.map(|q| q.large_clusters),
            single_clusters_last: last.map(|q| q.single_clusters),
            share_in_clusters_last: last.and_then(|q| {
                (q.dense_voxels > 0).then(|| f64::from(q.clustered_voxels) / f64::from(q.dense_voxels))
            }),
            normal_error_mean_rad: mean(&errors),
            normal_error_last_rad: last.and_then(|q| q.normal_error),
            normal_error_above_static_rad: self.error_above_static(method),
            rand_index_to_static_last: self.rand_indices[method as usize],
            ms_mean: mean(&ms),
            ms_median: median(&ms),
            ms_max: largest(&ms),
            steps_ms_mean: self.steps(method),
            ms_per_1000_dense_voxels: line(&self.time_by_size(method)).map(|(slope, _)| slope * 1e3),
            last_quarter_over_second: last_quarter_over_second(&ms),
            live: self.live(method),
        }
    }

    /// Dense voxels and time (ms) of each scan.
    pub(super) fn time_by_size(&self, method: Method) -> Vec<(f64, f64)> {
        self.of_method(method)
            .map(|measured| (f64::from(measured.quality.dense_voxels), measured.ms()))
            .collect()
    }

    fn steps(&self, method: Method) -> StepsMs {
        let of = |step: PipelineStep| {
            let times: Vec<f64> = self
                .of_method(method)
                .filter_map(|measured| Some(measured.time.steps[step as usize]?.as_secs_f64() * 1e3))
                .collect();
            mean(&times)
        };
        StepsMs {
            bin: of(PipelineStep::Binned),
            normals: of(PipelineStep::Normals),
            partials: of(PipelineStep::Partials),
            globals: of(PipelineStep::Globals),
        }
    }

    fn live(&self, method: Method) -> Live {
        let taken = &self.taken[method as usize];
        let (points, all) = (taken.iter().map(|taken| taken.points).sum::<u64>(), self.points());
        let share_of_points = (all > 0).then(|| points as f64 / all as f64);
        Live { scans: taken.len(), points, share_of_points }
    }
}

impl ParametersSummary {
    fn of(params: &Params) -> Self {
        Self {
            voxel_size: params.voxel_size(),
            min_points: params.min_points(),
            depth: params.depth(),
            max_normal_angle: params.max_normal_angle(),
            min_vicinity: params.min_vicinity(),
            expansion_interval: params.expansion_interval(),
            noise_model: params.noise_model().as_str(),
            pose_sigma: params.pose_sigma(),
            clearing: params.with_mode(Mode::Consistent).clearing(),
            max_voxels: params.max_voxels(),
            keep_radius: params.keep_radius(),
        }
    }
}
