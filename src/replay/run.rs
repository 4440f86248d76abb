//! The visitor that runs the engine over a bag's scans and hands what it makes of them to the outputs.

use std::time::{Duration, Instant};

use super::feed::{Fed, Visitor};
use super::files::Outputs;
use super::summary::Summary;
use crate::bag::Message;
use crate::config::Value;
use crate::engine::{ClusterState, Engine, Params, PipelineStep, Scan, Snapshot, Stamp, Update};
use crate::export::WriteError;
use crate::msg::clusters::Session;
use crate::report::{Story, Taken};

/// What a replay is made with.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Of the engine.
    pub engine: Params,
    /// Time between two snapshots, in the time of the stamps.
    pub publish_period: Duration,
    /// All parameters, for the account.
    pub parameters: Vec<(&'static str, Value)>,
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
}

/// A replay under way.
pub struct Replay<'a> {
    settings: Settings,
    engine: Engine,
    outputs: Outputs<'a>,
    /// The map's names; `None` before its first scan.
    session: Option<Session>,
    sessions: u64,
    /// Stamp of the newest snapshot in the result bag.
    published: Option<Stamp>,
    engine_ms: Vec<f32>,
    ingest: Duration,
    begin: Instant,
}

impl<'a> Replay<'a> {
    /// An empty map.
    pub fn new(settings: Settings, outputs: Outputs<'a>) -> Self {
        Self {
            engine: Engine::new(settings.engine),
            settings,
            outputs,
            session: None,
            sessions: 0,
            published: None,
            engine_ms: Vec::new(),
            ingest: Duration::ZERO,
            begin: Instant::now(),
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
        self.ingest += binned;
        self.engine_ms.push(ms as f32);
        (update, ms)
    }

    fn tell(&mut self, scan: &Scan, update: &Update, engine_ms: f64) {
        let Some(story) = &mut self.outputs.story else { return };
        let points = scan.points.len() as u64;
        story.scan(update, &Taken { points, engine_ms, sensor: scan.sensor_origin() });
        if story.wants_moment() {
            story.moment(&self.engine.snapshot());
        }
    }

    fn is_due(&self, stamp: Stamp) -> bool {
        let period = self.settings.publish_period.as_secs_f64();
        self.published.is_none_or(|published| stamp.seconds_since(published) >= period)
    }

    /// Writes what remains, and gives the map and the account.
    ///
    /// # Errors
    /// When an output cannot be written.
    pub fn finish(mut self, fed: Fed) -> Result<Finished, WriteError> {
        let snapshot = self.engine.snapshot();
        let mut story = self.outputs.story.take();
        if let Some(story) = &mut story {
            story.finish(&snapshot);
        }
        let nothing = Session { id: 0, frame_id: fed.fixed_frame.clone() };
        let session = self.session.take().unwrap_or(nothing);
        self.outputs.snapshot(&session, &snapshot)?;
        let active = |state| state == ClusterState::Active;
        self.engine_ms.sort_by(f32::total_cmp);
        let summary = Summary {
            tally: fed.tally,
            fixed_frame: fed.fixed_frame,
            sessions: self.sessions,
            voxels: self.engine.voxel_count(),
            dense_voxels: snapshot.voxels.len(),
            clusters: snapshot.clusters.len(),
            clusters_active: snapshot.clusters.iter().filter(|cluster| active(cluster.state)).count(),
            engine_ms: self.engine_ms,
            ingest: self.ingest,
            wall: self.begin.elapsed(),
            parameters: self.settings.parameters,
            unread: fed.unread.map(|error| error.to_string()),
        };
        self.outputs.finish()?;
        Ok(Finished { map: snapshot, session, summary, story })
    }
}

impl Visitor for Replay<'_> {
    type Error = WriteError;

    fn scan(&mut self, scan: &Scan, fixed_frame: &str, decoding: Duration) -> Result<(), WriteError> {
        self.ingest += decoding;
        let (update, ms) = self.insert(scan);
        // In a replay a session is named after its first stamp: every run gives the same name.
        let session = self.session.get_or_insert_with(|| Session {
            id: u64::try_from(update.stamp.nanos()).unwrap_or(0).max(1),
            frame_id: fixed_frame.to_owned(),
        });
        self.sessions += u64::from(update.sequence == 1);
        let session = session.clone();
        self.tell(scan, &update, ms);
        self.outputs.update(&session, &update)?;
        if self.outputs.bag.is_some() && self.is_due(update.stamp) {
            self.published = Some(update.stamp);
            self.outputs.snapshot(&session, &self.engine.snapshot())?;
        }
        Ok(())
    }

    fn jumped_back(&mut self, seconds: f64) {
        self.say(&format!(
            "the stamps have jumped back by {seconds:.3} s: a new session begins with an empty map"
        ));
        self.engine = Engine::new(self.settings.engine);
        self.session = None;
        self.published = None;
    }

    fn message(&mut self, message: &Message) -> Result<(), WriteError> {
        self.outputs.message(message)
    }

    fn say(&mut self, line: &str) {
        (self.outputs.say)(line);
    }
}
