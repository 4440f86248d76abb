"""What crosses the network of a test: every packet on `lo`, as bytes, and the sockets that a process has open."""

import os
import pathlib
import re
import socket
import threading
import time

ALL_PROTOCOLS = 3


class Capture:
    """Packets on `lo` from now on; make it in the thread that has the test's network."""

    def __init__(self):
        self.packets = []
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self._socket.bind(("lo", 0))
        self._socket.settimeout(0.1)
        self._end = None
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self):
        while self._end is None or time.monotonic() < self._end:
            try:
                self.packets.append(self._socket.recv(1 << 16))
            except TimeoutError:
                pass

    def stop(self):
        """The packets, those that still wait in the socket included."""
        self._end = time.monotonic() + 0.5
        self._thread.join(60)
        self._socket.close()
        return self.packets


def sockets(process):
    """(`udp`, `tcp`, ..., local port) of each internet socket of the process, in its own network."""
    inodes = set()
    for descriptor in pathlib.Path(f"/proc/{process}/fd").iterdir():
        try:
            target = os.readlink(descriptor)
        except OSError:
            continue
        if match := re.fullmatch(r"socket:\[(\d+)\]", target):
            inodes.add(match[1])
    found = []
    for protocol in ("udp", "udp6", "udplite", "tcp", "tcp6", "raw", "raw6"):
        table = pathlib.Path(f"/proc/{process}/net/{protocol}")
        for line in table.read_text().splitlines()[1:] if table.exists() else ():
            fields = line.split()
            if fields[9] in inodes:
                found.append((protocol, int(fields[1].rpartition(":")[2], 16)))
    return found
