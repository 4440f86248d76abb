"""A network of one's own: tests cannot meet each other's nodes, and nothing leaves the machine."""

import contextlib
import ctypes
import fcntl
import os
import pathlib
import socket
import struct
import subprocess
import time

CLONE_NEWNET, SIOCSIFFLAGS, IFF_UP, IFF_RUNNING = 0x40000000, 0x8914, 0x1, 0x40
LARGE_BUFFER = 32 << 20


def own_network():
    """Moves this thread, and all it starts from now on, into a new network namespace that holds only `lo`."""
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET):
        reason = os.strerror(ctypes.get_errno())
        raise RuntimeError(f"no network namespace for this test: {reason} (start it with tests/ros/python.sh)")
    loopback_up()


def loopback_up():
    """What `ip link set lo up` does, on machines without `ip` too."""
    _loopback(IFF_UP | IFF_RUNNING)


def loopback_down():
    """What `ip link set lo down` does."""
    _loopback(0)


def _loopback(flags):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sH22x", b"lo", flags))


class OtherMachine:
    """A network namespace of its own, with a wire to this one; this end of it is `wire`, which has no address yet."""

    def __init__(self, address):
        self.process = subprocess.Popen(["unshare", "-n", "sleep", "infinity"])
        try:
            self._lay_wire(address)
        except BaseException:
            self.end()
            raise

    def _lay_wire(self, address):
        mine, end = os.readlink("/proc/self/ns/net"), time.monotonic() + 10
        while os.readlink(f"/proc/{self.process.pid}/ns/net") == mine:
            assert time.monotonic() < end, "no second namespace"
            time.sleep(0.02)
        self.inside = ["nsenter", "-t", str(self.process.pid), "-n"]
        _ip("link", "add", "wire", "type", "veth", "peer", "name", "other", "netns", str(self.process.pid))
        _ip("link", "set", "lo", "up", prefix=self.inside)
        _ip("address", "add", f"{address}/24", "dev", "other", prefix=self.inside)
        _ip("link", "set", "other", "up", prefix=self.inside)

    @staticmethod
    def wire_has(address, before=None):
        """Gives this end an address, in the place of the one before."""
        if before:
            _ip("address", "delete", f"{before}/24", "dev", "wire")
        _ip("address", "add", f"{address}/24", "dev", "wire")
        _ip("link", "set", "wire", "up")

    def end(self):
        self.process.kill()
        self.process.wait()


def _ip(*words, prefix=()):
    subprocess.run([*prefix, "ip", *words], check=True)


@contextlib.contextmanager
def other_machine(address):
    """Another machine, for as long as it is needed."""
    machine = OtherMachine(address)
    try:
        yield machine
    finally:
        machine.end()


def granted_buffer(size=LARGE_BUFFER):
    """Bytes that Linux grants to a socket that asks for `size`; asked of a socket, for a namespace hides the sysctl."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        any_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
        return any_socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # Linux reports twice what it set


def recordings():
    """The folder of the recordings (CFODI_DATA), or None where they are not there."""
    default = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = pathlib.Path(os.environ.get("CFODI_DATA") or default)
    return folder if (folder / "tum_fr3_cabinet58" / "poses.csv").is_file() else None


if __name__ == "__main__":
    loopback_up()
