"""Datagrams of DDS (DDSI-RTPS 2.5), as far as tests read and write them."""

import socket
import struct

DATA, HEARTBEAT, GAP = 0x15, 7, 8
PARTICIPANTS, PUBLICATIONS, SUBSCRIPTIONS = (bytes.fromhex(writer) for writer in ("000100c2", "000003c2", "000004c2"))
ALL_DISCOVERY = 0x3f  # readers and writers of participants, publications and subscriptions


def submessages(packet):
    """Where each submessage of an RTPS message begins, its kind, byte order and length (9.4.5.1)."""
    at = 20
    while at + 4 <= len(packet):
        order = "<" if packet[at + 1] & 1 else ">"
        length = struct.unpack_from(order + "H", packet, at + 2)[0]
        yield at, packet[at], order, length
        if length == 0:
            break
        at += 4 + length


def writers(packet):
    """Of each message in a datagram, who has written it."""
    return [packet[at + 12:at + 16] for at, kind, _, _ in submessages(packet) if kind == DATA]


def introduction(prefix, port, vendor=b"\x01\x0f"):
    """The datagram by which a participant of that prefix (12 bytes) says that it is at that port of 127.0.0.1 (8.5.3)."""
    locator = struct.pack("<iI12x4s", 1, port, socket.inet_aton("127.0.0.1"))
    parameters = {
        0x15: b"\x02\x04\0\0", 0x16: vendor + b"\0\0", 0x50: prefix + bytes.fromhex("000001c1"), 0x58: struct.pack("<I", ALL_DISCOVERY),
        0x02: struct.pack("<iI", 20, 0), 0x31: locator, 0x32: locator}
    listed = b"".join(struct.pack("<HH", key, len(value)) + value for key, value in parameters.items())
    message = struct.pack("<HH4s4siI", 0, 16, bytes.fromhex("000100c7"), PARTICIPANTS, 0, 1) + b"\0\x03\0\0" + listed + b"\x01\0\0\0"
    return b"RTPS\x02\x04" + vendor + prefix + struct.pack("<BBH", DATA, 5, len(message)) + message
