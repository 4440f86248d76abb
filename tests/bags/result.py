"""A result bag as other programs read it: `mcap`, `mcap-ros2-support`, `rosbags`."""

from collections import namedtuple

import bags
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

ARRAY = "cfodi_msgs/msg/SurfaceClusterArray"
TOPICS = {
    "/cfodi/clusters": ARRAY, "/cfodi/clusters_delta": ARRAY, "/cfodi/markers": "visualization_msgs/msg/MarkerArray",
    "/cfodi/points_labelled": "sensor_msgs/msg/PointCloud2", "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}
SNAPSHOT, DELTA = 0, 1

Decoded = namedtuple("Decoded", "topic log_time publish_time type value")


class ResultBag:
    """All messages of an MCAP file, decoded by the schemas in it."""

    def __init__(self, path):
        with open(path, "rb") as file:
            reader = make_reader(file, validate_crcs=True)
            self.header, summary = reader.get_header(), reader.get_summary()
            self.statistics = summary.statistics
            self.schemas = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
            self.channels = {channel.topic: channel for channel in summary.channels.values()}
        with open(path, "rb") as file:
            decoding = make_reader(file, decoder_factories=[DecoderFactory()])
            self.messages = [Decoded(channel.topic, message.log_time, message.publish_time, schema.name, value)
                             for schema, channel, message, value in decoding.iter_decoded_messages(log_time_order=False)]

    def on(self, topic):
        return [message for message in self.messages if message.topic == topic]


def stamp(header):
    return header.stamp.sec * bags.SECOND + header.stamp.nanosec


def plain(value):
    """A decoded message as nested tuples and numbers; NaN equals NaN."""
    if hasattr(value, "__slots__"):
        return tuple(plain(getattr(value, name)) for name in value.__slots__)
    if isinstance(value, (list, tuple)):
        return tuple(map(plain, value))
    return "NaN" if value != value else value
