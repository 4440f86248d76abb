//! What the node knows of its engine, its map and its network for the reports on `/diagnostics`; what is heard of the sensors
//! stands beside them. No worker is needed to tell it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::saving_figures::SavingFigures;
use crate::config::Config;
use crate::count::count_of;
use crate::engine::Params;
use crate::memory::resident_mb;
use crate::msg::reports::{DiagnosticStatus, Level};
use crate::msg::status::StatusBuilder;
use crate::node::counts::{Counts, TRANSFORM_TIMEOUT, WAITING_QUEUE_FULL};
use crate::node::publish::Seen;
use crate::node::transport::NetworkState;
use crate::node::vitals::Vitals;
use crate::reach::Reach;
use crate::reason::Reason;
use crate::residual;

/// What has happened since the last report: the next one is about that.
#[derive(Debug)]
struct Period {
    start: Instant,
    /// The longest that a scan has waited for its transform.
    longest_wait: Duration,
    /// How many transforms were refused, and why the newest was.
    refused: u64,
    refusal: Option<String>,
    /// Why the map may be wrong though scans have their transforms; of each kind the newest.
    doubts: BTreeMap<&'static str, String>,
    /// How many sessions a jump has begun, and what is to be said of the newest.
    jumps: u64,
    jump: Option<String>,
}

impl Period {
    const fn new(start: Instant) -> Self {
        Self {
            start,
            longest_wait: Duration::ZERO,
            refused: 0,
            refusal: None,
            doubts: BTreeMap::new(),
            jumps: 0,
            jump: None,
        }
    }
}

#[derive(Debug)]
pub(super) struct Diagnosis {
    /// Fully qualified.
    node: String,
    counts: Rc<RefCell<Counts>>,
    pub(super) vitals: Rc<RefCell<Vitals>>,
    /// What was counted when the last report was made.
    before: Counts,
    period: Period,
    pub(super) saving: SavingFigures,
    reach: Reach,
    /// Those that the session began with.
    engine: Params,
    /// What was asked for (bytes).
    receive_buffer: usize,
}

impl Diagnosis {
    pub(super) fn new(config: &Config, node: &str, Seen { counts, vitals }: Seen, start: Instant) -> Self {
        Self {
            node: node.to_owned(),
            counts,
            vitals,
            before: Counts::default(),
            period: Period::new(start),
            saving: SavingFigures::default(),
            reach: Reach::new(config.fixed_frame.clone(), config.engine.voxel_size()),
            engine: config.engine,
            receive_buffer: config.receive_buffer,
        }
    }

    /// A scan has waited so long for its transform.
    pub(super) fn waited(&mut self, waited: Duration) {
        self.period.longest_wait = self.period.longest_wait.max(waited);
    }

    /// A transform was refused, for this reason.
    pub(super) fn refused(&mut self, why: String) {
        self.period.refused += 1;
        self.period.refusal = Some(why);
    }

    /// Every scan may have its way, and the map be wrong all the same, as this line says.
    pub(super) fn doubt(&mut self, kind: &'static str, line: String) {
        self.period.doubts.insert(kind, line);
    }

    /// A jump has begun a session.
    pub(super) fn jumped(&mut self, line: String) {
        self.period.jumps += 1;
        self.period.jump = Some(line);
    }

    /// Whether the map in the file is that of the engine; not where none was seen yet.
    pub(super) fn is_saved(&mut self, now: Instant) -> bool {
        let newest = self.vitals.borrow().newest;
        newest.is_some_and(|newest| self.saving.has(newest, now))
    }

    /// Since the last report (s).
    pub(super) fn seconds(&self) -> f64 {
        self.period.start.elapsed().as_secs_f64().max(1e-3)
    }

    /// A report was made.
    pub(super) fn begin_period(&mut self) {
        self.before.clone_from(&self.counts.borrow());
        self.period = Period::new(Instant::now());
        self.vitals.borrow_mut().begin_period();
    }

    pub(super) fn part(&self, part: &str, fine: impl Into<String>) -> StatusBuilder {
        StatusBuilder::new(&self.node, part, fine)
    }

    fn since_before(&self, reason: Reason) -> u64 {
        let skipped = |counts: &Counts| counts.skipped.get(&reason).copied().unwrap_or_default();
        skipped(&self.counts.borrow()) - skipped(&self.before)
    }

    /// Of the scans, `waiting` wait for their transform; `without` is why one of each sensor was given up, where any was, and `halted`
    /// why they wait on, where they do.
    pub(super) fn of_transforms(
        &self,
        fixed_frame: &str,
        waiting: usize,
        without: &[String],
        halted: Option<String>,
    ) -> DiagnosticStatus {
        let period = &self.period;
        let mut part = self.part("transforms", format!("every scan has its way to `{fixed_frame}`"));
        let given_up = self.since_before(TRANSFORM_TIMEOUT) + self.since_before(WAITING_QUEUE_FULL);
        part.value("scans that wait", waiting);
        part.value("longest wait [s]", format!("{:.3}", period.longest_wait.as_secs_f64()));
        part.value("given up", given_up).value("refused", period.refused);
        let has_map = given_up == 0 || self.counts.borrow().taken_in > self.before.taken_in;
        let level = if has_map { Level::Warn } else { Level::Error };
        // The scans that were given up may lack these: both are said.
        if let Some(why) = &period.refusal {
            part.raise(level, format!("transforms refused: {}; the last: {why}", period.refused));
        }
        for line in period.doubts.values() {
            part.raise(Level::Warn, line);
        }
        if given_up > 0 {
            part.raise(level, without.join("; "));
        } else if let Some(why) = halted {
            part.raise(Level::Warn, why);
        }
        part.finish()
    }

    pub(super) fn of_engine(&self) -> DiagnosticStatus {
        let vitals = self.vitals.borrow();
        let mut took = vitals.took.clone();
        took.sort_unstable();
        let ms =
            |took: Option<&Duration>| format!("{:.2}", took.map_or(0.0, |took| took.as_secs_f64() * 1e3));
        let (counts, before) = (self.counts.borrow(), &self.before);
        let replaced = counts.replaced - before.replaced;
        let rate = (counts.taken_in - before.taken_in) as f64 / self.seconds();
        let mut part = self.part("engine", format!("{rate:.1} scans/s taken in"));
        part.value("rate [Hz]", format!("{rate:.2}"));
        part.value("engine, median [ms]", ms(took.get(took.len() / 2)));
        part.value("engine, longest [ms]", ms(took.last()));
        part.value("held up for a snapshot, newest [ms]", ms(Some(&vitals.snapshot_took.freezing)));
        part.value("snapshot, newest [ms]", ms(Some(&vitals.snapshot_took.making)));
        part.value("received in all", counts.received).value("taken in in all", counts.taken_in);
        part.value("replaced in all", counts.replaced).value("lost in all", counts.lost);
        for (reason, number) in &counts.skipped {
            part.value(format!("skipped in all, {}", reason.key), number);
        }
        if replaced > 0 {
            part.raise(
                Level::Warn,
                format!("slower than the sensors: {} replaced by newer ones", count_of(replaced, "scan")),
            );
        }
        part.finish()
    }

    /// What is to be said where points are farther off their surfaces than noise and `pose_sigma` explain.
    pub(super) fn residual(&self, session: u64) -> Option<String> {
        let beyond_noise = self.vitals.borrow().beyond_noise(session)?;
        residual::line(beyond_noise, &self.engine)
    }

    pub(super) fn of_map(&self, session: u64) -> DiagnosticStatus {
        let (vitals, mut part) = (self.vitals.borrow(), self.part("map", "empty"));
        if let Some(map) = vitals.map.filter(|map| map.version.session == session) {
            let (clusters, voxels) = (map.clusters, map.dense_voxels);
            part.status.message = format!("clusters: {clusters}; dense voxels: {voxels}");
            part.value("clusters", clusters).value("dense voxels", voxels);
            let sequence = map.version.sequence;
            part.value("unclustered voxels", map.unclustered_voxels).value("sequence", sequence);
            // They are those of the newest snapshot, which is made seldom where publish_rate is low or the map large.
            let newest = vitals.newest.filter(|newest| newest.session == session);
            let since = newest.map_or(0, |newest| newest.sequence.saturating_sub(sequence));
            part.value("scans taken in since these figures", since);
        }
        part.value("session", session).value("sessions begun by a jump", self.period.jumps);
        if let Some(jump) = &self.period.jump {
            part.raise(Level::Warn, jump);
        }
        let points = vitals.points;
        part.value("points beyond the grid", points.beyond_grid);
        if points.beyond_grid.saturating_mul(10) > points.all {
            part.raise(Level::Warn, self.reach.line(points));
        }
        let now = Instant::now();
        if let Some(age) = self.saving.age(now) {
            part.value("age of the saved map [s]", format!("{:.1}", age.as_secs_f64()));
        }
        if let Some(fault) = self.saving.fault(now) {
            part.raise(Level::Warn, fault);
        }
        if let Some(line) = vitals.left_out(session) {
            part.raise(Level::Warn, line);
        }
        if let Some(metres) = vitals.beyond_noise(session) {
            part.value("off surfaces beyond noise [mm]", format!("{:.1}", metres * 1e3));
        }
        if let Some(line) = self.residual(session) {
            part.raise(Level::Warn, line);
        }
        if let Some(memory) = resident_mb() {
            part.value("memory [MB]", format!("{memory:.1}"));
        }
        part.finish()
    }

    pub(super) fn of_network(&self, network: &NetworkState) -> DiagnosticStatus {
        let wish = self.receive_buffer;
        let mut part = self.part("network", "every reader and publisher fits");
        if let Some(got) = network.receive_buffer {
            part.value("socket receive buffer [bytes]", got);
        }
        for (topic, why) in &network.mismatches {
            part.value(topic, why);
            part.raise(Level::Warn, format!("{topic}: {why}"));
        }
        if network.namesakes > 0 {
            part.value("other nodes of its name", network.namesakes);
            part.raise(Level::Warn, self.namesakes(network.namesakes));
        }
        if network.without_router {
            part.raise(Level::Warn, "the router has gone, without which others are not found");
        }
        if let Some(got) = network.receive_buffer.filter(|&got| got < wish) {
            part.raise(
                Level::Warn,
                format!("the socket receive buffer has {got} bytes instead of {wish}: sudo sysctl -w net.core.rmem_max={wish}"),
            );
        }
        part.finish()
    }

    /// What is to be said of other nodes of this node's name. Both work, which is what ROS has them do.
    pub(super) fn namesakes(&self, number: usize) -> String {
        let name = &self.node;
        format!(
            "nodes of the name {name} beside this one: {number}; who calls its services or sets its parameters reaches any of \
             them (-r __node:=... renames)"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Value;
    use crate::engine::Stamp;
    use crate::msg::clusters::MapVersion;
    use crate::msg::labelled::MAX_LABELLED;
    use crate::node::vitals::MapSize;
    use crate::reach::Points;

    fn diagnosis() -> Diagnosis {
        Diagnosis::new(&Config::new([]).unwrap(), "/robot/cfodi", Seen::default(), Instant::now())
    }

    fn value(status: &DiagnosticStatus, key: &str) -> String {
        status.values.iter().find(|value| value.key == key).unwrap().value.clone()
    }

    #[test]
    fn a_report_is_about_the_time_since_the_one_before() {
        let mut diagnosis = diagnosis();
        diagnosis.counts.borrow_mut().skip(TRANSFORM_TIMEOUT);
        diagnosis.refused("no rotation".to_owned());
        diagnosis.waited(Duration::from_millis(200));
        diagnosis.waited(Duration::from_millis(100));
        diagnosis.jumped("a jump".to_owned());
        let said = |diagnosis: &Diagnosis| {
            let transforms = diagnosis.of_transforms("odom", 0, &["no way".to_owned()], None);
            let map = diagnosis.of_map(1);
            let figures = ["given up", "refused", "longest wait [s]"].map(|key| value(&transforms, key));
            (transforms.level, transforms.message, figures, (map.level, map.message))
        };
        let figures = ["1", "1", "0.200"].map(str::to_owned);
        let line = "transforms refused: 1; the last: no rotation; no way";
        assert_eq!(said(&diagnosis), (2, line.to_owned(), figures, (1, "a jump".to_owned())));
        diagnosis.begin_period();
        let (fine, figures) = ("every scan has its way to `odom`", ["0", "0", "0.000"].map(str::to_owned));
        assert_eq!(said(&diagnosis), (0, fine.to_owned(), figures, (0, "empty".to_owned())));
        assert_eq!(value(&diagnosis.of_engine(), "skipped in all, transform_timeout"), "1");
    }

    #[test]
    fn what_the_engine_has_done_is_told_the_same_until_the_report_was_made_and_then_no_more() {
        let mut diagnosis = diagnosis();
        let (version, points) = (MapVersion { session: 1, sequence: 1 }, Points { all: 20, beyond_grid: 1 });
        diagnosis.vitals.borrow_mut().note_scan(
            version,
            (0, Stamp::default()),
            Duration::from_millis(5),
            points,
        );
        let told = |diagnosis: &Diagnosis| {
            let (engine, map) = (diagnosis.of_engine(), diagnosis.of_map(1));
            (value(&engine, "engine, longest [ms]"), value(&map, "points beyond the grid"))
        };
        let figures = |took: &str, beyond_grid: &str| (took.to_owned(), beyond_grid.to_owned());
        assert_eq!([told(&diagnosis), told(&diagnosis)], [(); 2].map(|()| figures("5.00", "1")));
        diagnosis.begin_period();
        assert_eq!(told(&diagnosis), figures("0.00", "0"));
    }

    /// A simulated clock that is halted gives none up.
    #[test]
    fn a_scan_that_waits_too_long_is_a_warning_and_so_is_one_given_up_while_others_are_taken_in() {
        let diagnosis = diagnosis();
        let stuck = diagnosis.of_transforms("odom", 0, &[], Some("no frame `map`".to_owned()));
        assert_eq!((stuck.level, stuck.message.as_str()), (1, "no frame `map`"));
        diagnosis.counts.borrow_mut().skip(WAITING_QUEUE_FULL);
        diagnosis.counts.borrow_mut().taken_in += 1;
        let no_way = ["no way".to_owned()];
        let given_up = diagnosis.of_transforms("odom", 0, &no_way, Some("no frame `map`".to_owned()));
        assert_eq!((given_up.level, given_up.message.as_str()), (1, "no way"));
    }

    /// Snapshots are published seldom, or the map is so large that they take long.
    #[test]
    fn the_figures_of_a_map_tell_how_many_scans_have_been_taken_in_since() {
        let diagnosis = diagnosis();
        let since = |newest| {
            let version = MapVersion { session: 1, sequence: 9 };
            let map =
                MapSize { version, clusters: 0, dense_voxels: 0, unclustered_voxels: 0, beyond_noise: None };
            (diagnosis.vitals.borrow_mut().map, diagnosis.vitals.borrow_mut().newest) = (Some(map), newest);
            let map = diagnosis.of_map(1);
            ["sequence", "scans taken in since these figures"].map(|key| value(&map, key))
        };
        let version = |session, sequence| Some(MapVersion { session, sequence });
        assert_eq!(since(version(1, 609)), ["9", "600"]);
        // No scan since, and one of another session.
        assert_eq!([since(version(1, 9)), since(version(2, 20))], [["9", "0"]; 2]);
    }

    #[test]
    fn a_map_whose_points_are_off_their_surfaces_is_a_warning_where_pose_sigma_does_not_explain_it() {
        let said = |told: f64, beyond_noise| {
            let told = Config::new([("pose_sigma".to_owned(), Value::Double(told))]).unwrap();
            let diagnosis = Diagnosis::new(&told, "/robot/cfodi", Seen::default(), Instant::now());
            let version = MapVersion { session: 1, sequence: 9 };
            let map = MapSize { version, clusters: 8, dense_voxels: 9, unclustered_voxels: 7, beyond_noise };
            diagnosis.vitals.borrow_mut().map = Some(map);
            let [status, other] = [1, 2].map(|session| diagnosis.of_map(session));
            assert_eq!(other.level, 0, "that of a session that has ended");
            let metres = status.values.iter().find(|value| value.key == "off surfaces beyond noise [mm]");
            (status.level, status.message, metres.map(|value| value.value.clone()))
        };
        let (level, line, metres) = said(0.0, Some(0.031));
        assert_eq!((level, metres.as_deref()), (1, Some("31.0")));
        assert!(line.starts_with("points are 31 mm off their surfaces beyond the sensor's noise"), "{line}");
        assert_eq!([said(0.03, Some(0.031)).0, said(0.0, None).0], [0, 0]);
        assert_eq!(said(0.0, None).2, None, "not where it is not known");
    }

    #[test]
    fn a_map_of_more_voxels_than_a_message_shows_is_a_warning_for_as_long_as_it_is_so() {
        let diagnosis = diagnosis();
        let said = |session, more| {
            let dense_voxels = MAX_LABELLED + more;
            let version = MapVersion { session, sequence: 9 };
            let map =
                MapSize { version, clusters: 8, dense_voxels, unclustered_voxels: 7, beyond_noise: None };
            diagnosis.vitals.borrow_mut().map = Some(map);
            let status = diagnosis.of_map(1);
            (status.level, status.message)
        };
        let words = "~/points_labelled shows 1000000 of 1000001 dense voxels, of those in no cluster 7 of 7";
        assert_eq!([said(1, 1), said(1, 1)], [(1, words.to_owned()), (1, words.to_owned())]);
        assert_eq!([said(1, 0).0, said(2, 1).0], [0, 0], "it fits, or is that of a session that has ended");
    }
}
