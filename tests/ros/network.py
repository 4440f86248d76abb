"""A network of one's own: tests cannot meet each other's nodes, and nothing leaves the machine."""

import ctypes
import fcntl
import os
import pathlib
import socket
import struct

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
