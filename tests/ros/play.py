"""Plays the cabinet recording in a loop as a camera would, from a process of its own: Python that records would slow it.

Clouds, or depth images in millimetres, raw or as PNG. Prints one JSON line: how many it sent, those of the end included, and at what rate.
"""

import argparse
import json
import pathlib
import sys
import time

import clouds
import depth_images
from peer import Peer

SPECKS = 3  # a lost cloud shows only when a later one arrives


def play(camera, scans, seconds, rate):
    """Publishes each scan with its transform, both stamped with the time of sending; returns the rate reached."""
    period, start, number = 1 / rate, time.monotonic(), 0
    due = start
    while due < start + seconds:
        time.sleep(max(0.0, due - time.monotonic()))
        scan = scans[number % len(scans)]
        camera.publish(scan.cloud, time.time_ns(), scan.transform)
        number += 1
        due = max(due + period, time.monotonic())  # a camera does not catch up
    return number / (time.monotonic() - start)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--point-step", type=int, default=16)
    parser.add_argument("--kind", choices=["points", "depth", "compressed"], default="points")
    parser.add_argument("--reliable", action="store_true", help="depth images, as the Kinect v1 drivers send them")
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--rate", type=float, default=30)
    arguments = parser.parse_args()
    if arguments.kind == "points":
        scans = list(clouds.cabinet(arguments.folder, arguments.point_step))
    else:
        form = depth_images.image if arguments.kind == "depth" else depth_images.compressed
        scans = list(depth_images.cabinet(arguments.folder, form))
    peer = Peer("camera")
    try:
        if arguments.kind == "points":
            camera = peer.camera()
        else:
            suffix = "/compressedDepth" if arguments.kind == "compressed" else ""
            camera = peer.depth_camera(depth_images.cabinet_info(arguments.folder), suffix, arguments.reliable)
        camera.meet()
        reached = play(camera, scans, arguments.seconds, arguments.rate)
        for _ in range(SPECKS):
            time.sleep(0.3)
            last = clouds.cloud(clouds.speck()) if arguments.kind == "points" else scans[-1].cloud
            camera.publish(last, time.time_ns(), scans[-1].transform)
        time.sleep(0.5)
    finally:
        peer.close()
    json.dump({"sent": camera.sent, "rate": reached}, sys.stdout)


if __name__ == "__main__":
    main()
