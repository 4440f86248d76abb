"""The live node for minutes or hours beside a driver that crashes, on a network that drops: a table, and status 1 where
something is wrong. Run it by `tests/soak.sh live`, which gives it a network of its own."""

import argparse
import contextlib
import itertools
import os
import pathlib
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "ros"), str(HERE.parents[1] / "examples")]
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"

import faults
import hostile
import network
from account import Account, Window
from cfodi_node import Cfodi
from listener import Listener
from peer import Peer, wait_until

TOPIC = "/camera/depth/points"
QUIET_AT_THE_END = 8  # s without faults, so that the last has an end
PATIENCE = 60  # s
STEADY = 1e9  # ns without a loss, after which a fault is over

# What a fault may cost: seconds after its end in which scans may be missing. Each is some times what is usual, for machines
# that others use too; a fault that costs scans for longer is a failure.
MEETING = 10  # two participants find each other: in 0.2 to 1.5 s; a lost announcement and a lost heartbeat take 3 s each
REPAIR = 5  # what is reliable is sent again: within 1 s, or 3 s where it takes a publisher's heartbeat
BACKLOG = 2  # what waits in sockets and queues is taken in: fifteen scans or so, 0.5 s
NOTHING = 0  # it may cost no scan, nor while it lasts


class Robot:
    """The node, its driver, and what is done to them."""

    def __init__(self, arguments, scans):
        self.rate, self._scans = arguments.rate, scans
        self.node = Cfodi({"fixed_frame": "map", "max_voxels": arguments.max_voxels}, {"points": TOPIC}).ready()
        self.listener = Listener(self.node.process.pid)
        self.stranger = hostile.Stranger(TOPIC)
        self.drivers = [self._driver()]

    def _driver(self, *more):
        return faults.Driver("--scans", self._scans, "--rate", self.rate, *more)

    @property
    def driver(self):
        return self.drivers[-1]

    def sent(self):
        return [stamp for driver in self.drivers for stamp in driver.sent]

    def close(self):
        for driver in self.drivers:
            driver.kill()
        self.stranger.close()
        self.listener.close()
        self.node.end()

    # The faults; each returns when what it does is over.

    def driver_killed(self):
        self.driver.kill()
        self.drivers.append(self._driver("--at-once"))
        self.driver.sends(1)

    def driver_stalled(self):
        faults.stall(self.driver.process, 2)

    def node_stalled(self):
        faults.stall(self.node.process, 2)

    def reader_joins_and_leaves(self):
        reader = Peer("late")
        with contextlib.closing(reader):
            reader.record_node()
            reader.clusters.wait("a snapshot", timeout=PATIENCE)

    def reader_killed(self):
        reader = subprocess.Popen([sys.executable, HERE.parents[1] / "examples" / "map_reader.py"],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(2)
        reader.kill()
        reader.wait()

    def network_down(self):
        with faults.no_network():
            time.sleep(1)

    def burst(self):
        self.driver.say("rate 90")
        time.sleep(1)
        self.driver.say(f"rate {self.rate}")

    def hogs(self):
        with faults.hogs():
            time.sleep(3)

    def hostile_messages(self):
        self.stranger.sends()


# In the order in which they are injected, with what each is allowed.
FAULTS = [
    (Robot.driver_killed, MEETING),  # it is over when the successor has sent its first scan, to nobody
    (Robot.driver_stalled, BACKLOG),
    (Robot.node_stalled, MEETING),  # it finds its middleware ended and joins the network anew
    (Robot.reader_joins_and_leaves, NOTHING),
    (Robot.network_down, REPAIR),  # for too short a time to be forgotten by the others
    (Robot.burst, BACKLOG),
    (Robot.hogs, BACKLOG),
    (Robot.hostile_messages, NOTHING),
    (Robot.reader_killed, NOTHING),
]


def prepared(arguments, folder):
    """The scans as a file: a driver that is restarted begins from it at once."""
    recordings = network.recordings()
    scans = arguments.scans or ("cabinet" if recordings else "room")
    file = pathlib.Path(folder) / "scans"
    subprocess.run([sys.executable, faults.DRIVER, "--scans", scans, "--prepare", file, "--size", *map(str, arguments.size),
                    "--point-step", str(arguments.point_step),
                    *(["--recordings", recordings] if scans == "cabinet" else [])], check=True)
    return scans, file


def soak(robot, arguments, account):
    """Injects a fault every so often until the time is over."""
    begin = time.monotonic()
    end, due = begin + arguments.seconds, begin + arguments.fault_every
    number = 0
    while time.monotonic() < end or lacks_faults(arguments, number):
        assert robot.node.process.poll() is None, "the node has ended:\n" + "\n".join(robot.node.lines[-20:])
        robot.listener.look()
        has_time = time.monotonic() < end - QUIET_AT_THE_END or lacks_faults(arguments, number)
        if time.monotonic() >= due and has_time:
            account.windows.append(injected(robot, *FAULTS[number % len(FAULTS)]))
            number += 1
            due = max(due + arguments.fault_every, time.monotonic())
            if arguments.every_fault and not lacks_faults(arguments, number):
                end = max(end, time.monotonic() + QUIET_AT_THE_END)
        time.sleep(0.05)


def lacks_faults(arguments, number):
    """Whether there is to be a fault yet, however long the others took: `number` there have been."""
    return arguments.every_fault and number < len(FAULTS)


def injected(robot, fault, allowance):
    """Injects it and waits until all scans of a second are taken in that were sent when it was over."""
    window = Window(fault.__name__.replace("_", " "), time.time_ns(), allowance)
    fault(robot)
    window.over = time.time_ns()
    patience = time.monotonic() + PATIENCE
    while not recovered(robot, window):
        if time.monotonic() > patience:
            window.recovered = time.time_ns()  # it has not, which the account tells: no allowance is as long
            break
        time.sleep(0.02)
    return window


def recovered(robot, window):
    """Whether all scans of a second were taken in; until then the window reaches to the last that was not."""
    robot.listener.look()
    assert robot.node.process.poll() is None, f"{window.name}: the node has ended"
    window.recovered = last_missing(robot, window.over)
    return robot.listener.newest > window.recovered + STEADY


def last_missing(robot, over):
    """The stamp of the last scan after `over` (ns) that is not taken in though a newer one is; none: `over`."""
    taken, newest = robot.listener.taken, robot.listener.newest
    after = itertools.takewhile(lambda stamp: stamp > over, reversed(robot.driver.sent))
    return next((stamp for stamp in after if stamp < newest and stamp not in taken), over)


def main():
    parser = argparse.ArgumentParser(prog="tests/soak.sh live")
    parser.add_argument("--seconds", type=float, default=1800)
    parser.add_argument("--rate", type=float, default=30, help="scans a second")
    parser.add_argument("--fault-every", type=float, default=20, help="seconds from one fault to the next")
    parser.add_argument("--every-fault", action="store_true", help="goes on until each fault has come")
    parser.add_argument("--max-voxels", type=int, default=8000, help="0 = no bound")
    parser.add_argument("--scans", choices=["cabinet", "room"], help="the recording where it is there, else the room")
    parser.add_argument("--size", type=int, nargs=2, default=[640, 480], help="of the room's images")
    parser.add_argument("--point-step", type=int, choices=[16, 32], default=16,
                        help="bytes of a point of the recording: clouds of 4.9 or 9.8 MB")
    parser.add_argument("--settle", type=float, default=60, help="seconds after which memory is to be level")
    parser.add_argument("--allowed", type=int, default=0, help="scans that may be missing and no fault excuses")
    parser.add_argument("--trace", type=pathlib.Path, help="a CSV of the node's memory, every second")
    parser.add_argument("--growth", type=float, default=5, help="by how much a minute's may then be higher, in %%")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="cfodi-soak-") as folder:
        scans, file = prepared(arguments, folder)
        account = Account(arguments, scans)
        robot = Robot(arguments, file)
        try:
            wait_until("a first scan", lambda: robot.listener.look() or robot.listener.newest, PATIENCE)
            account.begins(time.time())
            soak(robot, arguments, account)
            robot.driver.finish()
            time.sleep(1)
            robot.listener.look()
            account.counts = robot.node.stop(timeout=30)
            time.sleep(1)
            robot.listener.look()
        finally:
            robot.close()
        if arguments.trace:
            arguments.trace.write_text(account.trace(robot))
        print(account.table(robot))
        sys.exit(1 if account.wrong(robot) else 0)


if __name__ == "__main__":
    main()
