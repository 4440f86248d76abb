"""One bag in every container that MCAP writers make of it: the map is the same."""

import io
import shutil

import bags
import pytest
import scene
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from replay import Replay, cfodi, same_map

CONTAINERS = {
    "lz4": {"compression": CompressionType.LZ4},
    "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 300_000},
    "a chunk a message": {"compression": CompressionType.ZSTD, "chunk_size": 1},
    "one chunk": {"compression": CompressionType.NONE, "chunk_size": 1 << 30},
    "no chunks": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE, "use_statistics": False},
    "no summary": {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False,
                   "repeat_schemas": False, "repeat_channels": False},
    "crc": {"enable_crcs": True, "enable_data_crcs": True},
}


@pytest.fixture(scope="session")
def plain(space):
    return scene.write(space / "container-scene", scene.cloud)


def rewrite(folder, path, order=iter, **options):
    """The messages of a bag, in an order of their own, in another container, as the library `mcap` writes it."""
    reader = make_reader(io.BytesIO(bags.only_file(folder).read_bytes()))
    with open(path, "wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2", "test")
        schemas, ids = {}, {}
        for schema, channel, message in order(reader.iter_messages()):
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in ids:
                ids[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], dict(channel.metadata))
            writer.add_message(ids[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


@pytest.mark.parametrize("container", CONTAINERS)
def test_the_container_makes_no_difference(container, plain, tmp_path):
    path = rewrite(plain, tmp_path / "bag.mcap", **CONTAINERS[container])
    run = Replay(path, tmp_path / "out", parameters={"mode": "paper"})
    assert run.summary()["scans"] == scene.SCANS
    same_map(run, Replay(plain, tmp_path / "plain", parameters={"mode": "paper"}))


def test_messages_out_of_order_in_the_file_are_taken_in_the_order_of_their_time(plain, tmp_path):
    """A recorder writes as messages arrive; two topics are rarely in the order of their log times."""
    def swapped(messages):
        messages = list(messages)
        clouds = [m for m in messages if m[1].topic == bags.POINTS]
        return [m for m in messages if m[1].topic != bags.POINTS] + clouds

    path = rewrite(plain, tmp_path / "bag.mcap", order=swapped, compression=CompressionType.ZSTD)
    same_map(Replay(path, tmp_path / "a", parameters={"mode": "paper"}),
             Replay(plain, tmp_path / "b", parameters={"mode": "paper"}))


def test_several_zstd_frames_in_a_row_are_one_file(plain, tmp_path):
    """What `cat` makes of two parts, each compressed by itself, and what some compressors write."""
    data = bags.only_file(plain).read_bytes()
    middle, pack = len(data) // 2, zstandard.ZstdCompressor().compress
    (tmp_path / "bag.mcap.zstd").write_bytes(pack(data[:middle]) + pack(data[middle:]))
    same_map(Replay(tmp_path / "bag.mcap.zstd", tmp_path / "a", parameters={"mode": "paper"}),
             Replay(plain, tmp_path / "b", parameters={"mode": "paper"}))


def test_a_damaged_chunk_is_said_and_ends_with_1(plain, tmp_path):
    path = rewrite(plain, tmp_path / "bag.mcap", compression=CompressionType.ZSTD, chunk_size=200_000, enable_crcs=True)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle:middle + 64] = bytes(64)
    path.write_bytes(data)
    run = Replay(path, tmp_path / "out", outputs=("summary",), status=1)
    assert run.summary()["scans"] < scene.SCANS and "panicked" not in run.stderr


def test_a_folder_whose_file_is_missing_is_refused_by_name(plain, tmp_path):
    folder = shutil.copytree(plain, tmp_path / "bag")
    missing = bags.only_file(folder)
    missing.unlink()
    done = cfodi("replay", folder)
    assert done.returncode in (1, 2) and missing.name in done.stderr and "panicked" not in done.stderr
