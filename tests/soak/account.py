"""The account of a soak: where every scan went, by fault, and what is wrong."""

import dataclasses
import statistics
import time

BEFORE = 0.5e9  # ns before a fault in which a scan may still be on its way, and so the fault's


@dataclasses.dataclass
class Window:
    """A fault, in ns of the clock that stamps are of."""

    name: str
    begin: int
    over: int = 0
    recovered: int = 0

    def has(self, stamp):
        return self.begin - BEFORE <= stamp <= self.recovered

    def took(self):
        """Seconds from its end to the first of the scans that were sent after it and taken in without a break."""
        return (self.recovered - self.over) * 1e-9


class Account:
    def __init__(self, arguments, scans):
        self.arguments, self.scans = arguments, scans
        self.windows, self.counts = [], {}
        self._begin = 0

    def begins(self):
        self._begin = time.time()

    def _fault(self, stamp):
        return next((window for window in self.windows if window.has(stamp)), None)

    def _not_taken_in(self, robot):
        """Scans that have no delta, by the fault that had them; None: none had. The first were sent before the two met."""
        taken = robot.listener.taken
        missing = [stamp for stamp in robot.sent() if stamp not in taken and stamp > min(taken)]
        by_fault = {}
        for stamp in missing:
            window = self._fault(stamp)
            by_fault.setdefault(window and window.name, []).append(stamp)
        return by_fault

    def _levels(self, robot):
        """MB when it has settled, at most from then on, and at the end. A level is the median of as long as it had to
        settle: from one moment to the next memory differs by some clouds."""
        long = self.arguments.settle
        memory = [(at, mb) for at, mb in robot.listener.memory if at >= self._begin + long]
        if not memory:
            return None
        first = statistics.median(mb for at, mb in memory if at < self._begin + 2 * long)
        last = statistics.median(mb for at, mb in memory if at >= memory[-1][0] - long)
        return first, max(mb for _, mb in memory), last

    def _unaccounted(self, robot):
        """Scans that were sent and that the node's counts do not speak of: sent before it and a driver had met."""
        counts = self.counts
        spoken = counts["taken_in"] + counts["replaced"] + counts["lost"] + sum(counts["skipped"].values())
        return len(robot.sent()) + robot.stranger.sent - spoken

    def wrong(self, robot):
        """What must not be, a line each."""
        follower, counts = robot.listener.follower, self.counts
        wrong = list(follower.violations[:20])
        outside = self._not_taken_in(robot).get(None, [])
        if len(outside) > self.arguments.allowed:
            when = ", ".join(f"{stamp * 1e-9 - self._begin:.2f}" for stamp in outside[:20])
            wrong.append(f"{len(outside)} scans were not taken in outside of faults, after {when} s")
        if counts["received"] != counts["taken_in"] + counts["replaced"] + sum(counts["skipped"].values()):
            wrong.append(f"the counts do not add up: {counts}")
        met = sum(stamp < min(robot.listener.taken) for stamp in robot.sent())
        explained = met + sum(map(len, self._not_taken_in(robot).values())) + robot.stranger.sent
        if not -1 <= self._unaccounted(robot) <= explained:
            wrong.append(f"{self._unaccounted(robot)} scans are not in the counts, of {explained} not taken in")
        if follower.sessions != 1:
            wrong.append(f"{follower.sessions} sessions, not one")
        if not follower.compared:
            wrong.append("no snapshot was compared")
        if levels := self._levels(robot):
            growth = (levels[2] / levels[0] - 1) * 100
            if self.arguments.max_voxels and growth > self.arguments.growth:
                wrong.append(f"memory has grown by {growth:.1f} %")
        return wrong

    def table(self, robot):
        listener, counts, arguments = robot.listener, self.counts, self.arguments
        minutes = (listener.memory[-1][0] - self._begin) / 60
        skipped = ", ".join(f"{reason} {number}" for reason, number in counts["skipped"].items()) or "none"
        not_taken_in = self._not_taken_in(robot)
        lines = [
            f"{minutes:.1f} minutes live: {self.scans} at {arguments.rate:g} Hz, a fault every {arguments.fault_every:g} s, "
            f"max_voxels {arguments.max_voxels}",
            f"scans: {len(robot.sent())} sent, {counts['taken_in']} taken in, {counts['replaced']} replaced, "
            f"{counts['lost']} lost, {self._unaccounted(robot)} sent before the two had met; "
            f"{robot.stranger.sent} hostile; skipped: {skipped}",
            f"not taken in outside of faults: {len(not_taken_in.get(None, []))}",
            "",
            f"{'fault':<26} {'times':>5} {'scans not taken in':>19} {'longest recovery [s]':>21}",
        ]
        for name in dict.fromkeys(window.name for window in self.windows):
            windows = [window for window in self.windows if window.name == name]
            lines.append(f"{name:<26} {len(windows):>5} {len(not_taken_in.get(name, [])):>19} "
                         f"{max(window.took() for window in windows):>21.2f}")
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
        if (levels := self._levels(robot)) is None:
            return f"memory: it ended before it had settled, after {self.arguments.settle:g} s"
        first, most, last = levels
        return (f"memory [MB]: {first:.1f} after {self.arguments.settle:g} s, {most:.1f} at most since, {last:.1f} at the end: "
                f"{(last / first - 1) * 100:+.1f} %")

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
