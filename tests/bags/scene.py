"""A small scene for bags that are written message by message: a curved wall, seen by a camera that moves."""

import bags
import numpy as np
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT, FOCAL = 96, 72, 80.0
START, SCANS, PERIOD, TF_PERIOD = 1_311_868_164 * bags.SECOND + 363_181_000, 10, 33_333_333, 10_000_000


def stamps(scans=SCANS):
    return [START + i * PERIOD for i in range(scans)]


def pose(stamp):
    """(translation, quaternion) of the camera_link in the world."""
    t = (stamp - START) / 1e9
    turn = Rotation.from_euler("ZYX", [0.3 + 0.8 * t, 0.1 - 0.2 * t, 0.05 * t])
    return (0.3 * t, 0.113 + 0.2 * t, 1.017 + 0.1 * t), turn.as_quat()


def depth(scan):
    """Depth [mm] as uint16, 0 where there is none."""
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    z = 1900 + 150 * np.sin(u / 17 + scan / 5) + 80 * np.cos(v / 11)
    z[:, :4] = 0
    z[10:14, 20:40] = 7000  # out of range
    return np.round(z).astype(np.uint16)


def metres(millimetres):
    z = millimetres.astype(np.float32) / np.float32(1000)
    z[millimetres == 0] = np.nan
    return z


def points(z):
    """What depth_image_proc makes of a depth image [m]: (height, width, 3), float32."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    focal = np.float32(FOCAL)
    return np.stack([(u - (WIDTH - 1) / 2) * z / focal, (v - (HEIGHT - 1) / 2) * z / focal, z], 2)


def moves(bag, parent="map", child="camera_link", every=TF_PERIOD, **more):
    """The camera's way on /tf, before the first scan and beyond the last: scans fall between transforms."""
    for stamp in range(START - 5 * every, START + SCANS * PERIOD + 5 * every, every):
        bag.transform(stamp, parent, child, *pose(stamp), **more)


def write(folder, sensor, **more):
    """A bag of the scene: `sensor(bag, stamp, scan)` writes what the sensor says; all in the order of time."""
    with bags.Bag(folder) as bag:
        bag.static(START - bags.SECOND)
        moves(bag, **more)
        for scan, stamp in enumerate(stamps()):
            sensor(bag, stamp, scan)
    return folder


def cloud(bag, stamp, scan, **more):
    bag.cloud(stamp, points(metres(depth(scan))), **more)


def image(bag, stamp, scan, **more):
    bag.info(stamp, WIDTH, HEIGHT, FOCAL)
    bag.image(stamp, depth(scan), **more)
