"""Depth images and their cameras as serialised messages: built once, then only their stamp changes."""

import array
import io
import struct
import types

import numpy as np
import PIL.Image
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

import clouds

WALL_WIDTH, WALL_HEIGHT, WALL_FOCAL_LENGTH = 160, 120, 160.0  # small enough for any socket buffer


def image(pixels, frame_id=clouds.OPTICAL):
    """sensor_msgs/Image of `pixels`: uint16 in millimetres or float32 in metres."""
    height, width = pixels.shape
    return bytes(serialize_message(Image(
        header=Header(frame_id=frame_id), height=height, width=width,
        encoding={"uint16": "16UC1", "float32": "32FC1"}[pixels.dtype.name], is_bigendian=0,
        step=width * pixels.itemsize, data=array.array("B", pixels.tobytes()))))


def compressed(pixels, frame_id=clouds.OPTICAL):
    """What compressed_depth_image_transport makes of such pixels: a PNG of millimetres or of inverse depths."""
    a = b = 0.0
    encoding = "16UC1"
    if pixels.dtype == np.float32:
        a, encoding = 100.0 * 101.0, "32FC1"
        b = 1.0 - a / 10.0
        near = pixels < 10.0
        pixels = np.where(near, a / np.where(near, pixels, 1.0) + b, 0.0).astype(np.uint16)
    png = io.BytesIO()
    PIL.Image.fromarray(pixels).save(png, "PNG")
    return bytes(serialize_message(CompressedImage(
        header=Header(frame_id=frame_id), format=f"{encoding}; compressedDepth png",
        data=array.array("B", struct.pack("<iff", 0, a, b) + png.getvalue()))))


def camera_info(width, height, fx, fy, cx, cy):
    return bytes(serialize_message(CameraInfo(
        header=Header(frame_id=clouds.OPTICAL), height=height, width=width, distortion_model="plumb_bob", d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])))


def wall_info():
    focal = WALL_FOCAL_LENGTH
    return camera_info(WALL_WIDTH, WALL_HEIGHT, focal, focal, (WALL_WIDTH - 1) / 2, (WALL_HEIGHT - 1) / 2)


def wall(kind=np.uint16, distance=2.04):
    """A wall in front of the camera."""
    value = distance * 1000 if kind == np.uint16 else distance
    return np.full((WALL_HEIGHT, WALL_WIDTH), round(value) if kind == np.uint16 else value, kind)


def cabinet_info(folder):
    camera = clouds.cabinet_camera(folder)
    fx, _, cx, _, fy, cy = map(float, camera["K"][:6])
    return camera_info(camera["width"], camera["height"], fx, fy, cx, cy)


def cabinet(folder, form=image, count=None):
    """The cabinet recording, an image at a time: `.cloud` (640x480, millimetres) and `.transform`, both serialised."""
    per_unit = 1000 / clouds.cabinet_camera(folder)["depth_scale_per_m"]
    for depth, transform in clouds.cabinet_rows(folder, count):
        millimetres = np.round(depth * per_unit).astype(np.uint16)
        yield types.SimpleNamespace(cloud=form(millimetres), transform=transform)
