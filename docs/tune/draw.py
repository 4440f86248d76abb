"""Maps side by side: the dense voxels of PLY files as `cfodi replay --ply` writes them, seen from one place.

    python draw.py PICTURE.png 'CAPTION=MAP.ply' ... [--yaw DEG] [--pitch DEG] [--zoom F] [--below M] [--near X,Y,Z,R]

A voxel is a square of its colour; those without a cluster are grey, those that face away are left out, so that one looks
into rooms. Of the first map follows where all are seen from. Needs numpy and pillow (`tests/bags/python.sh` has them).
"""

import argparse
import math
import pathlib
import sys

import numpy as np
from PIL import Image, ImageDraw, ImageFont

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "tests" / "bags"))
from draw_markers import Camera  # noqa: E402

TYPES = {"float": "<f4", "uchar": "u1", "uint": "<u4"}
SAMPLES = 2  # along each side of a pixel
CAPTION = 24  # px


def read(path):
    """(edge of a voxel, its records)."""
    head, _, body = pathlib.Path(path).read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in head.decode().splitlines()]
    edge = next(float(line[-1]) for line in lines if line[:2] == ["comment", "dense"])
    return edge, np.frombuffer(body, [(line[2], TYPES[line[1]]) for line in lines if line[0] == "property"])


def shown(path, options):
    edge, voxels = read(path)
    places = np.column_stack([voxels[axis] for axis in "xyz"]).astype(float)
    keep = places[:, 2] < options.below
    if options.near:
        x, y, z, radius = map(float, options.near.split(","))
        keep &= np.abs(places - (x, y, z)).max(1) < radius
    return edge, places[keep], voxels[keep]


def draw(edge, places, voxels, camera, size):
    normals = np.column_stack([voxels["n" + axis] for axis in "xyz"])
    towards = camera.eye - places
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    facing = (normals * towards).sum(1)
    colours = np.column_stack([voxels[name] for name in ("red", "green", "blue")]).astype(float)
    colours[voxels["label"] == 0] = 150
    colours *= 0.6 + 0.4 * np.maximum(facing, 0)[:, None]
    x, y, depth = camera.project(places).T
    half = np.maximum(0.5 * edge * camera.focal / depth, 0.6)
    image = np.full((size[1], size[0], 3), 255, np.uint8)
    for i in np.argsort(-depth):
        if facing[i] > -0.1:
            left, right, top, bottom = x[i] - half[i], x[i] + half[i], y[i] - half[i], y[i] + half[i]
            image[max(round(top), 0):max(round(bottom), 0), max(round(left), 0):max(round(right), 0)] = colours[i]
    return Image.fromarray(image).resize((size[0] // SAMPLES, size[1] // SAMPLES), Image.Resampling.BOX)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture")
    parser.add_argument("maps", nargs="+", metavar="CAPTION=MAP.ply")
    for name, default in (("yaw", -112), ("pitch", 45), ("zoom", 1), ("below", math.inf), ("height", 300)):
        parser.add_argument(f"--{name}", type=float, default=default)
    parser.add_argument("--near")
    options = parser.parse_args()
    maps = [one.rsplit("=", 1) for one in options.maps]
    height, width = int(options.height), 1200 // len(maps)
    size = (width * SAMPLES, height * SAMPLES)
    loaded = [shown(path, options) for _, path in maps]
    camera = Camera(loaded[0][1], size, options.yaw, options.pitch, options.zoom)
    whole = Image.new("RGB", (width * len(maps), height + CAPTION), "white")
    for number, ((caption, _), one) in enumerate(zip(maps, loaded)):
        whole.paste(draw(*one, camera, size), (number * width, CAPTION))
        place = (number * width + width / 2, CAPTION / 2)
        ImageDraw.Draw(whole).text(place, caption, "black", ImageFont.load_default(17), "mm")
    whole.quantize(64, dither=Image.Dither.NONE).save(options.picture, optimize=True)


if __name__ == "__main__":
    main()
