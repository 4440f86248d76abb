"""The program under test as a process: its log, its end, and nothing left behind."""

import json
import os
import pathlib
import signal
import subprocess
import threading

from peer import wait_until

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]


def program():
    """The executable under test."""
    return os.environ.get("CFODI_BIN") or REPOSITORY / "target" / "release" / "cfodi"


class Cfodi:
    """`cfodi run OPTIONS --ros-args ...` with `parameters` (-p), `remaps` (-r) and further `arguments`, after `prefix`."""

    def __init__(self, parameters=None, remaps=None, arguments=(), environment=None, options=(), prefix=(), binary=None):
        command = [*prefix, str(binary or program()), "run", *options, "--ros-args", *arguments]
        for name, value in (remaps or {}).items():
            command += ["-r", f"{name}:={value}"]
        for name, value in (parameters or {}).items():
            command += ["-p", f"{name}:={value}"]
        # The library path is Python's; the program must run without it.
        variables = {k: v for k, v in os.environ.items() if k not in ("LD_LIBRARY_PATH", "PYTHONPATH")}
        self.lines = []
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            errors="replace", env=variables | (environment or {}))
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stderr:
            self.lines.append(line.rstrip("\n"))

    def said(self, *parts, after=0):
        """The first line of the log, from number `after` on, that holds all the parts; `None` where there is none so far."""
        return next((line for line in self.lines[after:] if all(part in line for part in parts)), None)

    def line_with(self, *parts, timeout=60, after=0):
        """The same, waited for."""
        def missed():
            return f"a line with {parts} in the log:\n" + "\n".join(self.lines[-20:])
        return wait_until(missed, lambda: self.said(*parts, after=after), timeout)

    def ready(self, name="/cfodi"):
        def found():
            assert self.process.poll() is None, "it ended at once:\n" + "\n".join(self.lines)
            return any("ready:" in line and name in line for line in list(self.lines))
        wait_until(f"the line `ready:` with {name}", found)
        return self

    def wait(self, timeout=60):
        """The exit status, once the log has been read to its end."""
        try:
            status = self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            what = "\n".join([f"it has not ended within {timeout} s", *threads(self.process.pid), *self.lines[-20:]])
            raise AssertionError(what) from None
        self._reader.join(5)
        return status

    def stop(self, with_signal=signal.SIGINT, timeout=60):
        """Ends it as a user does and returns what it counted, the last line of its log."""
        self.process.send_signal(with_signal)
        assert self.wait(timeout) == 0, "\n".join(self.lines[-20:])
        last = self.lines[-1]
        assert last.startswith("counts {"), f"the last line is no `counts`: {last}"
        return json.loads(last.removeprefix("counts "))

    def end(self):
        """For the end of a test, however it ended."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._reader.join(5)


def threads(process):
    """What each thread of a process does, for whoever has to find out why it does not end."""
    found = []
    for task in pathlib.Path(f"/proc/{process}/task").glob("*"):
        try:
            name, where = ((task / file).read_text().strip() for file in ("comm", "wchan"))
            state = (task / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:  # It has ended meanwhile.
            continue
        found.append(f"thread {task.name} {name}: {state} in {where}")
    return found


def skipped(counts):
    return sum(counts["skipped"].values())


def accounted(counts):
    """How many scans the counts speak of: every one that was sent."""
    return counts["taken_in"] + counts["replaced"] + counts["lost"] + skipped(counts)
