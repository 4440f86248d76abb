"""Inputs that are cut, are no bags, or hold something else; arguments and parameters that cannot be."""

import random
import shlex
import shutil
import struct

import bags
import pytest
import zstandard
from mcap.reader import make_reader
from replay import OUTPUTS, Replay, cfodi

MESSAGE, CHUNK = 0x05, 0x06


def records(data, start, end):
    """(opcode, start of the content, its length, whether it is whole) of MCAP records; what is cut comes last."""
    while start + 9 <= end:
        opcode, length = data[start], struct.unpack_from("<Q", data, start + 1)[0]
        yield opcode, start + 9, length, start + 9 + length <= end
        start += 9 + length


def stamps_before(data, topic_ids):
    """Log times of the messages of some channels in an uncompressed MCAP that ends anywhere: in whole chunks; in all."""
    whole, every = [], []
    for opcode, at, length, complete in records(data, 8, len(data)):
        if opcode != CHUNK or at + 40 > len(data):
            continue
        inner = at + 40  # two times, size, CRC, no compression, length of the records
        for kind, begin, _, there in records(data, inner, min(at + length, len(data))):
            if kind == MESSAGE and there and struct.unpack_from("<H", data, begin)[0] in topic_ids:
                stamp = struct.unpack_from("<Q", data, begin + 6)[0]
                every.append(stamp)
                if complete:
                    whole.append(stamp)
    return whole, every


def channels(bag):
    with bags.AnyReader([bag]) as reader:
        return {connection.topic: connection.id for connection in reader.connections}


def scans_before(data, ids):
    """(least, most) scans with a transform before the cut: those of whole chunks, those of the last part of one too."""
    (clouds, more_clouds), (transforms, more_transforms) = (
        stamps_before(data, {ids[topic]}) for topic in (bags.POINTS, "/tf"))
    return len(set(clouds) & set(transforms)), len(set(more_clouds) & set(more_transforms))


def inflated(data):
    """What comes out of a zstd stream that ends anywhere."""
    stream, out = zstandard.ZstdDecompressor().decompressobj(), b""
    for start in range(0, len(data), 1 << 16):
        out += stream.decompress(data[start:start + (1 << 16)])
    return out


@pytest.mark.parametrize("compression", ["plain", "file"])
def test_a_cut_bag_gives_the_scans_before_the_cut(compression, recording, tmp_path):
    folder = recording("cabinet").folder(compression)
    ids, data, name = channels(folder), bags.only_file(folder).read_bytes(), bags.only_file(folder).name
    picked = random.Random(20).sample(range(len(data) // 50, len(data)), 4)
    for cut in sorted(picked):
        bag = tmp_path / f"{cut}-{name}"
        bag.write_bytes(data[:cut])
        least, most = scans_before(data[:cut] if compression == "plain" else inflated(data[:cut]), ids)
        run = Replay(bag, tmp_path / str(cut), outputs=("summary", "voxels"), status=1)
        scans = run.summary()["scans"]
        print(f"cut at {cut} of {len(data)}: {least} to {most} scans, {scans}; {run.stderr.strip().splitlines()[-1]}")
        assert scans == most if compression == "plain" else least <= scans <= most
        assert f"{scans} scans" in run.stderr, f"it does not say how much was read: {run.stderr}"
        assert "panicked" not in run.stderr


@pytest.mark.parametrize("compression", ["storage", "message"])
def test_a_cut_of_compressed_messages_gives_what_a_whole_bag_begins_with(compression, recording, tmp_path):
    one = recording("cabinet")
    file = bags.only_file(one.folder(compression))
    data = file.read_bytes()
    for share in (0.3, 0.8):
        cut = shutil.copy(file, tmp_path / f"{share}.mcap")
        with open(cut, "r+b") as opened:
            opened.truncate(int(share * len(data)))
        run = Replay(cut, tmp_path / str(share), outputs=("summary",), status=1)
        assert abs(run.summary()["scans"] - share * one.scans) <= 5
        assert f"{run.summary()['scans']} scans" in run.stderr and "panicked" not in run.stderr


@pytest.mark.parametrize("left", [1, 30, 4000])
def test_a_bag_cut_after_its_last_message_is_read_whole_and_yet_said_to_be_cut(left, recording, tmp_path):
    one = recording("cabinet")
    bag = tmp_path / "cut.mcap"
    bag.write_bytes(bags.only_file(one.folder()).read_bytes()[:-left])
    run = Replay(bag, tmp_path / "out", parameters={"mode": "paper"}, outputs=("summary", "voxels"), status=1)
    assert run.summary()["scans"] == one.scans
    assert run.bytes("voxels") == one.replay().bytes("voxels")


@pytest.mark.parametrize("name, content", [
    ("missing.mcap", None), ("empty.mcap", b""), ("text.mcap", b"This is no bag.\n" * 100), ("text.txt", b"no bag\n"),
    ("magic.mcap", b"\x89MCAP0\r\n"), ("empty.mcap.zstd", b""), ("text.mcap.zstd", b"no zstd\n" * 100)])
def test_what_is_no_bag_is_refused_by_name(name, content, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, tmp_path, name)


def refused(bag, folder, *said):
    """It ends with an error that holds `said`, and leaves no outputs behind that could be taken for a map."""
    out = folder / "refused"
    out.mkdir()
    done = cfodi("replay", bag, *(part for name in ("voxels", "out") for part in (f"--{name}", out / OUTPUTS[name])))
    assert done.returncode in (1, 2), done.stderr
    assert all(part in done.stderr for part in said), done.stderr
    assert "panicked" not in done.stderr
    assert not (out / OUTPUTS["voxels"]).exists() or (out / OUTPUTS["voxels"]).read_text().count("\n") == 1
    return done


def test_a_folder_without_a_bag_is_refused_by_name(tmp_path):
    (tmp_path / "nothing").mkdir()
    refused(tmp_path / "nothing", tmp_path, "nothing")


def test_a_ros_1_bag_is_refused_with_the_command_that_converts_it(recording, tmp_path):
    refused(recording("cabinet").bag(), tmp_path, "rosbags-convert", "--dst-storage mcap")


def test_a_bag_in_sqlite_is_refused_with_the_command_that_converts_it(recording, tmp_path):
    folder = bags.convert(recording("cabinet").bag(), tmp_path / "sqlite", "--include-topic", "/tf", storage="sqlite3")
    (tmp_path / "one").mkdir()
    refused(bags.only_file(folder), tmp_path / "one", "rosbags-convert", "--dst-storage mcap")
    converted_as_said(refused(folder, tmp_path, "rosbags-convert", "--dst-storage mcap"))


@pytest.mark.parametrize("is_named", [True, False])
def test_a_data_base_without_metadata_is_converted_by_the_command_that_is_said(is_named, recording, tmp_path):
    folder = bags.convert(recording("cabinet").bag(), tmp_path / "sqlite", "--include-topic", "/tf", storage="sqlite3")
    alone = tmp_path / "left by a recorder" / "run_0.db3"
    alone.parent.mkdir()
    shutil.copy(bags.only_file(folder), alone)
    converted_as_said(refused(alone if is_named else alone.parent, tmp_path, "rosbags-convert"))


def test_a_folder_with_a_ros_1_bag_is_refused_with_the_command_that_converts_it(recording, tmp_path):
    folder = tmp_path / "ros1"
    folder.mkdir()
    (folder / "run.bag").symlink_to(recording("cabinet").bag())
    said = refused(folder, tmp_path, "rosbags-convert").stderr
    assert f"--src {folder}/run.bag --dst {folder}/run " in said


def converted_as_said(refusal):
    """Runs the command of a refusal, and reads what it makes."""
    command = shlex.split(refusal.stderr[refusal.stderr.index("rosbags-convert"):])
    bags.run(*command)
    done = cfodi("replay", command[command.index("--dst") + 1])
    assert "the bag has no point cloud" in done.stderr, "a bag that is read, and has transforms alone"


def test_a_topic_that_is_not_there_is_answered_with_those_that_are(recording):
    done = cfodi("replay", recording("cabinet").folder(), "--topic", "/camera/deep/points")
    assert done.returncode == 2
    assert all(part in done.stderr for part in ("/camera/deep/points", bags.POINTS, "sensor_msgs/msg/PointCloud2"))


def test_a_topic_that_is_no_sensor_is_refused(recording):
    done = cfodi("replay", recording("cabinet").folder(), "--topic", "/tf")
    assert done.returncode == 2 and "/tf" in done.stderr and bags.POINTS in done.stderr


@pytest.mark.parametrize("name, value, said", [
    ("voxel_size", "0.0", "voxel_size"), ("voxel_size", "wide", "wide"), ("voxel_sise", "0.1", "voxel_size"),
    ("mode", "nonsense", "consistent"), ("max_normal_angle", "4.0", "max_normal_angle"), ("min_points", "0", "min_points")])
def test_a_parameter_that_cannot_be_ends_it_with_2(name, value, said, recording, tmp_path):
    done = cfodi("replay", recording("cabinet").folder(), "--voxels", tmp_path / "V.csv", "--ros-args", "-p",
                 f"{name}:={value}")
    assert done.returncode == 2 and name in done.stderr and said in done.stderr
    assert not (tmp_path / "V.csv").exists()


@pytest.mark.parametrize("arguments, said", [
    ((), "<INPUT>"), (("one.mcap", "--nonsense"), "--nonsense"), (("one.mcap", "two.mcap"), "two.mcap"),
    (("one.mcap", "--topic"), "--topic")])
def test_arguments_that_cannot_be_end_it_with_2(arguments, said):
    done = cfodi("replay", *arguments)
    assert done.returncode == 2 and said in done.stderr


def test_an_output_that_cannot_be_written_is_said_by_name(recording, tmp_path):
    done = cfodi("replay", recording("cabinet").folder(), "--voxels", tmp_path / "no" / "such" / "V.csv")
    assert done.returncode in (1, 2) and "V.csv" in done.stderr and "panicked" not in done.stderr


@pytest.mark.parametrize("way", ["itself", "link"])
def test_an_output_never_replaces_the_input(way, recordings, tmp_path):
    bag, out = tmp_path / "bag.mcap", tmp_path / "bag.mcap"
    shutil.copy(recordings / "cabinet_depth640_58.mcap", bag)
    if way == "link":
        out = tmp_path / "link.mcap"
        out.symlink_to(bag)
    done = cfodi("replay", bag, "--out", out)
    assert bag.read_bytes() == (recordings / "cabinet_depth640_58.mcap").read_bytes(), "the recording is lost"
    assert done.returncode == 2 and out.name in done.stderr or way == "link" and not out.is_symlink()


def test_a_remap_is_not_ignored_in_silence(recordings):
    """As in the live node it chooses the sensor's topic, or it is refused."""
    done = cfodi("replay", recordings / "cabinet_cloud320_58.mcap", "--ros-args", "-r", "points:=/camera/nope")
    assert done.returncode == 2 and ("/camera/nope" in done.stderr or "--topic" in done.stderr)


def test_a_name_that_cannot_be_a_topic_ends_it_with_2(recordings, tmp_path):
    done = cfodi("replay", recordings / "cabinet_cloud320_58.mcap", "--out", tmp_path / "r.mcap", "--ros-args", "-r",
                 "~/clusters:=9bad")
    assert done.returncode == 2 and "9bad" in done.stderr


def test_a_bag_without_a_usable_scan_leaves_a_result_of_no_other_time(recordings, tmp_path):
    bag = recordings / "cabinet_cloud320_58.mcap"
    done = cfodi("replay", bag, "--out", tmp_path / "r.mcap", "--ros-args", "-p", "fixed_frame:=nowhere")
    assert done.returncode == 0 and "tf_" in done.stderr
    with open(tmp_path / "r.mcap", "rb") as result:
        times = [message.log_time for _, _, message in make_reader(result).iter_messages()]
    assert times and min(times) > bags.SECOND * 1_000_000_000, "some of it is said to be of 1970"


def test_an_experiment_that_takes_in_no_scan_leaves_the_files_of_an_earlier_one(recordings, tmp_path):
    figures = tmp_path / "figures"
    figures.mkdir()
    for name in ("figure2_b.png", "scans.csv", "index.html"):
        (figures / name).write_text("of an earlier one")
    done = cfodi("experiment", recordings / "cabinet_cloud320_58.mcap", "--no-effects", "--out", figures,
                 "--ros-args", "-p", "fixed_frame:=mpa")
    assert done.returncode == 1 and "no scan was taken in" in done.stderr and "tf_unknown_frame 58" in done.stderr
    assert {path.name: path.read_text() for path in figures.iterdir()} == {
        name: "of an earlier one" for name in ("figure2_b.png", "scans.csv", "index.html")}


def test_an_experiment_writes_nothing_into_the_folder_of_its_bag(recording):
    folder = recording("cabinet").folder()
    before = sorted(path.name for path in folder.iterdir())
    for bag in (folder, next(folder.glob("*.mcap"))):
        done = cfodi("experiment", bag, "--no-effects", "--out", folder)
        assert done.returncode == 2 and "is the folder of the bag" in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == before


def test_the_truth_that_cannot_be_written_is_said_before_the_drive(tmp_path):
    done = cfodi("simulate", "--out", tmp_path / "s.mcap", "--truth", tmp_path / "no" / "T.json")
    assert done.returncode == 1 and "T.json" in done.stderr and not list(tmp_path.iterdir())
