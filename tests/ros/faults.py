"""What goes wrong on a robot, done to processes that the caller started."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import network
from peer import wait_until

DRIVER = pathlib.Path(__file__).with_name("driver.py")


class Driver:
    """`driver.py` as a process, after `prefix`; `sent` holds the stamps (ns) of its scans."""

    def __init__(self, *arguments, prefix=()):
        self.sent = []
        self.process = subprocess.Popen([*prefix, sys.executable, str(DRIVER), *map(str, arguments)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        self.sent.extend(int(line) for line in self.process.stdout if line.endswith("\n"))

    def sends(self, more=1, timeout=60):
        """Waits until it has sent this many scans from now on."""
        wanted = len(self.sent) + more
        wait_until(f"{more} scans of the driver", lambda: len(self.sent) >= wanted, timeout)
        return self

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def finish(self, timeout=60):
        """Lets it send its last scans; returns the stamps of all."""
        self.say("end")
        assert self.process.wait(timeout) == 0
        self._reader.join(5)
        return self.sent

    def kill(self):
        """Ends it as a crash does; returns the stamps of all."""
        self.process.kill()
        self.process.wait()
        self._reader.join(5)
        return self.sent


@contextlib.contextmanager
def stopped(process):
    """It gets no time, as when a machine stalls; what is sent to it waits in sockets."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


def stall(process, seconds):
    with stopped(process):
        time.sleep(seconds)


@contextlib.contextmanager
def no_network():
    """The only interface is down; call it on the thread that made the namespace."""
    network.loopback_down()
    try:
        yield
    finally:
        network.loopback_up()


@contextlib.contextmanager
def hogs(number=os.cpu_count()):
    """Processes that take all the time they get."""
    started = [subprocess.Popen(["yes"], stdout=subprocess.DEVNULL) for _ in range(number)]
    try:
        yield
    finally:
        for hog in started:
            hog.kill()
            hog.wait()
