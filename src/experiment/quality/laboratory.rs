//! A drive through a simulated scene, with every method scored against the truth at its end, and on the way if that is asked for.
//!
//! Each scan is simulated once for all methods and voxel sizes. A run is a function of the laboratory and its seed alone,
//! so runs can be made in parallel. Per scan it costs the simulation (some 20 ms), and for each voxel size a map of the
//! truth and one of each method; the memory is that of those maps. Scoring costs as much as some scans.

use std::num::NonZeroU32;
use std::ops::ControlFlow;

use super::maps::{ScoredMap, scored_maps};
use super::score::Quality;
use super::table::Table;
use super::truth::{RANGE, SeenPart, TruthMap};
use super::way::Moment;
use crate::engine::{Params, ParamsError, Stamp};
use crate::sim::drive::SCANS_PER_SECOND;
use crate::sim::{Drive, PoseNoise, Scene, SeenCells};

/// What is simulated and scored.
#[derive(Clone, Debug, PartialEq)]
pub struct Laboratory {
    scene: Scene,
    /// Of each voxel size.
    params: Vec<Params>,
    /// Scans of a drive, those left out included.
    scans: u32,
    /// Every how-manieth of them is taken.
    step: u32,
    /// Scans between two scores on the way, those left out included.
    score_every: Option<u32>,
    /// By how much the poses told are wrong.
    pose_noise: Option<PoseNoise>,
}

/// How every method did in one run, at each voxel size.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// On the way, where that is asked for: the end may be among it.
    pub moments: Vec<Moment>,
    /// After the last scan.
    pub end: Vec<Scored>,
}

/// What one method did in one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Scored {
    /// Edge of a voxel (m).
    pub voxel_size: f64,
    /// The method.
    pub method: &'static str,
    /// How it did.
    pub quality: Quality,
}

/// One voxel size of a run.
struct Bench {
    params: Params,
    truth: TruthMap,
    maps: Vec<(Box<dyn ScoredMap>, AsFromScratch)>,
}

/// On how many of the scans at which it was looked at a method's partition was what its definition gives from scratch.
#[derive(Clone, Copy, Debug, Default)]
struct AsFromScratch {
    equal: u32,
    of: u32,
}

/// Scans, of those taken, from one such look to the next.
const LOOK: u32 = 50;

impl Laboratory {
    /// A drive of `seconds` (s) through a scene, scored at each of `voxel_sizes` (m) with the other parameters as they are; 30
    /// scans a second, of which every `step`-th is taken.
    ///
    /// # Errors
    /// When there can be no voxels of such a size.
    pub fn new(
        scene: Scene,
        seconds: f64,
        step: NonZeroU32,
        params: &Params,
        voxel_sizes: &[f64],
    ) -> Result<Self, ParamsError> {
        let params = voxel_sizes.iter().map(|&size| params.with_voxel_size(size));
        let scans = (seconds * f64::from(SCANS_PER_SECOND)).round() as u32;
        Ok(Self {
            scene,
            params: params.collect::<Result<_, _>>()?,
            scans,
            step: step.get(),
            score_every: None,
            pose_noise: None,
        })
    }

    /// The same, with every method scored on the way too: each time that `seconds` (s, rounded to whole scans) have gone by,
    /// after the first scan that is taken then. `None` where the last scan is taken before the first such time.
    pub fn with_score_every(self, seconds: f64) -> Option<Self> {
        let every = (seconds * f64::from(SCANS_PER_SECOND)).round().max(1.0) as u32;
        (every <= self.last()).then_some(Self { score_every: Some(every), ..self })
    }

    /// The same, with poses that are told wrong by so much; what was to be seen stays that of the true ones.
    #[must_use]
    pub fn with_pose_noise(self, noise: PoseNoise) -> Self {
        Self { pose_noise: Some(noise), ..self }
    }

    /// By how much the poses that are told are wrong; `None` where they are exact.
    pub const fn pose_noise(&self) -> Option<PoseNoise> {
        self.pose_noise
    }

    /// When the last scan of a run is taken (s since the first).
    pub fn ends_at(&self) -> f64 {
        f64::from(self.last()) / f64::from(SCANS_PER_SECOND)
    }

    const fn last(&self) -> u32 {
        self.scans().saturating_sub(1) * self.step
    }

    /// Scans that a run takes.
    pub const fn scans(&self) -> u32 {
        self.scans.div_ceil(self.step)
    }

    /// Makes a run, unless `taken`, which is called after each scan, ends it.
    pub fn run(&self, seed: u64, mut taken: impl FnMut() -> ControlFlow<()>) -> Option<Run> {
        let max_range = *RANGE.end();
        let drive = self.drive(seed);
        let mut seen = SeenCells::new(&self.scene, max_range);
        let mut benches: Vec<_> = self.params.iter().map(|params| Bench::new(&drive, params)).collect();
        let mut moments = Vec::new();
        for index in (0..self.scans).step_by(self.step as usize) {
            let labelled = drive.labelled_depths(index, max_range);
            seen.add(&drive, index);
            for bench in &mut benches {
                bench.truth.insert(&labelled.scan, &labelled.labels);
                bench.maps.iter_mut().for_each(|(map, _)| map.insert(&labelled.scan));
            }
            if (index / self.step + 1).is_multiple_of(LOOK) || index == self.last() {
                benches.iter_mut().for_each(Bench::look);
            }
            if self.is_moment(index) {
                let seconds = f64::from(index) / f64::from(SCANS_PER_SECOND);
                let scored = benches.iter().flat_map(|bench| bench.score(&seen));
                moments.extend(scored.map(|scored| Moment::new(seconds, &scored)));
            }
            if taken().is_break() {
                return None;
            }
        }
        Some(Run { moments, end: benches.iter().flat_map(|bench| bench.score(&seen)).collect() })
    }

    fn drive(&self, seed: u64) -> Drive {
        let drive = Drive::new(self.scene.clone(), seed, Stamp::from_nanos(0));
        match self.pose_noise {
            Some(noise) => drive.with_pose_noise(noise),
            None => drive,
        }
    }

    /// Whether a time to score has come since the scan that was taken before this one.
    fn is_moment(&self, index: u32) -> bool {
        let before = index.saturating_sub(self.step);
        self.score_every.is_some_and(|every| index / every > before / every)
    }
}

impl Bench {
    fn new(drive: &Drive, params: &Params) -> Self {
        let maps = scored_maps(params).into_iter().map(|map| (map, AsFromScratch::default()));
        let truth = TruthMap::new(drive.scene(), params).with_pose_spread(drive.pose_spread());
        Self { params: *params, truth, maps: maps.collect() }
    }

    fn look(&mut self) {
        for (map, looks) in &mut self.maps {
            let is_equal = map.is_as_from_scratch();
            looks.of += u32::from(is_equal.is_some());
            looks.equal += u32::from(is_equal == Some(true));
        }
    }

    fn score(&self, seen: &SeenCells) -> Vec<Scored> {
        let truth =
            self.truth.truth(|label| SeenPart { cells: seen.cells(label).collect(), area: seen.area(label) });
        let voxel_size = self.params.voxel_size();
        let mut scored = Vec::new();
        for (map, looks) in &self.maps {
            let as_from_scratch = (looks.of > 0).then(|| f64::from(looks.equal) / f64::from(looks.of));
            for (method, found) in map.found() {
                let quality = Quality { as_from_scratch, ..truth.score(&found) };
                scored.push(Scored { voxel_size, method, quality });
            }
        }
        scored
    }
}

impl Table {
    /// Adds a run; its failures are named after its seed.
    pub fn add_run(&mut self, seed: u64, end: &[Scored]) {
        for Scored { voxel_size, method, quality } in end {
            self.add(*voxel_size, method, &format!("seed {seed}"), quality);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::Measure;
    use super::super::pooled::{Line, Pooled};
    use super::*;

    fn room(sizes: &[f64]) -> Result<Laboratory, ParamsError> {
        let (scene, step) = (Scene::named("room").unwrap(), NonZeroU32::new(10).unwrap());
        Laboratory::new(scene, 1.0, step, &Params::default(), sizes)
    }

    fn whole(laboratory: &Laboratory, seed: u64) -> Run {
        laboratory.run(seed, || ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn a_run_that_is_ended_takes_no_further_scan_and_scores_nothing() {
        let mut scans = 0;
        let run = room(&[0.16]).unwrap().run(3, || {
            scans += 1;
            if scans == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((run, scans), (None, 2));
    }

    #[test]
    fn a_run_is_a_function_of_its_seed_and_scores_every_method_at_every_size() {
        let laboratory = room(&[0.1, 0.16]).unwrap();
        let mut scans = 0;
        let run = laboratory.run(3, || {
            scans += 1;
            ControlFlow::Continue(())
        });
        let run = run.unwrap();
        assert_eq!((scans, laboratory.scans()), (3, 3));
        assert_eq!(run, whole(&laboratory, 3));
        assert_ne!(run, whole(&laboratory, 4));
        assert_eq!(run.moments, [], "nobody asked for any");
        let of: Vec<_> = run.end.iter().map(|scored| (scored.voxel_size, scored.method)).collect();
        assert_eq!(
            of,
            [
                (0.1, "CFODI"),
                (0.1, "STATIC"),
                (0.1, "consistent"),
                (0.16, "CFODI"),
                (0.16, "STATIC"),
                (0.16, "consistent")
            ]
        );
        let as_from_scratch: Vec<_> = run.end.iter().map(|scored| scored.quality.as_from_scratch).collect();
        assert_eq!(as_from_scratch[..3], [None, None, Some(1.0)]);
        let mut table = Table::default();
        table.add_run(3, &run.end);
        let coverage = table.pooled(0.1, "STATIC").and_then(|pooled| pooled.line(Measure::Coverage)).unwrap();
        assert!(coverage.worst > 0.8, "{coverage:?}");
        let names: Vec<_> = run.end[0].quality.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        assert!(names.contains(&"floor"), "{names:?}");
    }

    #[test]
    fn on_the_way_it_scores_each_time_that_the_seconds_have_gone_by() {
        let (scene, step) = (Scene::named("room").unwrap(), NonZeroU32::new(4).unwrap());
        let laboratory = Laboratory::new(scene, 1.0, step, &Params::default(), &[0.16]).unwrap();
        let end = whole(&laboratory, 3).end;
        // Of the scans 0, 4, ... 28 those that are the first at or after the 9th, the 18th and the 27th.
        let run = whole(&laboratory.clone().with_score_every(0.3).unwrap(), 3);
        assert_eq!(run.end, end, "it only looks on");
        let judged = |moment: &&Moment| moment.method == "consistent";
        let seconds: Vec<_> = run.moments.iter().filter(judged).map(|moment| moment.seconds).collect();
        assert_eq!(seconds, [12.0 / 30.0, 20.0 / 30.0, 28.0 / 30.0]);
        assert_eq!(run.moments.len(), 3 * 3, "of every method");
        let last: Vec<_> = end.iter().map(|scored| Moment::new(28.0 / 30.0, scored)).collect();
        assert_eq!(run.moments[6..], last);
        // The last scan is that at 28 / 30 s.
        assert!(laboratory.clone().with_score_every(0.93).is_some());
        assert_eq!(laboratory.with_score_every(0.96), None, "nothing would be scored");
    }

    /// What is measured of the clusters of mode `consistent` at the end of a run.
    fn measured(run: &Run, measure: Measure) -> Line {
        let mut pooled = Pooled::default();
        pooled.add("seed 3", &run.end.iter().find(|scored| scored.method == "consistent").unwrap().quality);
        pooled.line(measure).unwrap()
    }

    #[test]
    fn planes_are_as_uncertain_as_wrong_poses_make_them_and_more_so_where_the_engine_is_told_of_these() {
        let (scene, step) = (Scene::named("room").unwrap(), NonZeroU32::new(10).unwrap());
        let nees = |pose_sigma| {
            let params = Params::default().with_pose_sigma(pose_sigma).unwrap();
            let laboratory = Laboratory::new(scene.clone(), 4.0, step, &params, &[0.16]).unwrap();
            let laboratory = laboratory.with_pose_noise(PoseNoise { metres: 0.05, radians: 0.01 });
            measured(&whole(&laboratory, 3), Measure::Nees).median
        };
        let [untold, told] = [0.0, 0.05].map(nees);
        // 3 are expected. It is 257 where planes do not count what their points show.
        assert!(told < 5.0 && told < untold && untold < 20.0, "{told} instead of {untold}");
    }

    #[test]
    fn with_wrong_poses_a_run_is_one_of_its_seed_too_and_its_planes_are_off() {
        let exact = room(&[0.16]).unwrap();
        let noisy = exact.clone().with_pose_noise(PoseNoise { metres: 0.05, radians: 0.01 });
        let [right, wrong] = [&exact, &noisy].map(|laboratory| whole(laboratory, 3));
        assert_eq!(wrong, whole(&noisy, 3));
        assert_ne!(wrong, whole(&noisy, 4));
        // Angles of planes in voxels as coarse as these are off by more than the poses are turned.
        for measure in [Measure::Offset, Measure::Nees] {
            let [right, wrong] = [&right, &wrong].map(|run| measured(run, measure));
            assert!(wrong.median > 3.0 * right.median, "{measure:?}: {wrong:?} after {right:?}");
        }
        // What the poses have moved is asked for still.
        let scored =
            |run: &Run| run.end[0].quality.surfaces.iter().map(|surface| surface.scored).sum::<u32>();
        assert!(scored(&wrong) > scored(&right) / 4 * 3, "{} after {}", scored(&wrong), scored(&right));
        let [right, wrong] = [&right, &wrong].map(|run| measured(run, Measure::Coverage));
        assert!(wrong.worst > 0.7 && right.worst > 0.7, "{wrong:?} after {right:?}");
    }

    /// The bounds are a little below what comes of it, to find what makes clusters worse. Of 10 planes all hold their bars.
    #[test]
    fn half_a_lap_of_the_laboratory_gives_whole_surfaces_with_right_planes_and_classes() {
        let (scene, step) = (Scene::named("lab").unwrap(), NonZeroU32::new(20).unwrap());
        let laboratory = Laboratory::new(scene, 36.0, step, &Params::default(), &[0.08]).unwrap();
        let run = whole(&laboratory, 1);
        let quality = &run.end.iter().find(|scored| scored.method == "consistent").unwrap().quality;
        let mut pooled = Pooled::default();
        pooled.add("seed 1", quality);
        let line = |measure| pooled.line(measure).unwrap();
        let said = pooled.failures.join("\n");
        assert!(line(Measure::RandIndex).worst > 0.93, "{said}");
        // What lies ahead of the robot by then is in parts, and some of it in no cluster.
        assert!(line(Measure::Wholeness).held >= 10, "{said}");
        assert!(line(Measure::Class).worst > 0.86, "{said}");
        assert!(line(Measure::Angle).holds && line(Measure::Offset).holds, "{said}");
        let door = quality.surfaces.iter().find(|surface| surface.name == "closet door/left").unwrap();
        assert!(door.class_right > 0.9 * door.seen_area, "{door:?}");
    }

    #[test]
    fn a_voxel_size_that_cannot_be_is_refused() {
        assert_eq!(room(&[0.08, 0.0]), Err(ParamsError::VoxelSize(0.0)));
    }
}
