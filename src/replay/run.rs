//! The visitor that runs the engine over a bag's scans and hands what it makes of them to the outputs.

use std::time::{Duration, Instant};

use super::diagnosis::Diagnosis;
use super::feed::Fed;
use super::files::Outputs;
use super::pace::Pace;
use super::said::Remark;
use super::summary::{Summary, Tally};
use super::visitor::{Go, Origin, Visitor};
use crate::bag::Message;
use crate::config::Value;
use crate::engine::{ClusterState, Engine, Params, PipelineStep, Scan, Snapshot, Stamp, Update};
use crate::export::WriteError;
use crate::msg::clusters::Session;
use crate::msg::ros::TransformStamped;
use crate::reach::{Points, Reach};
use crate::report::{Story, Taken};
use crate::residual;

/// Time between two reports, as the live node has it.
const REPORT: Duration = Duration::from_secs(1);

/// What a replay is made with.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The node that it stands for.
    pub node: String,
    /// Of the engine.
    pub engine: Params,
    /// Time between two snapshots, in the time of the stamps, or of recording while the newest of these stands still.
    pub publish_period: Duration,
    /// All parameters, for the account.
    pub parameters: Vec<(String, Value)>,
}

/// What a replay ends with.
#[derive(Debug)]
pub struct Finished {
    /// The map of the last session.
    pub map: Snapshot,
    /// Its names.
    pub session: Session,
    /// The account of all.
    pub summary: Summary,
    /// What a report tells, where one is wanted.
    pub story: Option<Story>,
    /// Whether the result bag could be written, where one is wanted.
    pub written: Result<(), WriteError>,
}

/// A replay under way.
pub struct Replay<'a> {
    settings: Settings,
    engine: Engine,
    outputs: Outputs<'a>,
    /// The map's names; `None` before its first scan.
    session: Option<Session>,
    sessions: u64,
    /// When the result bag gets a snapshot.
    pace: Pace,
    /// When it gets a report.
    reports: Pace,
    diagnosis: Diagnosis,
    engine_ms: Vec<f32>,
    binning: Duration,
    /// Points that lay beyond the grid's reach.
    beyond_grid: u64,
    /// The id of the session before.
    id_before: u64,
    notes: Vec<String>,
    begin: Instant,
}

impl<'a> Replay<'a> {
    /// An empty map, of a replay that has begun then: reading may begin again.
    pub fn new(settings: Settings, outputs: Outputs<'a>, begin: Instant) -> Self {
        Self {
            engine: Engine::new(settings.engine),
            pace: Pace::new(settings.publish_period),
            reports: Pace::new(REPORT),
            diagnosis: Diagnosis::default(),
            settings,
            outputs,
            session: None,
            sessions: 0,
            engine_ms: Vec::new(),
            binning: Duration::ZERO,
            beyond_grid: 0,
            id_before: 0,
            notes: Vec::new(),
            begin,
        }
    }

    /// Takes in a scan and notes how long it took (ms): all of it, and until its points were in the grid.
    fn insert(&mut self, scan: &Scan) -> (Update, f64) {
        let begin = Instant::now();
        let mut binned = Duration::ZERO;
        let update = self.engine.insert_observed(scan, |step| {
            if step == PipelineStep::Binned {
                binned = begin.elapsed();
            }
        });
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        self.binning += binned;
        self.engine_ms.push(ms as f32);
        (update, ms)
    }

    fn tell(&mut self, scan: &Scan, update: &Update, engine_ms: f64) {
        let Some(story) = &mut self.outputs.story else { return };
        let points = scan.points.len() as u64 - u64::from(update.points_beyond_grid);
        let (dense, sensor) = (self.engine.dense_count() as u64, scan.sensor_origin());
        story.scan(update, &Taken { points, dense, engine_ms, sensor });
        if story.wants_moment() {
            story.moment(&self.engine.snapshot());
        }
    }

    /// The map's names. In a replay a session is named after its first stamp, so that every run gives the same name; a
    /// lap of a bag in a loop, whose first stamp has been used, gets the next number.
    fn session(&mut self, stamp: Stamp, fixed_frame: &str) -> Session {
        let Self { session, id_before, .. } = self;
        let session = session.get_or_insert_with(|| {
            *id_before = u64::try_from(stamp.nanos()).unwrap_or(0).max(*id_before + 1);
            Session { id: *id_before, frame_id: fixed_frame.to_owned() }
        });
        session.clone()
    }

    /// Adds a whole sentence about something that is left out.
    pub fn note(&mut self, sentence: &str) {
        self.notes.push(sentence.to_owned());
    }

    /// What is to be said of points beyond the grid, where there were any.
    fn about_beyond(&self, fed: &Fed) -> Option<String> {
        let points = Points { all: fed.tally.points_valid, beyond_grid: self.beyond_grid };
        let reach = Reach::new(fed.fixed_frame.clone(), self.settings.engine.voxel_size());
        (points.beyond_grid > 0).then(|| reach.line(points))
    }

    /// Writes what remains, and gives the map and the account.
    pub fn finish(mut self, mut fed: Fed) -> Finished {
        let snapshot = self.engine.snapshot();
        let beyond_noise = snapshot.beyond_noise();
        let off = beyond_noise.and_then(|metres| residual::line(metres, &self.settings.engine));
        for line in self.about_beyond(&fed).into_iter().chain(off) {
            (self.outputs.say)(&line);
            fed.remarks.push(Remark::warning(line));
        }
        let mut story = self.outputs.story.take();
        if let Some(story) = &mut story {
            story.finish(&snapshot);
        }
        // Without a scan there is no map, nor a stamp that it could stand under in a bag.
        let published =
            self.session.as_ref().map_or(Ok(()), |session| self.outputs.snapshot(session, &snapshot));
        let nothing = Session { id: 0, frame_id: fed.fixed_frame.clone() };
        let session = self.session.take().unwrap_or(nothing);
        let active = |state| state == ClusterState::Active;
        self.engine_ms.sort_by(f32::total_cmp);
        let summary = Summary {
            tally: fed.tally,
            fixed_frame: fed.fixed_frame,
            remarks: fed.remarks,
            sessions: self.sessions,
            voxels: self.engine.voxel_count(),
            dense_voxels: snapshot.voxels.len(),
            clusters: snapshot.clusters.len(),
            clusters_active: snapshot.clusters.iter().filter(|cluster| active(cluster.state)).count(),
            beyond_noise,
            engine_ms: self.engine_ms,
            binning: self.binning,
            points_beyond_grid: self.beyond_grid,
            wall: self.begin.elapsed(),
            parameters: self.settings.parameters,
            unread: fed.unread.map(|error| error.to_string()),
            stopped: fed.stopped,
            notes: self.notes,
        };
        let written = published.and_then(|()| self.outputs.finish());
        Finished { map: snapshot, session, summary, story, written }
    }
}

impl Visitor for Replay<'_> {
    type Error = WriteError;

    fn scan(
        &mut self,
        scan: &Scan,
        origin: Origin,
        fixed_frame: &str,
        tally: &Tally,
    ) -> Result<(), WriteError> {
        self.outputs.scan(scan.stamp, origin)?;
        let (update, ms) = self.insert(scan);
        self.sessions += u64::from(update.sequence == 1);
        self.beyond_grid += u64::from(update.points_beyond_grid);
        let session = self.session(update.stamp, fixed_frame);
        self.tell(scan, &update, ms);
        self.outputs.update(&session, &update)?;
        if self.outputs.bag.is_some() && self.reports.is_due(update.stamp, origin.recorded) {
            let report = self.diagnosis.report(&self.settings.node, update.stamp, tally, &self.engine);
            self.outputs.diagnostics(&report)?;
        }
        if self.outputs.bag.is_some() && self.pace.is_due(update.stamp, origin.recorded) {
            self.outputs.snapshot(&session, &self.engine.snapshot())?;
        }
        Ok(())
    }

    fn jumped_back(&mut self, seconds: f64) -> Result<Go, WriteError> {
        self.say(&format!(
            "the stamps have jumped back by {seconds:.3} s: a new session begins with an empty map"
        ));
        if let Some(session) = self.session.take() {
            self.outputs.snapshot(&session, &self.engine.snapshot())?;
        }
        self.outputs.jumped_back(seconds);
        self.engine = Engine::new(self.settings.engine);
        self.pace = Pace::new(self.settings.publish_period);
        self.reports = Pace::new(REPORT);
        Ok(Go::On)
    }

    fn level(&mut self, body: &TransformStamped) {
        self.outputs.level(body);
    }

    fn message(&mut self, message: &Message) -> Result<(), WriteError> {
        self.outputs.message(message)
    }

    fn say(&mut self, line: &str) {
        (self.outputs.say)(line);
    }
}
