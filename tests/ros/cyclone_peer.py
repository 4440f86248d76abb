"""A robot on CycloneDDS: its types have the fields that ROS says its own have, and its messages are the bytes of rclpy's."""

import functools
import importlib
import re
import struct
import time

from cfodi_msgs.msg import SurfaceClusterArray
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rclpy.serialization import deserialize_message, serialize_message
from tf2_msgs.msg import TFMessage

import clouds
from peer import until_taken_in, wait_until

#: What a test's network has is `lo`, of which CycloneDDS expects no multicast.
LOOPBACK = """<CycloneDDS><Domain><General><AllowMulticast>true</AllowMulticast>
<Interfaces><NetworkInterface name="lo"/></Interfaces></General></Domain></CycloneDDS>"""
PLAIN = {"boolean": bool, "octet": types.uint8, "float": types.float32, "double": types.float64, "string": str} | {
    f"{sign}int{bits}": getattr(types, f"{sign}int{bits}") for sign in ("", "u") for bits in (8, 16, 32, 64)}
#: What rmw_cyclonedds_cpp writes before a call and its answer: who calls, and which of its calls it is.
CALLER = (("guid", types.uint64), ("sequence_number", types.int64))
GUID = 0x0123_4567_89AB_CDEF
ENCAPSULATION = 4  # bytes before a message's first


def qos(depth=5, reliable=True, latched=False):
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile, Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True))


def field(name):
    """The type of a field from its name in ROS."""
    if listed := re.fullmatch(r"sequence<(.*)>", name):
        return types.sequence[field(listed[1])]
    if counted := re.fullmatch(r"(.*)\[(\d+)\]", name):
        return types.array[field(counted[1]), int(counted[2])]
    if name in PLAIN:
        return PLAIN[name]
    package, kind = name.split("/")
    return structure(getattr(importlib.import_module(f"{package}.msg"), kind))


@functools.cache
def structure(ros_type, before=()):
    """The type that CycloneDDS has in the place of one of ROS, with further fields before those."""
    package, kind = ros_type.__module__.split(".")[:2]
    fields = {name: field(of) for name, of in ros_type.get_fields_and_field_types().items()}
    fields = fields or {"structure_needs_at_least_one_member": types.uint8}
    name = ros_type.__name__ + "_"
    return make_idl_struct(name, f"{package}.{kind}.dds_.{name}", dict(before) | fields)


class Inbox:
    """The messages of a topic, in the types of rclpy."""

    def __init__(self, reader, ros_type):
        self._reader, self._type, self._messages = reader, ros_type, []

    def all(self):
        """Those that have come."""
        samples = self._reader.take(1000)
        samples = [sample for sample in samples if sample.sample_info.valid_data]  # others tell that a writer is gone
        self._messages += [deserialize_message(sample.serialize(use_version_2=False), self._type) for sample in samples]
        return self._messages

    def wait(self, what, condition=lambda message: True, timeout=60):
        """The first that meets the condition."""
        return wait_until(what, lambda: [message for message in self.all() if condition(message)], timeout)[0]

    def has_publisher(self):
        return bool(self._reader.get_matched_publications())


class Client:
    """Calls a service as rmw_cyclonedds_cpp does."""

    def __init__(self, participant, name, service_type):
        self._calls, self._answer = 0, service_type.Response
        self._asked, answered = structure(service_type.Request, CALLER), structure(service_type.Response, CALLER)
        self._writer = DataWriter(participant, Topic(participant, f"rq{name}Request", self._asked), qos=qos())
        self._reader = DataReader(participant, Topic(participant, f"rr{name}Reply", answered), qos=qos())

    def is_there(self):
        return self._writer.get_matched_subscriptions() and self._reader.get_matched_publications()

    def ask(self, request):
        """Sends a call; returns its number."""
        self._calls += 1
        data = serialize_message(request)
        header = struct.pack("<Qq", GUID, self._calls)
        self._writer.write(self._asked.deserialize(data[:ENCAPSULATION] + header + data[ENCAPSULATION:]))
        return self._calls

    def answers(self, call):
        """The answers to a call that have come since the last look."""
        for sample in self._reader.take(100):
            assert sample.guid == GUID, "the answer is another caller's"
            data = sample.serialize(use_version_2=False)
            if sample.sequence_number == call:
                yield deserialize_message(data[:ENCAPSULATION] + data[ENCAPSULATION + 16:], self._answer)


class Robot:
    """Publishes what a driver does, and reads what the node sends."""

    def __init__(self):
        self._domain = Domain(0, LOOPBACK)
        self._participant = DomainParticipant(0)
        self._writers, self.sent = {}, 0
        self.deltas = self.read("/cfodi/clusters_delta", SurfaceClusterArray, depth=2000)

    def close(self):
        self._writers.clear()
        del self.deltas, self._participant, self._domain

    def publisher(self, topic, ros_type, **more):
        if topic not in self._writers:
            written = Topic(self._participant, f"rt{topic}", structure(ros_type))
            self._writers[topic] = DataWriter(self._participant, written, qos=qos(**more))
        return self._writers[topic]

    def publish(self, topic, ros_type, data, **more):
        """Sends a serialised message."""
        self.publisher(topic, ros_type, **more).write(structure(ros_type).deserialize(data))

    def call(self, name, service_type, request, attempts=3, timeout=8):
        """The answer to a call; asked again where none comes, while the two sides meet."""
        client = Client(self._participant, name, service_type)
        wait_until(f"the service {name}", client.is_there)
        for _ in range(attempts):
            call, end = client.ask(request), time.monotonic() + timeout
            while time.monotonic() < end:
                for answer in client.answers(call):
                    return answer
                time.sleep(0.01)
        raise AssertionError(f"{name} did not answer {attempts} calls")

    def read(self, topic, ros_type, **more):
        read = Topic(self._participant, f"rt{topic}", structure(ros_type))
        return Inbox(DataReader(self._participant, read, qos=qos(**more)), ros_type)

    def meet(self):
        """Waits for the node's subscriptions and its deltas. What a best-effort subscription misses before it is matched on both
        sides, nobody counts: hence the pause."""
        self.publish("/tf_static", TFMessage, clouds.static_transform(), latched=True, depth=1)
        self.publisher("/tf", TFMessage, depth=100)
        for name, writer in self._writers.items():
            wait_until(f"a subscription of {name}", writer.get_matched_subscriptions)
        wait_until("a publisher of deltas", self.deltas.has_publisher)
        time.sleep(1.5)

    def drive(self, topic, ros_type, data, count=20, rate=5):
        """The same message again and again, each time with its transform, and not before the delta of the one before has come; once
        more where none comes."""
        still = clouds.still_transform()

        def send():
            stamp = time.time_ns()
            self.publish("/tf", TFMessage, clouds.stamped(still, clouds.TF_STAMP, stamp))
            self.publish(topic, ros_type, clouds.stamped(data, clouds.CLOUD_STAMP, stamp))
            self.sent += 1
            time.sleep(1 / rate)
            return stamp

        for _ in range(count):
            until_taken_in(send, self.deltas, seconds=5)
