//! What the node reports of itself once a second on `/diagnostics`.

use std::time::Instant;

use super::intake::{LeftOut, Period};
use super::say::{why_no_transforms, with_hint};
use super::{Live, QUIET};
use crate::count::{count_of, were};
use crate::engine::Stamp;
use crate::join::{GivenUp, TransformsFrom};
use crate::msg::reports::{DiagnosticArray, DiagnosticStatus, Level};
use crate::msg::ros::Header;
use crate::msg::status::StatusBuilder;
use crate::node::inputs;
use crate::node::throttle::log;
use crate::node::transport::{NetworkState, Source, Transport};

/// Stamps may be so far ahead of the clock until it is said.
pub(super) const AHEAD: f64 = 1.0;

/// Stamps may be so far behind the clock until it is said: the path from the sensor takes no such time.
const BEHIND: f64 = 10.0;

impl<T: Transport> Live<T> {
    /// Sends a report about the time since the last one.
    pub(super) fn report(&mut self) {
        let is_quiet = self.intakes.iter().any(|intake| intake.since.elapsed() >= QUIET);
        let sources = if is_quiet { self.transport.sources() } else { Vec::new() };
        if is_quiet {
            self.forget_gone(&sources);
        }
        // A reader that takes none of them must not hold up the node: what is not reported now is in the next one.
        let Ok(place) = self.reports.clone().try_reserve_owned() else { return };
        let clock = self.clocks.now();
        let seconds = self.diagnosis.seconds();
        let mut status: Vec<_> = (0..self.intakes.len())
            .map(|sensor| self.of_sensor(sensor, (seconds, clock), &sources))
            .collect();
        let network = self.transport.network_state();
        self.say_network(&network);
        self.look_for_riding();
        self.say_residual();
        let diagnosis = &self.diagnosis;
        let without: Vec<_> =
            self.intakes.iter().filter_map(|intake| intake.period.without_transform.clone()).collect();
        let (fixed_frame, waiting) = (&self.fixed_frame, self.join.waiting());
        let transforms = diagnosis.of_transforms(fixed_frame, waiting, &without, self.halted());
        let (engine, map) = (diagnosis.of_engine(), diagnosis.of_map(self.session));
        status.extend([transforms, engine, map, diagnosis.of_network(&network)]);
        for (sensor, intake) in self.intakes.iter_mut().enumerate() {
            intake.begin_period(self.diagnosis.vitals.borrow().taken_in(sensor) > 0);
        }
        self.diagnosis.begin_period();
        let report = DiagnosticArray { header: Header { stamp: clock.into(), ..Header::default() }, status };
        place.send(report);
    }

    /// Says it once where points are farther off their surfaces than is explained.
    fn say_residual(&mut self) {
        if let Some(line) = self.diagnosis.residual(self.session)
            && self.throttle.allows_once("residual", Instant::now())
        {
            log(tracing::Level::WARN, &line);
        }
    }

    /// Says it once where the fixed frame moves, and the sensor with it.
    pub(super) fn look_for_riding(&mut self) {
        if let Some(line) = self.join.riding(&self.fixed_frame) {
            if self.throttle.allows_once("tf_riding", Instant::now()) {
                log(tracing::Level::WARN, &line);
            }
            self.diagnosis.doubt("tf_riding", line);
        }
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
        let rate = intake.period.received as f64 / seconds;
        let mut part =
            self.diagnosis.part(&format!("sensor {}", topics.name), format!("{rate:.1} scans/s on {topic}"));
        part.value("topic", &topic).value("rate [Hz]", format!("{rate:.2}"));
        part.value("lost", intake.period.lost).value("skipped", intake.period.skipped);
        self.add_silence(&mut part, sensor, sources);
        self.add_bad(&mut part, sensor);
        add_blindness(&mut part, &intake.period);
        if let Some(stamp) = intake.newest {
            self.add_age(&mut part, clock.seconds_since(stamp));
        }
        self.add_taken_in(&mut part, sensor, clock);
        part.finish()
    }

    /// Why none of a sensor comes, where that is so.
    fn add_silence(&self, part: &mut StatusBuilder, sensor: usize, sources: &[Source]) {
        let (intake, inputs) = (&self.intakes[sensor], self.transport.inputs());
        let silence = intake.since.elapsed();
        if silence >= QUIET {
            let free = inputs::free(sensor, inputs, sources);
            let quiet = (silence, intake.newest.is_none().then(|| self.transport.silences()));
            part.raise(Level::Error, inputs::why_quiet(&inputs[sensor], intake.chosen, &free, quiet));
        }
    }

    /// Scans of a sensor that never arrived or cannot be used, where they are more than a tenth.
    fn add_bad(&self, part: &mut StatusBuilder, sensor: usize) {
        let intake = &self.intakes[sensor];
        let Period { received, skipped, lost, ref fault, .. } = intake.period;
        let (bad, sent) = (lost.saturating_add(skipped), received.saturating_add(lost));
        if bad.saturating_mul(10) > sent {
            let level = if intake.is_useless() { Level::Error } else { Level::Warn };
            let why = fault.as_ref().map(|error| self.why_unusable(sensor, error));
            let why = why.map_or_else(String::new, |why| format!("; why the last cannot: {why}"));
            let (sent, were) = (count_of(sent, "scan"), were(bad));
            part.raise(level, format!("{bad} of {sent} {were} lost or cannot be used{why}"));
        }
    }

    /// How old the newest scan of a sensor is (s).
    fn add_age(&self, part: &mut StatusBuilder, age: f64) {
        part.value("age of the newest [s]", format!("{age:.3}"));
        if let Some(line) = self.say_age(age) {
            part.raise(Level::Warn, line);
        }
    }

    /// What of a sensor the map has: scans that come may all be given up, while those of others are taken in.
    fn add_taken_in(&self, part: &mut StatusBuilder, sensor: usize, clock: Stamp) {
        let (intake, vitals) = (&self.intakes[sensor], self.diagnosis.vitals.borrow());
        let taken_in = vitals.taken_in(sensor);
        part.value("taken in", taken_in).value("given up", intake.period.given_up);
        if let Some(stamp) = vitals.newest_of(sensor, self.session) {
            part.value("age of the newest taken in [s]", format!("{:.3}", clock.seconds_since(stamp)));
        }
        let is_left_out = taken_in == 0 && intake.since.elapsed() < QUIET;
        if let Some(LeftOut { since, why }) = intake.left_out.as_ref().filter(|_| is_left_out) {
            let level = if since.elapsed() >= QUIET { Level::Error } else { Level::Warn };
            part.raise(level, format!("none of its scans is taken into the map; why one is not: {why}"));
        }
    }

    /// What is to be said of stamps of this age (s).
    fn say_age(&self, age: f64) -> Option<String> {
        let line = if age < -AHEAD {
            format!("its stamps are {:.1} s ahead of the clock", -age)
        } else if age <= BEHIND {
            return None;
        } else if self.clocks.is_simulated() {
            format!("its stamps are {age:.1} s behind the clock")
        } else {
            format!(
                "its stamps are {age:.1} s behind the clock (a bag is played with --clock and use_sim_time)"
            )
        };
        Some(
            [Some(line), self.clocks.fault(Instant::now())]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join("; "),
        )
    }

    /// Why scans wait on: the simulated clock, and what the oldest of them lacks.
    fn halted(&self) -> Option<String> {
        let whys: Vec<_> = self.clocks.fault(Instant::now()).into_iter().chain(self.stuck()).collect();
        (!whys.is_empty()).then(|| whys.join("; "))
    }

    /// What the oldest scan lacks that waits for its transform, and what helps, where it has waited too long: none is given up while
    /// a simulated clock is halted.
    fn stuck(&self) -> Option<String> {
        if self.join.longest_wait(self.clocks.elapsed().into()) < QUIET.max(self.tf_timeout) {
            return None;
        }
        let (_, lacks) = self.join.oldest()?;
        // As that of a scan which waits until the end, whatever tf_timeout is.
        let why_none = || why_no_transforms(&*self.transport);
        lacks.map(|lacks| {
            with_hint(
                lacks.to_string(),
                self.join.hint(Some(lacks), GivenUp::AtEnd, TransformsFrom::Network, why_none),
            )
        })
    }

    /// Says of each thing that does not fit when it begins, again and again while it lasts, and when it is over.
    pub(super) fn say_network(&mut self, network: &NetworkState) {
        let mut lines: Vec<_> =
            network.mismatches.iter().map(|(topic, why)| format!("{topic}: {why}")).collect();
        if network.namesakes > 0 {
            lines.push(self.diagnosis.namesakes(network.namesakes));
        }
        // What comes and goes every second begins as often: it is said where it still is so when its turn comes.
        let now = Instant::now();
        for line in self.lasting.due(&lines, now) {
            if self.throttle.allows(line.clone(), now) {
                log(tracing::Level::WARN, &line);
            } else {
                self.lasting.put_off(&line);
            }
        }
        for line in self.lasting.over(&lines) {
            log(
                self.throttle.level_now(format!("over {line}"), tracing::Level::INFO),
                &format!("it is over: {line}"),
            );
        }
    }
}

/// Scans of a sensor that show next to nothing, where they are more than half.
fn add_blindness(part: &mut StatusBuilder, &Period { received, blind, ref blindness, .. }: &Period) {
    if let Some(why) = blindness.as_ref().filter(|_| blind * 2 > received) {
        let received = count_of(received, "scan");
        part.raise(Level::Warn, format!("next to nothing is seen in {blind} of {received}; the last: {why}"));
    }
}
