//! What a replay leaves: each file is optional, and appears whole or not at all.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::clusters::write_clusters;
use super::said::Said;
use super::summary::Summary;
use super::visitor::Origin;
use crate::bag::{Message, OutputTopics, ResultBag};
use crate::engine::{Snapshot, Stamp, Update};
use crate::export::{WholeFile, WriteError, write_ply, write_voxels};
use crate::msg::caps::Caps;
use crate::msg::clusters::{MapVersion, Session, SurfaceClusterArray};
use crate::msg::markers::Markers;
use crate::msg::outgoing::{Outgoing, of_map, polygons_of};
use crate::msg::reports::DiagnosticArray;
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::msg::twins::Twins;
use crate::report::Story;

/// A result bag under way.
pub struct ResultFile {
    path: PathBuf,
    /// Its first failure ends it.
    bag: io::Result<ResultBag<WholeFile>>,
    /// Whether the replay goes on after that.
    has_others: bool,
    markers: Markers,
    caps: Caps,
    twins: Twins,
    /// The topics of the input of which it has been said that they are not copied.
    said_own: Said,
    is_direct: bool,
    /// Where a camera's frame is, until the first scan tells the time to say it at.
    level: Option<TransformStamped>,
    /// Version of the newest snapshot.
    published: Option<MapVersion>,
}

/// What is written while a replay runs.
pub struct Outputs<'a> {
    /// The result bag.
    pub bag: Option<ResultFile>,
    /// What a report tells.
    pub story: Option<Story>,
    /// Tells a person something.
    pub say: &'a mut dyn FnMut(&str),
}

impl ResultFile {
    /// Begins a result bag; `with_input` adds the input's messages. `offset` is that of the input's clocks: see
    /// [`clock_offset`](super::clock_offset).
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn create(
        path: &Path,
        topics: &OutputTopics,
        with_input: bool,
        offset: Option<i64>,
    ) -> Result<Self, WriteError> {
        let file = WholeFile::create(path)?;
        let is_direct = file.is_direct();
        let mut bag = ResultBag::new(file, topics, with_input).map_err(failed(path))?;
        if let Some(offset) = offset {
            bag.follow_stamps(offset);
        }
        Ok(Self {
            path: path.to_owned(),
            is_direct,
            level: None,
            bag: Ok(bag),
            has_others: false,
            markers: Markers::default(),
            caps: Caps::default(),
            twins: topics.twins(),
            said_own: Said::default(),
            published: None,
        })
    }

    /// Says whether there are other outputs: where the bag cannot be written, the replay goes on for them, and its end tells.
    #[must_use]
    pub fn beside_others(self, has_others: bool) -> Self {
        Self { has_others, ..self }
    }

    /// Whether what has been written cannot be taken back.
    pub fn is_direct(&self) -> bool {
        self.is_direct
    }

    fn update(&mut self, session: &Session, update: &Update) -> Result<(), WriteError> {
        self.put(|bag| bag.put(&Outgoing::Delta(SurfaceClusterArray::delta(session, update))))
    }

    fn put(
        &mut self,
        write: impl FnOnce(&mut ResultBag<WholeFile>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        let Ok(bag) = &mut self.bag else { return Ok(()) };
        let Err(error) = write(bag) else { return Ok(()) };
        if !self.has_others {
            return Err(failed(&self.path)(error));
        }
        self.bag = Err(error);
        Ok(())
    }

    fn snapshot(&mut self, session: &Session, snapshot: &Snapshot) -> Result<(), WriteError> {
        let version = MapVersion { session: session.id, sequence: snapshot.sequence };
        if self.published.replace(version) == Some(version) {
            return Ok(());
        }
        let messages = of_map(session, snapshot, &mut self.markers, self.twins);
        let polygons = polygons_of(session, snapshot, self.twins);
        self.put(|bag| messages.iter().chain(&polygons).try_for_each(|message| bag.put(message)))
    }

    fn finish(self) -> Result<(), WriteError> {
        self.bag.and_then(ResultBag::finish).map_err(failed(&self.path))?.commit()
    }
}

impl Outputs<'_> {
    pub(super) fn update(&mut self, session: &Session, update: &Update) -> Result<(), WriteError> {
        self.bag.as_mut().map_or(Ok(()), |bag| bag.update(session, update))
    }

    pub(super) fn snapshot(&mut self, session: &Session, snapshot: &Snapshot) -> Result<(), WriteError> {
        let Some(bag) = &mut self.bag else { return Ok(()) };
        bag.caps.reached(session.id, snapshot).iter().for_each(|line| (self.say)(line));
        bag.snapshot(session, snapshot)
    }

    pub(super) fn diagnostics(&mut self, report: &DiagnosticArray) -> Result<(), WriteError> {
        let report = || Outgoing::Diagnostics(report.clone());
        self.bag.as_mut().map_or(Ok(()), |file| file.put(|bag| bag.put(&report())))
    }

    /// A session ends: what a report tells is the map, which begins anew; the result bag goes on in time.
    pub(super) fn jumped_back(&mut self, seconds: f64) {
        if let Some(story) = &mut self.story {
            *story = Story::new();
        }
        if let Some(ResultFile { bag: Ok(bag), .. }) = &mut self.bag {
            bag.begin_session(seconds);
        }
    }

    /// Where a camera's frame is that no transform of the input places.
    pub(super) fn level(&mut self, body: &TransformStamped) {
        if let Some(file) = &mut self.bag {
            file.level = Some(body.clone());
        }
    }

    /// A scan of this stamp is taken in.
    pub(super) fn scan(&mut self, stamp: Stamp, origin: Origin) -> Result<(), WriteError> {
        let Some(file) = &mut self.bag else { return Ok(()) };
        file.put(|bag| bag.scan(origin.sensor, stamp, origin.recorded))?;
        let Some(mut level) = file.level.take() else { return Ok(()) };
        level.header.stamp = stamp.into();
        file.put(|bag| bag.transforms(&TfMessage { transforms: vec![level] }, true))
    }

    pub(super) fn message(&mut self, message: &Message) -> Result<(), WriteError> {
        let Some(file) = &mut self.bag else { return Ok(()) };
        let is_own = file.bag.as_ref().is_ok_and(|bag| bag.replaces(message));
        if is_own && file.said_own.is_due(message.topic(), 1) {
            (self.say)(&format!(
                "{} of the input is not copied: the result has a topic of that name",
                message.topic()
            ));
        }
        file.put(|bag| bag.input(message))
    }

    pub(super) fn finish(&mut self) -> Result<(), WriteError> {
        self.bag.take().map_or(Ok(()), ResultFile::finish)
    }
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> WriteError + use<> {
    let path = path.to_owned();
    move |source| WriteError { path, source }
}

/// Where the map goes when a replay has ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MapFiles {
    /// `S.json`.
    pub summary: Option<PathBuf>,
    /// `V.csv`.
    pub voxels: Option<PathBuf>,
    /// `C.json`.
    pub clusters: Option<PathBuf>,
    /// `P.ply`.
    pub ply: Option<PathBuf>,
}

/// [`MapFiles`] that can be written: found out before the work, not after it.
#[derive(Debug)]
pub struct OpenMapFiles {
    summary: Option<WholeFile>,
    voxels: Option<WholeFile>,
    clusters: Option<WholeFile>,
    ply: Option<WholeFile>,
}

impl MapFiles {
    /// Begins each file that is asked for.
    ///
    /// # Errors
    /// At the first that cannot be made; none of them is left.
    pub fn create(&self) -> Result<OpenMapFiles, WriteError> {
        let create = |path: &Option<PathBuf>| path.as_deref().map(WholeFile::create).transpose();
        Ok(OpenMapFiles {
            summary: create(&self.summary)?,
            voxels: create(&self.voxels)?,
            clusters: create(&self.clusters)?,
            ply: create(&self.ply)?,
        })
    }
}

impl OpenMapFiles {
    /// Writes the map and the account; what can be written is, whatever becomes of the others. Gives the errors of those.
    pub fn write(self, session: &Session, map: &Snapshot, summary: &Summary) -> Vec<WriteError> {
        let written = [
            complete(self.voxels, |out| write_voxels(out, map)),
            complete(self.clusters, |out| write_clusters(out, session, map)),
            complete(self.ply, |out| write_ply(out, map)),
            complete(self.summary, |out| writeln!(out, "{:#}", summary.json())),
        ];
        written.into_iter().filter_map(Result::err).collect()
    }
}

fn complete(
    file: Option<WholeFile>,
    write: impl FnOnce(&mut WholeFile) -> io::Result<()>,
) -> Result<(), WriteError> {
    file.map_or(Ok(()), |file| file.complete(write))
}
