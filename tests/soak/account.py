"""The account of a soak: where every scan went, by fault, and what is wrong."""

import collections
import dataclasses
import statistics

BEFORE = 0.5e9  # ns before a fault in which a scan may still be on its way, and so the fault's
MINUTE = 60  # s
TOLD = 20  # violations, and scans that are missing


@dataclasses.dataclass
class Window:
    """A fault, in ns of the clock that stamps are of."""

    name: str
    begin: int
    allowance: float  # s after its end in which it may cost scans; 0: it may cost none, nor while it lasts
    over: int = 0
    recovered: int = 0  # the last scan sent after its end that was not taken in; its end where there is none

    def has(self, stamp):
        return self.begin - BEFORE <= stamp <= self.recovered

    def excuses(self, stamp):
        return self.allowance > 0 and self.has(stamp) and stamp <= self.over + self.allowance * 1e9

    def took(self):
        """Seconds from its end until it cost no scan any more."""
        return (self.recovered - self.over) * 1e-9

    def late(self):
        return self.took() > self.allowance


class Account:
    def __init__(self, arguments, scans):
        self.arguments, self.scans = arguments, scans
        self.windows, self.counts = [], {}
        self._begin = 0

    def begins(self, at):
        """`at`: s of the clock that stamps are of."""
        self._begin = at

    def _after(self, stamp):
        return stamp * 1e-9 - self._begin

    def _fault(self, stamp):
        return next((window for window in self.windows if window.has(stamp)), None)

    def _not_taken_in(self, robot):
        """Stamps of scans that have no delta. The first were sent before the two met."""
        taken = robot.listener.taken
        first = min(taken)
        return [stamp for stamp in robot.sent() if stamp not in taken and stamp > first]

    def _unexcused(self, robot):
        """Those of them that no fault may cost."""
        return [stamp for stamp in self._not_taken_in(robot)
                if not any(window.excuses(stamp) for window in self.windows)]

    def _span(self):
        """Seconds that a level is the median of: from one moment to the next memory differs by some clouds."""
        return min(MINUTE, self.arguments.settle)

    def _levels(self, robot):
        """MB of each minute from when it had settled, by the second at which it began; the last ends with the run."""
        settle, span = self.arguments.settle, self._span()
        memory = [(after, mb) for at, mb in robot.listener.memory if (after := at - self._begin) >= settle]
        if not memory:
            return {}
        minutes = collections.defaultdict(list)
        for after, mb in memory:
            minutes[settle + (after - settle) // span * span].append(mb)
        # The last is cut short by the end, and goes as far back as a whole one.
        minutes[max(minutes)] = [mb for after, mb in memory if after > memory[-1][0] - span]
        return {begin: statistics.median(values) for begin, values in minutes.items()}

    def _growth(self, levels):
        """When its highest minute began, and by how much (%) it is above the first."""
        first, *others = levels
        highest = max(others, key=levels.get, default=first)
        return highest, (levels[highest] / levels[first] - 1) * 100

    def _unaccounted(self, robot):
        """Scans that were sent and that the node's counts do not speak of: sent before it and a driver had met."""
        counts = self.counts
        spoken = counts["taken_in"] + counts["replaced"] + counts["lost"] + sum(counts["skipped"].values())
        return len(robot.sent()) + robot.stranger.sent - spoken

    def wrong(self, robot):
        """What must not be, a line each."""
        follower, counts = robot.listener.follower, self.counts
        wrong = follower.violations[:TOLD] + self._wrong_losses(robot)
        if counts["received"] != counts["taken_in"] + counts["replaced"] + sum(counts["skipped"].values()):
            wrong.append(f"the counts do not add up: {counts}")
        first = min(robot.listener.taken)
        met = sum(stamp < first for stamp in robot.sent())
        explained = met + len(self._not_taken_in(robot)) + robot.stranger.sent
        if not -1 <= self._unaccounted(robot) <= explained:
            wrong.append(f"{self._unaccounted(robot)} scans are not in the counts, of {explained} not taken in")
        if follower.sessions != 1:
            wrong.append(f"{follower.sessions} sessions, not one")
        if not follower.compared:
            wrong.append("no snapshot was compared")
        if (levels := self._levels(robot)) and self.arguments.max_voxels:
            highest, growth = self._growth(levels)
            if growth > self.arguments.growth:
                wrong.append(f"memory has grown by {growth:.1f} % in the {self._span():g} s from {highest:.0f} s on")
        return wrong

    def _wrong_losses(self, robot):
        """Scans that are missing and that no fault excuses; faults that cost scans for longer than they may."""
        unexcused, wrong = self._unexcused(robot), []
        if too_many := len(unexcused) > self.arguments.allowed:
            when = ", ".join(f"{self._after(stamp):.2f} s ({self._named(stamp)})" for stamp in unexcused[:TOLD])
            wrong.append(f"{len(unexcused)} scans were not taken in and no fault excuses them, after {when}")
        for window in self.windows:
            # Where a fault may cost none, what is missing by chance makes it late; other allowances have room for chance.
            if window.late() and (window.allowance > 0 or too_many):
                wrong.append(f"{window.name}, after {self._after(window.begin):.0f} s: it cost scans until "
                             f"{window.took():.2f} s after its end, {window.allowance:g} s are allowed")
        return wrong

    def _named(self, stamp):
        return window.name if (window := self._fault(stamp)) else "no fault"

    def table(self, robot):
        listener, counts, arguments = robot.listener, self.counts, self.arguments
        minutes = (listener.memory[-1][0] - self._begin) / 60
        skipped = ", ".join(f"{reason} {number}" for reason, number in counts["skipped"].items()) or "none"
        not_taken_in = collections.Counter(map(self._named, self._not_taken_in(robot)))
        lines = [
            f"{minutes:.1f} minutes live: {self.scans} at {arguments.rate:g} Hz, a fault every {arguments.fault_every:g} s, "
            f"max_voxels {arguments.max_voxels}",
            f"scans: {len(robot.sent())} sent, {counts['taken_in']} taken in, {counts['replaced']} replaced, "
            f"{counts['lost']} lost, {self._unaccounted(robot)} sent before the two had met; "
            f"{robot.stranger.sent} hostile; skipped: {skipped}",
            f"not taken in and not excused by a fault: {len(self._unexcused(robot))}",
            "",
            f"{'fault':<26} {'times':>5} {'scans not taken in':>19} {'longest recovery [s]':>21} {'allowed [s]':>12}",
        ]
        for name in dict.fromkeys(window.name for window in self.windows):
            windows = [window for window in self.windows if window.name == name]
            lines.append(f"{name:<26} {len(windows):>5} {not_taken_in[name]:>19} "
                         f"{max(window.took() for window in windows):>21.2f} {windows[0].allowance:>12g}")
        lines += ["", f"{'latency, stamp to delta [ms]':<28} {'scans':>7} {'p50':>7} {'p90':>7} {'p99':>7} {'max':>7}"]
        for name, inside in (("outside of faults", False), ("within faults", True)):
            lines.append(f"{name:<28} " + percentiles(
                [ms for stamp, ms in listener.taken.items() if (self._fault(stamp) is not None) == inside]))
        lines += ["", self._memory(robot), self._effort(robot)]
        follower = listener.follower
        lines += [f"invariants: {follower.compared} snapshots compared, deltas missed {follower.gaps} times, "
                  f"{len(follower.violations)} violations"]
        wrong = self.wrong(robot)
        return "\n".join(lines + [""] + ([f"WRONG: {line}" for line in wrong] or ["nothing is wrong"]))

    def trace(self, robot):
        """Seconds, MB, and the fault of that second, a line each."""
        lines = ["seconds,memory_mb,fault"]
        for at, mb in robot.listener.memory:
            names = [window.name for window in self.windows if window.begin <= at * 1e9 <= window.recovered]
            lines.append(f"{at - self._begin:.1f},{mb:.1f},{' '.join(names)}")
        return "\n".join(lines) + "\n"

    def _memory(self, robot):
        """The most at any moment is told and not judged: a node that was stopped has scans to catch up with."""
        settle = self.arguments.settle
        if not (levels := self._levels(robot)):
            return f"memory: it ended before it had settled, after {settle:g} s"
        (highest, growth), values = self._growth(levels), list(levels.values())
        most = max(mb for at, mb in robot.listener.memory if at - self._begin >= settle)
        return (f"memory [MB], medians of {self._span():g} s: {values[0]:.1f} after {settle:g} s, "
                f"{levels[highest]:.1f} in the highest since (from {highest:.0f} s on), {growth:+.1f} %, "
                f"{values[-1]:.1f} at the end; {most:.1f} at most at any moment")

    def _effort(self, robot):
        cpu = [sample for sample in robot.listener.cpu if sample[0] >= self._begin]
        share = (cpu[-1][1] - cpu[0][1]) / max(cpu[-1][0] - cpu[0][0], 1e-9)
        return f"CPU of the node: {share * 100:.0f} % of a core"


def percentiles(values):
    values = sorted(values)
    if not values:
        return f"{0:>7}"
    at = [values[min(int(share * len(values)), len(values) - 1)] for share in (0.5, 0.9, 0.99, 1.0)]
    return f"{len(values):>7} " + " ".join(f"{value:>7.1f}" for value in at)
