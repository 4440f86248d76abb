"""What the node says and what it costs: every message is checked as it comes, and nothing is kept but figures."""

import collections
import os
import pathlib
import time

from cfodi_msgs.msg import SurfaceClusterArray
from follow import Follower, stamp_of
from peer import Peer, qos
from rclpy.serialization import deserialize_message

SAMPLE = 1.0  # s between two looks at the process
PAGE, TICK = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_CLK_TCK")


class Listener:
    """`look` takes in what has come since the last look."""

    def __init__(self, pid):
        self.follower = Follower()
        self.taken = {}  # stamp of a scan -> ms from its stamp to its delta
        self.newest = 0  # stamp of a scan
        self.memory = []  # (time, MB)
        self.cpu = []  # (time, s)
        self._proc, self._came = pathlib.Path("/proc") / str(pid), collections.deque()
        self._peer = Peer("soak")
        for topic, depth, latched in (("clusters", 100, True), ("clusters_delta", 2000, False)):
            self._peer.node.create_subscription(SurfaceClusterArray, f"/cfodi/{topic}", self._keep(topic),
                                                qos(depth, latched=latched), raw=True)

    def _keep(self, topic):
        return lambda raw: self._came.append((time.time_ns(), topic, bytes(raw)))

    def look(self):
        self._sample()
        while self._came:
            at, topic, raw = self._came.popleft()
            message = deserialize_message(raw, SurfaceClusterArray)
            if topic == "clusters":
                self.follower.snapshot(message)
                continue
            stamp = stamp_of(raw)
            self.taken[stamp] = (at - stamp) * 1e-6
            self.newest = max(self.newest, stamp)
            self.follower.delta(message)

    def _sample(self):
        now = time.time()
        if self.memory and now < self.memory[-1][0] + SAMPLE:
            return
        try:
            resident = int((self._proc / "statm").read_text().split()[1])
            times = (self._proc / "stat").read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError, IndexError):
            return  # it has ended
        if resident:
            self.memory.append((now, resident * PAGE / 1e6))
            self.cpu.append((now, (int(times[11]) + int(times[12])) / TICK))

    def close(self):
        self._peer.close()
