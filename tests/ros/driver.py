"""A camera's driver as a process of its own, to be killed, stopped and hurried: `python driver.py --rate 30`.

Each line of its output is the stamp (ns) of one scan, written after it was sent, so that what was sent is known whatever
becomes of the process. Lines on its input: `rate HZ`, `end`, after which three specks are sent (they are scans too).
"""

import argparse
import itertools
import os
import pathlib
import pickle
import queue
import sys
import threading
import time
import types

import clouds
import numpy as np
from peer import Peer

SPECKS = 3  # a lost scan shows only when a later one arrives


def walls():
    """A small wall, always the same."""
    return [types.SimpleNamespace(cloud=clouds.cloud(clouds.wall()), transform=clouds.still_transform())]


def room(count=60, width=640, height=480):
    """A camera that turns and rolls along in a room of 7 m x 6 m with a box in it, as `cabinet` gives a recording."""
    rng = np.random.default_rng(1)
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    focal = 0.82 * width
    across, down = (u - width / 2 + 0.5) / focal, (v - height / 2 + 0.5) / focal
    for angle in np.arange(count) * 2 * np.pi / count:
        place = np.array([1.2 * np.cos(angle), 1.2 * np.sin(angle), 1.0])
        cos, sin = np.cos(angle), np.sin(angle)
        # In the map's axes; the depth is the length along the optical axis.
        rays = np.stack([cos + across * sin, sin - across * cos, -down], -1)
        rays[rays == 0] = 1e-9
        depth = ((np.where(rays > 0, [3.5, 3.0, 2.5], [-3.5, -3.0, 0.0]) - place) / rays).min(-1)
        near, far = ([[2.2, -0.6, 0.0], [2.8, 0.6, 0.8]] - place)[:, None, None] / rays
        enter, leave = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
        depth = np.where((enter < leave) & (enter > 0), np.minimum(depth, enter), depth)
        depth += rng.normal(size=depth.shape) * (0.0012 + 0.0019 * (depth - 0.4) ** 2)
        points = np.stack([across * depth, down * depth, depth, np.zeros_like(depth)], -1).astype(np.float32)
        turn = (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
        yield types.SimpleNamespace(
            cloud=clouds.cloud(points), transform=clouds.transform("map", "camera_link", place, turn))


def commands():
    """What is said on the input, as it comes."""
    lines = queue.SimpleQueue()

    def read():
        for line in sys.stdin:
            lines.put(line.split())
        lines.put(["end"])

    threading.Thread(target=read, daemon=True).start()
    return lines


def send(camera, cloud, transform):
    stamp = time.time_ns()
    camera.publish(cloud, stamp, transform)
    os.write(1, b"%d\n" % stamp)


def drive(camera, scans, rate, said):
    """Sends scans, each stamped with the time of sending, until it is told to end; it does not catch up."""
    due = time.monotonic()
    for scan in itertools.cycle(scans):
        while not said.empty():
            what, *value = said.get()
            if what == "end":
                return scan
            rate = float(value[0])
        time.sleep(max(0.0, due - time.monotonic()))
        send(camera, scan.cloud, scan.transform)
        due = max(due + 1 / rate, time.monotonic())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--scans", default="wall", help="wall, room, cabinet, or a file that --prepare made")
    parser.add_argument("--recordings", type=pathlib.Path)
    parser.add_argument("--prepare", type=pathlib.Path, help="only write the scans to a file, to begin faster from it")
    parser.add_argument("--size", type=int, nargs=2, default=[640, 480], help="of the room's images")
    parser.add_argument("--point-step", type=int, choices=[16, 32], default=16, help="bytes of a point of the cabinet")
    parser.add_argument("--rate", type=float, default=30)
    parser.add_argument("--at-once", action="store_true", help="send before anybody listens, as drivers do")
    arguments = parser.parse_args()
    made = {"wall": walls, "room": lambda: room(60, *arguments.size),
            "cabinet": lambda: clouds.cabinet(arguments.recordings, arguments.point_step)}.get(arguments.scans)
    scans = list(made()) if made else pickle.loads(pathlib.Path(arguments.scans).read_bytes())
    if arguments.prepare:
        arguments.prepare.write_bytes(pickle.dumps(scans))
        return
    said = commands()
    peer = Peer("camera")
    try:
        camera = peer.camera()
        if not arguments.at_once:
            camera.meet()
        last = drive(camera, scans, arguments.rate, said)
        for _ in range(SPECKS):
            time.sleep(0.3)
            send(camera, clouds.cloud(clouds.speck()), last.transform)
        time.sleep(0.5)
    finally:
        peer.close()


if __name__ == "__main__":
    main()
