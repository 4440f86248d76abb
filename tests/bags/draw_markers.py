"""What RViz shows of a MarkerArray, as a picture: a small renderer of the kinds of markers that the node sends.

    bash tests/bags/python.sh tests/bags/draw_markers.py RESULT.mcap PICTURE.png [--yaw DEG] [--pitch DEG] [--zoom F]

Cubes and lines hide what is behind them. Surfaces that let it show through are drawn after all else, from the farthest
place to the nearest, and are lit from where they are seen, as RViz does it. Texts stand in front, where there is room.
"""

import argparse
import math

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ADD, DELETE, DELETEALL = 0, 2, 3
LINE_LIST, CUBE_LIST, TEXT, TRIANGLE_LIST = 5, 6, 9, 11
BACKGROUND = (48, 48, 48)
OPAQUE = 0.9998  # from where on RViz takes a colour as such
SAMPLES = 2  # along each side of a pixel
FIELD_OF_VIEW = math.radians(45)
SMALLEST_TEXT = 11  # px


class Viewer:
    """Markers by (ns, id), as messages leave them."""

    def __init__(self):
        self.markers = {}

    def take(self, array):
        identities = [(marker.ns, marker.id) for marker in array.markers]
        assert len(set(identities)) == len(identities), "an identity is twice in a message: an error to RViz"
        for identity, marker in zip(identities, array.markers):
            if marker.action == ADD:
                self.markers[identity] = marker
            elif marker.action == DELETE:
                self.markers.pop(identity, None)
            elif marker.action == DELETEALL:
                self.markers.clear()
            else:
                raise AssertionError(f"action {marker.action}")

    def of(self, ns):
        return {i: marker for (name, i), marker in self.markers.items() if name == ns}


def place_of(marker):
    assert marker.pose.orientation.w == 1, "a marker that is turned cannot be drawn"
    place = marker.pose.position
    return np.array([place.x, place.y, place.z])


def points_of(marker):
    return np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3) + place_of(marker)


class Camera:
    """Looks at the middle of what is seen, from `yaw` and `pitch` (degrees) around it; nearer than whence all is seen by
    `zoom`."""

    def __init__(self, points, size, yaw, pitch, zoom):
        yaw, pitch = math.radians(yaw), math.radians(pitch)
        right = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        self.towards_viewer = np.array(
            [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)])
        self.axes = np.array([right, np.cross(self.towards_viewer, right), self.towards_viewer])
        self.size = np.array(size)
        self.focal = size[1] / 2 / math.tan(FIELD_OF_VIEW / 2)
        half = self.size / 2 / self.focal * 0.94
        middle = points.mean(0)
        # What is near is larger: where the middle lies and how far away it must be depend on each other.
        for _ in range(4):
            local = (points - middle) @ self.axes.T
            distance = max((np.abs(local[:, axis]) / half[axis] + local[:, 2]).max() for axis in (0, 1))
            seen = local[:, :2] / (distance - local[:, 2:])
            middle = middle + (seen.max(0) + seen.min(0)) / 2 * distance @ self.axes[:2]
        self.eye = middle + self.towards_viewer * distance / zoom

    def project(self, points):
        """(x right, y down [px], depth [m]) of each point."""
        local = (points - self.eye) @ self.axes.T
        depth = np.maximum(-local[:, 2], 1e-3)
        xy = local[:, :2] * self.focal / depth[:, None]
        return np.column_stack([self.size[0] / 2 + xy[:, 0], self.size[1] / 2 - xy[:, 1], depth])


class Canvas:
    def __init__(self, size):
        self.width, self.height = size
        self.colour = np.full((self.height, self.width, 3), BACKGROUND, np.float32)
        self.depth = np.full((self.height, self.width), np.inf, np.float32)

    def triangle(self, corners, colour, alpha=1.0):
        """Where nothing nearer is; what lets nothing through hides what comes later behind it."""
        low = np.maximum(np.floor(corners[:, :2].min(0)), 0).astype(int)
        high = np.minimum(np.ceil(corners[:, :2].max(0)), [self.width, self.height]).astype(int)
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
        doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if (high <= low).any() or abs(doubled) < 1e-9:
            return
        y, x = np.mgrid[low[1]:high[1], low[0]:high[0]] + 0.5
        b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / doubled
        c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / doubled
        a = 1 - b - c
        # What is flat in space has a reciprocal of the depth that is flat in the picture.
        depth = 1 / np.where((a >= 0) & (b >= 0) & (c >= 0), a / az + b / bz + c / cz, 1e-9)
        there = np.s_[low[1]:high[1], low[0]:high[0]]
        seen = (a >= 0) & (b >= 0) & (c >= 0) & (depth < self.depth[there])
        self.colour[there][seen] = (1 - alpha) * self.colour[there][seen] + alpha * np.asarray(colour, np.float32)
        if alpha >= OPAQUE:
            self.depth[there][seen] = depth[seen]

    def picture(self):
        size = (self.width // SAMPLES, self.height // SAMPLES)
        return Image.fromarray(np.clip(self.colour + 0.5, 0, 255).astype(np.uint8)).resize(size, Image.Resampling.BOX)


def rgb(marker):
    return 255 * np.array([marker.color.r, marker.color.g, marker.color.b])


def lit(colour, normal, camera):
    """Half is there in any case, half depends on how much it faces the viewer."""
    return colour * (0.5 + 0.5 * max(0.0, float(normal @ camera.towards_viewer)))


def draw_surface(canvas, camera, marker):
    corners = points_of(marker)
    projected = camera.project(corners).reshape(-1, 3, 3)
    for triangle, flat in zip(corners.reshape(-1, 3, 3), projected):
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        normal /= max(np.linalg.norm(normal), 1e-12)
        canvas.triangle(flat, lit(rgb(marker), normal, camera), marker.color.a)


def draw_lines(canvas, camera, marker):
    ends = camera.project(points_of(marker)).reshape(-1, 2, 3)
    for start, end in ends:
        along = end[:2] - start[:2]
        across = np.array([-along[1], along[0]]) / max(np.hypot(*along), 1e-9)
        # As wide as it is in space, and wide enough to be seen; a little in front of the surface that it lies on.
        half = [max(0.5 * marker.scale.x * camera.focal / depth, 0.5 * SAMPLES) for depth in (start[2], end[2])]
        corners = np.array([(*(p[:2] + side * h * across), p[2] * 0.995)
                            for p, h in ((start, half[0]), (end, half[1])) for side in (-1, 1)])
        for three in ((0, 1, 2), (1, 2, 3)):
            canvas.triangle(corners[list(three)], rgb(marker), marker.color.a)


def draw_cubes(canvas, camera, marker):
    """The three sides of each cube that are seen."""
    edge = marker.scale.x
    centres = points_of(marker)
    for axis in range(3):
        normal = np.zeros(3)
        normal[axis] = 1.0 if camera.towards_viewer[axis] > 0 else -1.0
        u, v = np.roll(np.eye(3), 1, 0)[axis], np.roll(np.eye(3), 2, 0)[axis]
        corners = [camera.project(centres + edge / 2 * (normal + s * u + t * v)) for s, t in
                   ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for a, b, c, d in zip(*corners):
            for three in ((a, b, c), (a, c, d)):
                canvas.triangle(np.array(three), lit(rgb(marker), normal, camera))


def draw_texts(picture, camera, markers):
    """The largest first; RViz draws those too that would lie on one before."""
    draw, taken = ImageDraw.Draw(picture), []
    for marker in sorted(markers, key=lambda marker: -marker.scale.z):
        x, y, depth = camera.project(place_of(marker)[None])[0]
        size = marker.scale.z * camera.focal / depth / SAMPLES
        font = ImageFont.load_default(max(size, SMALLEST_TEXT))
        place = x / SAMPLES, y / SAMPLES
        left, top, right, bottom = draw.textbbox(place, marker.text, font, "mm")
        if any(left < r and l < right and top < b and t < bottom for l, t, r, b in taken):
            continue
        taken.append((left, top, right, bottom))
        draw.text(place, marker.text, "white", font, "mm", stroke_width=1, stroke_fill=(30, 30, 30))


def draw(viewer, size=(1200, 700), yaw=-112, pitch=45, zoom=1.0):
    """The picture; `yaw` and `pitch` are where the viewer stands, in degrees."""
    kinds = {kind: [m for m in viewer.markers.values() if m.type == kind] for kind in
             (LINE_LIST, CUBE_LIST, TEXT, TRIANGLE_LIST)}
    solid = [points_of(m) for kind in (TRIANGLE_LIST, CUBE_LIST) for m in kinds[kind]]
    large = (size[0] * SAMPLES, size[1] * SAMPLES)
    canvas = Canvas(large)
    if not solid:
        return canvas.picture()
    camera = Camera(np.concatenate(solid), large, yaw, pitch, zoom)
    for marker in kinds[CUBE_LIST]:
        draw_cubes(canvas, camera, marker)
    rest = [(marker, draw_lines) for marker in kinds[LINE_LIST]]
    rest += [(marker, draw_surface) for marker in kinds[TRIANGLE_LIST]]

    def order(item):
        marker, _ = item
        return marker.color.a < OPAQUE, -np.linalg.norm(place_of(marker) - camera.eye)

    for marker, drawn in sorted(rest, key=order):
        drawn(canvas, camera, marker)
    picture = canvas.picture()
    draw_texts(picture, camera, kinds[TEXT])
    return picture


def main():
    from result import ResultBag
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bag")
    parser.add_argument("picture")
    parser.add_argument("--yaw", type=float, default=-112)
    parser.add_argument("--pitch", type=float, default=45)
    parser.add_argument("--zoom", type=float, default=1.0)
    options = parser.parse_args()
    viewer = Viewer()
    for message in ResultBag(options.bag).on("/cfodi/markers"):
        viewer.take(message.value)
    picture = draw(viewer, yaw=options.yaw, pitch=options.pitch, zoom=options.zoom)
    # Few colours are in it: a palette makes it a third as large.
    picture.quantize(256, dither=Image.Dither.NONE).save(options.picture, optimize=True)


if __name__ == "__main__":
    main()
