"""Real recordings, in every form that `rosbags-convert` gives them: the same bytes out, and the voxels that numpy counts."""

import bags
import pytest
import recount
from replay import Replay, same_map

NAMES = ("cabinet", "desk")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("compression", [c for c in bags.COMPRESSIONS if c != "plain"])
def test_every_compression_of_a_bag_gives_the_same_map(name, compression, recording, tmp_path):
    one = recording(name)
    other = Replay(one.folder(compression), tmp_path, parameters={"mode": "paper"})
    assert other.summary()["scans"] == one.scans
    same_map(one.replay(), other)
    assert one.replay().bytes("out") == other.bytes("out")


@pytest.mark.parametrize("name", NAMES)
def test_a_second_run_gives_the_same_bytes(name, recording, tmp_path):
    one = recording(name)
    again = Replay(one.folder(), tmp_path, parameters={"mode": "paper"})
    same_map(one.replay(), again)
    assert one.replay().bytes("out") == again.bytes("out")


@pytest.mark.parametrize("compression", bags.COMPRESSIONS)
def test_the_file_inside_the_folder_is_an_input_too(compression, recording, tmp_path):
    one = recording("cabinet")
    bare = Replay(bags.only_file(one.folder(compression)), tmp_path, outputs=("voxels", "clusters", "ply"),
                  parameters={"mode": "paper"})
    same_map(one.replay(), bare)


@pytest.mark.parametrize("name", NAMES)
def test_the_voxels_are_those_that_numpy_counts(name, recording):
    one = recording(name)
    counted = recount.Voxels(one.folder(), bags.POINTS)
    recount.assert_same_voxels(one.replay().voxels(), counted)
    summary = one.replay().summary()
    assert (counted.scans, counted.skipped) == (one.scans, 0), "the recording is not what this test takes it for"
    assert summary["scans"] == one.scans
    assert summary["points"] == counted.points
    assert summary["voxels"] == pytest.approx(len(counted.count), rel=1e-3)
    assert summary["points_valid"] in (counted.finite, counted.valid)


@pytest.mark.skipif(not bags.FULL, reason="at full size only (CFODI_FULL_BAGS=1)")
def test_the_cabinet_at_full_size_gives_the_accepted_counts(recording):
    run = recording("cabinet").replay()
    assert run.summary()["dense_voxels"] == len(run.voxels()) == 14_342
    assert run.summary()["clusters"] == len(run.clusters()) == 292


@pytest.mark.parametrize("file, topic", [
    ("cabinet_cloud320_58.mcap", bags.POINTS), ("cabinet_depth640_58.mcap", bags.IMAGE)])
def test_the_ready_recordings_replay(file, topic, recordings, tmp_path):
    run = Replay(recordings / file, tmp_path, outputs=("summary", "voxels"))
    by_name = Replay(recordings / file, tmp_path / "named", topics=[topic], outputs=("summary", "voxels"))
    assert run.summary()["scans"] == 58
    assert run.bytes("voxels") == by_name.bytes("voxels")
    assert len(run.voxels()) == run.summary()["dense_voxels"] > 5_000


def test_the_ready_clouds_hold_the_voxels_that_numpy_counts(recordings, tmp_path):
    file = recordings / "cabinet_cloud320_58.mcap"
    run = Replay(file, tmp_path, outputs=("voxels",))
    recount.assert_same_voxels(run.voxels(), recount.Voxels(file, bags.POINTS))


def test_a_depth_image_gives_the_voxels_of_its_cloud(made, tmp_path):
    """The 16UC1 image is the cloud rounded to millimetres: what the rounding alone does to the voxels, numpy says."""
    options = () if bags.FULL else ("--decimate", "2")
    both = made.folder("both", "tum_fr3_cabinet58", *options, compression="storage")
    cloud = Replay(both, tmp_path / "cloud", topics=[bags.POINTS], outputs=("voxels", "summary")).voxels()
    image = Replay(both, tmp_path / "image", topics=[bags.IMAGE], outputs=("voxels", "summary")).voxels()
    rounded = recount.Voxels(both, bags.POINTS, millimetres=True)
    exact = recount.Voxels(both, bags.POINTS)
    share = len(set(cloud) ^ set(image)) / len(set(cloud) | set(image))
    alone = len(set(exact.dense()) ^ set(rounded.dense())) / len(set(exact.dense()) | set(rounded.dense()))
    print(f"dense voxels of the image or the cloud alone: {share:.3%}; of numpy's rounded or exact points: {alone:.3%}")
    recount.assert_same_voxels(image, rounded)
    recount.assert_same_voxels(cloud, exact)
    assert share <= 0.001
