//! What the node reports of itself once a second on `/diagnostics`.

use std::fmt::Display;
use std::time::{Duration, Instant};

use super::{Live, QUIET};
use crate::engine::Stamp;
use crate::line::one_line;
use crate::memory::resident_mb;
use crate::msg::reports::{DiagnosticArray, DiagnosticStatus, KeyValue, Level};
use crate::msg::ros::Header;
use crate::node::counts::Counts;
use crate::node::inputs;
use crate::node::transport::{Source, Transport};

/// Stamps may be so far ahead of the clock until it is said.
pub(super) const AHEAD: f64 = 1.0;

/// And so far behind it: the path from the sensor takes no such time.
const BEHIND: f64 = 10.0;

/// What was counted when the last report was made, and what has happened since: the next one is about the time between.
#[derive(Debug)]
pub(super) struct Before {
    at: Instant,
    counts: Counts,
    /// The longest that a scan has waited for its transform since.
    pub(super) longest_wait: Duration,
    /// What the newest cloud without a transform lacked.
    pub(super) without_transform: Option<String>,
    /// How many sessions a jump has begun, and what is to be said of the newest.
    pub(super) jumps: u64,
    pub(super) jump: Option<String>,
}

impl Before {
    pub(super) fn new(at: Instant) -> Self {
        Self {
            at,
            counts: Counts::default(),
            longest_wait: Duration::ZERO,
            without_transform: None,
            jumps: 0,
            jump: None,
        }
    }
}

/// A part of the node, with the worst that is to be said of it.
struct Part {
    status: DiagnosticStatus,
    level: Level,
}

impl Part {
    fn new(node: &str, part: &str, fine: impl Into<String>) -> Self {
        let name = format!("{}: {part}", node.trim_start_matches('/'));
        Self {
            status: DiagnosticStatus { name, message: fine.into(), ..Default::default() },
            level: Level::Ok,
        }
    }

    fn value(&mut self, key: impl Into<String>, value: impl Display) -> &mut Self {
        self.status.values.push(KeyValue { key: key.into(), value: value.to_string() });
        self
    }

    /// Says this, with what was said before where that is as bad, alone where that is better.
    fn raise(&mut self, level: Level, line: impl AsRef<str>) {
        let line = one_line(line.as_ref());
        if level > self.level {
            self.level = level;
            self.status.message = line.into_owned();
        } else if level == self.level {
            self.status.message += "; ";
            self.status.message += &line;
        }
    }

    fn finish(mut self) -> DiagnosticStatus {
        self.status.level = self.level as u8;
        self.status
    }
}

impl<T: Transport> Live<T> {
    /// Sends a report about the time since the last one.
    pub(super) fn report(&mut self) {
        // A reader that takes none of them must not hold up the node: what is not reported now is in the next one.
        let Ok(place) = self.reports.clone().try_reserve_owned() else { return };
        let clock = self.clocks.now();
        let seconds = self.before.at.elapsed().as_secs_f64().max(1e-3);
        let is_quiet = self.intakes.iter().any(|intake| intake.since.elapsed() >= QUIET);
        let sources = if is_quiet { self.transport.sources() } else { Vec::new() };
        let mut status: Vec<_> = (0..self.intakes.len())
            .map(|sensor| self.of_sensor(sensor, (seconds, clock), &sources))
            .collect();
        status.extend([self.of_transforms(), self.of_engine(seconds), self.of_map(), self.of_network()]);
        for intake in &mut self.intakes {
            intake.begin_second();
        }
        self.before = Before::new(Instant::now());
        self.before.counts = self.counts.borrow().clone();
        let report = DiagnosticArray { header: Header { stamp: clock.into(), ..Header::default() }, status };
        place.send(report);
    }

    fn part(&self, part: &str, fine: impl Into<String>) -> Part {
        Part::new(self.transport.node_name(), part, fine)
    }

    fn of_sensor(
        &self,
        sensor: usize,
        (seconds, clock): (f64, Stamp),
        sources: &[Source],
    ) -> DiagnosticStatus {
        let (intake, topics) = (&self.intakes[sensor], &self.transport.inputs()[sensor]);
        let topic = intake.chosen.and_then(|form| topics.topic(form)).map(str::to_owned);
        let topic = topic.unwrap_or_else(|| inputs::reads(topics));
        let rate = intake.received as f64 / seconds;
        let mut part = self.part(&format!("sensor {}", topics.name), format!("{rate:.1} scans/s on {topic}"));
        part.value("topic", &topic).value("rate [Hz]", format!("{rate:.2}"));
        part.value("lost", intake.lost).value("skipped", intake.skipped);
        if intake.since.elapsed() >= QUIET {
            let free = inputs::free(sensor, self.transport.inputs(), sources);
            let why = inputs::why_quiet(topics, intake.chosen, &free, intake.since.elapsed());
            part.raise(Level::Error, why);
        }
        let bad = intake.lost.saturating_add(intake.skipped);
        let sent = intake.received.saturating_add(intake.lost);
        if bad.saturating_mul(10) > sent {
            let level = if intake.is_useless() { Level::Error } else { Level::Warn };
            let why = intake.fault.as_ref().map(|error| self.why_unusable(sensor, error));
            let why = why.map_or_else(String::new, |why| format!("; why the last cannot: {why}"));
            part.raise(level, format!("{bad} of {sent} scans were lost or cannot be used{why}"));
        }
        if let Some(why) = intake.blindness.as_ref().filter(|_| intake.blind * 2 > intake.received) {
            let (blind, received) = (intake.blind, intake.received);
            let line = format!("{blind} of {received} scans show next to nothing; the last: {why}");
            part.raise(Level::Warn, line);
        }
        if let Some(stamp) = intake.newest {
            let age = clock.seconds_since(stamp);
            part.value("age of the newest [s]", format!("{age:.3}"));
            if age < -AHEAD {
                part.raise(Level::Warn, format!("its stamps are {:.1} s ahead of the clock", -age));
            } else if age > BEHIND {
                part.raise(
                    Level::Warn,
                    format!("its stamps are {age:.1} s behind the clock (a bag is played with --clock and use_sim_time)"),
                );
            }
        }
        part.finish()
    }

    fn since_before(&self, reason: &str) -> u64 {
        let skipped = |counts: &Counts| counts.skipped.get(reason).copied().unwrap_or_default();
        skipped(&self.counts.borrow()) - skipped(&self.before.counts)
    }

    fn of_transforms(&self) -> DiagnosticStatus {
        let Self { before, join, fixed_frame, .. } = self;
        let mut part = self.part("transforms", format!("every scan has its way to `{fixed_frame}`"));
        let given_up = self.since_before("transform_timeout") + self.since_before("waiting_queue_full");
        part.value("scans that wait", join.waiting());
        part.value("longest wait [s]", format!("{:.3}", before.longest_wait.as_secs_f64()));
        part.value("given up", given_up);
        if given_up > 0 {
            let taken_in = self.counts.borrow().taken_in > before.counts.taken_in;
            let level = if taken_in { Level::Warn } else { Level::Error };
            part.raise(level, before.without_transform.clone().unwrap_or_default());
        } else if join.longest_wait(self.clocks.elapsed()) >= QUIET.max(self.tf_timeout)
            && let Some((_, Some(lacks))) = join.oldest()
        {
            // None is given up while a simulated clock is halted.
            part.raise(Level::Warn, lacks.to_string());
        }
        part.finish()
    }

    fn of_engine(&self, seconds: f64) -> DiagnosticStatus {
        let mut took = std::mem::take(&mut self.vitals.borrow_mut().took);
        took.sort_unstable();
        let ms =
            |took: Option<&Duration>| format!("{:.2}", took.map_or(0.0, |took| took.as_secs_f64() * 1e3));
        let (counts, before) = (self.counts.borrow(), &self.before.counts);
        let replaced = counts.replaced - before.replaced;
        let rate = (counts.taken_in - before.taken_in) as f64 / seconds;
        let mut part = self.part("engine", format!("{rate:.1} scans/s taken in"));
        part.value("rate [Hz]", format!("{rate:.2}"));
        part.value("engine, median [ms]", ms(took.get(took.len() / 2)));
        part.value("engine, longest [ms]", ms(took.last()));
        part.value("received in all", counts.received).value("taken in in all", counts.taken_in);
        part.value("replaced in all", counts.replaced).value("lost in all", counts.lost);
        for (reason, number) in &counts.skipped {
            part.value(format!("skipped in all, {reason}"), number);
        }
        if replaced > 0 {
            part.raise(
                Level::Warn,
                format!("slower than the sensors: {replaced} scans were replaced by newer ones"),
            );
        }
        part.finish()
    }

    fn of_map(&self) -> DiagnosticStatus {
        let mut part = self.part("map", "empty");
        if let Some(map) = self.vitals.borrow().map.filter(|map| map.session == self.session) {
            let (clusters, voxels) = (map.clusters, map.dense_voxels);
            part.status.message = format!("clusters: {clusters}; dense voxels: {voxels}");
            part.value("clusters", clusters).value("dense voxels", voxels);
            part.value("unclustered voxels", map.unclustered_voxels).value("sequence", map.sequence);
        }
        part.value("session", self.session).value("sessions begun by a jump", self.before.jumps);
        if let Some(jump) = &self.before.jump {
            part.raise(Level::Warn, jump);
        }
        let points = std::mem::take(&mut self.vitals.borrow_mut().points);
        part.value("points beyond the grid", points.beyond_grid);
        if points.beyond_grid.saturating_mul(10) > points.all {
            part.raise(Level::Warn, self.reach.line(points));
        }
        let now = Instant::now();
        if let Some(age) = self.saving_figures.age(now) {
            part.value("age of the saved map [s]", format!("{:.1}", age.as_secs_f64()));
        }
        if let Some(fault) = self.saving_figures.fault(now) {
            part.raise(Level::Warn, fault);
        }
        if let Some(line) = self.vitals.borrow().left_out(self.session) {
            part.raise(Level::Warn, line);
        }
        if let Some(memory) = resident_mb() {
            part.value("memory [MB]", format!("{memory:.1}"));
        }
        part.finish()
    }

    fn of_network(&mut self) -> DiagnosticStatus {
        let network = self.transport.network_state();
        let wish = self.receive_buffer;
        let mut part = self.part("network", "every reader and publisher fits");
        if let Some(got) = network.receive_buffer {
            part.value("socket receive buffer [bytes]", got);
        }
        for (topic, why) in network.mismatches {
            part.value(topic.clone(), &why);
            part.raise(Level::Warn, format!("{topic}: {why}"));
            self.warn(format!("{topic}: {why}"), format_args!("{topic}: {why}"));
        }
        if network.namesakes > 0 {
            let line = namesakes(self.transport.node_name(), network.namesakes);
            part.value("other nodes of its name", network.namesakes);
            part.raise(Level::Warn, &line);
            self.warn("namesakes", format_args!("{line}"));
        }
        if let Some(got) = network.receive_buffer.filter(|&got| got < wish) {
            part.raise(
                Level::Warn,
                format!("the socket receive buffer has {got} bytes instead of {wish}: sudo sysctl -w net.core.rmem_max={wish}"),
            );
        }
        part.finish()
    }
}

/// What is to be said of other nodes of this node's name. Both work, which is what ROS has them do.
fn namesakes(name: &str, number: usize) -> String {
    format!(
        "nodes of the name {name} beside this one: {number}; who calls its services or sets its parameters reaches any of them \
         (-r __node:=... renames)"
    )
}
