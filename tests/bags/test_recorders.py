"""What recorders do: log times of arrival, several writers of one topic, split bags, topics of any kind."""

import io
import shutil

import bags
import pytest
import scene
from bags import Bag
from mcap.reader import make_reader
from mcap.writer import Writer
from replay import Replay, cfodi, same_map

PAPER = {"mode": "paper"}


@pytest.fixture(scope="session")
def plain(space):
    return scene.write(space / "recorder-scene", scene.cloud)


@pytest.fixture(scope="session")
def usual(plain, space):
    return Replay(plain, space / "recorder-usual", parameters=PAPER)


def rewrite(folder, path, change):
    """A bag whose messages go through `change(number, topic, log time)` -> (name of the channel, new log time)."""
    with open(path, "wb") as file:
        writer, channels = Writer(file), {}
        writer.start("ros2", "test")
        for number, (schema, channel, message) in enumerate(
                make_reader(io.BytesIO(bags.only_file(folder).read_bytes())).iter_messages()):
            name, log_time = change(number, channel.topic, message.log_time)
            if name not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[name] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(channels[name], log_time, message.data, message.log_time)
        writer.finish()
    return path


@pytest.mark.parametrize("late", [bags.POINTS, "/tf"])
def test_log_times_of_arrival_do_not_matter(late, plain, usual, tmp_path):
    """A recorder logs when a message arrives: clouds some 40 ms after their stamp, or transforms after their clouds."""
    path = rewrite(plain, tmp_path / "bag.mcap", lambda _, topic, time: (topic, time + 40_000_000 * (topic == late)))
    run = Replay(path, tmp_path / "out", parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS, run.summary()["scans_skipped"]
    same_map(run, usual)


def test_a_topic_of_two_writers_is_one_topic(plain, usual, tmp_path):
    path = rewrite(plain, tmp_path / "bag.mcap", lambda number, topic, time: ((topic, number % 2), time))
    same_map(Replay(path, tmp_path / "out", parameters=PAPER), usual)


def test_topics_of_other_kinds_are_no_hindrance(plain, usual, tmp_path):
    """JSON, a channel without a schema, encodings that nobody knows: they pass through to a result with the input."""
    path = tmp_path / "bag.mcap"
    with open(path, "wb") as file:
        writer, channels = Writer(file), {}
        writer.start("ros2", "test")
        strange = [writer.register_channel("/json", "json", 0), writer.register_channel("/bytes", "", 0),
                   writer.register_channel("/idl", "cdr", writer.register_schema("a/msg/B", "ros2idl", b"module a {};")),
                   writer.register_channel("/fake", "protobuf", writer.register_schema(
                       "sensor_msgs/msg/PointCloud2", "protobuf", b""))]
        for schema, channel, message in make_reader(io.BytesIO(bags.only_file(plain).read_bytes())).iter_messages():
            if channel.topic not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
            for one in strange:
                writer.add_message(one, message.log_time, b"{}", message.publish_time)
        writer.finish()
    run = Replay(path, tmp_path / "out", "--with-input", topics=[bags.POINTS], parameters=PAPER)
    same_map(run, usual)
    with open(run.path("out"), "rb") as file:
        topics = [channel.topic for channel in make_reader(file).get_summary().channels.values()]
    assert {"/json", "/bytes", "/idl", "/fake", bags.POINTS} <= set(topics)


def test_a_split_bag_is_read_whole_or_refused(plain, usual, tmp_path):
    """`ros2 bag record` with a size limit: one folder, several files in metadata.yaml. Never the first file alone."""
    folder = tmp_path / "split"
    folder.mkdir()
    name, half = bags.only_file(plain).name, scene.stamps()[5] - 1
    with open(bags.only_file(plain), "rb") as file:
        read = list(make_reader(file).iter_messages())
    parts = [m for m in read if m[2].log_time <= half], [m for m in read if m[2].log_time > half]
    for number, part in enumerate(parts):
        with open(folder / f"split_{number}.mcap", "wb") as file:
            writer, channels = Writer(file), {}
            writer.start("ros2", "test")
            for schema, channel, message in part:
                if channel.topic not in channels:
                    kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind)
                writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
            writer.finish()
    metadata = (plain / "metadata.yaml").read_text()
    split = metadata.replace(f"  - {name}\n", "  - split_0.mcap\n  - split_1.mcap\n")
    assert split != metadata
    (folder / "metadata.yaml").write_text(split)
    same_map(Replay(folder, tmp_path / "out", parameters=PAPER), usual)


def test_a_bag_played_twice_in_a_row_is_two_sessions(tmp_path):
    """Stamps jump back by seconds: the map begins anew, as in the live node, and is that of the second round."""
    with Bag(tmp_path / "once") as bag:
        bag.static(scene.START - 1)
        for scan in range(scene.SCANS):
            stamp = scene.START + scan * bags.SECOND // 2
            bag.transform(stamp, "map", "camera_link", *scene.pose(stamp))
            scene.cloud(bag, stamp, scan)
    once = Replay(tmp_path / "once", tmp_path / "out-once", parameters=PAPER)
    twice = Replay(rewrite_twice(tmp_path / "once", tmp_path / "bag.mcap"), tmp_path / "out-twice", parameters=PAPER)
    assert twice.summary()["scans"] == 2 * scene.SCANS, twice.summary()["scans_skipped"]
    same_map(once, twice)


def rewrite_twice(folder, path):
    """The log times go on, the stamps begin again: what records a player in a loop."""
    data, round_trip = bags.only_file(folder).read_bytes(), 10 * bags.SECOND
    with open(path, "wb") as file:
        writer, channels = Writer(file), {}
        writer.start("ros2", "test")
        for number in range(2):
            for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
                if channel.topic not in channels:
                    kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind)
                writer.add_message(channels[channel.topic], message.log_time + number * round_trip, message.data, 0)
        writer.finish()
    return path


def test_an_image_before_its_camera_info_waits_for_it(tmp_path):
    for name in ("before", "behind"):
        with Bag(tmp_path / name) as bag:
            bag.static(scene.START - 1)
            scene.moves(bag)
            for scan, stamp in enumerate(scene.stamps()):
                if name == "behind":
                    bag.image(stamp, scene.depth(scan))
                bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL)
                if name == "before":
                    bag.image(stamp, scene.depth(scan))
    behind, before = (Replay(tmp_path / name, tmp_path / f"{name}-out", parameters=PAPER)
                      for name in ("behind", "before"))
    assert behind.summary()["scans"] == scene.SCANS, behind.summary()["scans_skipped"]
    same_map(behind, before)


def test_images_without_any_camera_info_are_skipped_and_counted(tmp_path):
    folder = scene.write(tmp_path / "bare", lambda bag, stamp, scan: bag.image(stamp, scene.depth(scan)))
    done = cfodi("replay", folder, "--summary", tmp_path / "S.json")
    assert done.returncode == 2 and "camera_info" in done.stderr


def test_a_bag_copied_without_its_metadata_is_a_bag(plain, usual, tmp_path):
    folder = shutil.copytree(plain, tmp_path / "bag")
    (folder / "metadata.yaml").unlink()
    done = cfodi("replay", folder, "--voxels", tmp_path / "V.csv", "--ros-args", "-p", "mode:=paper")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "V.csv").read_bytes() == usual.bytes("voxels")
