"""Real recordings in every form that `rosbags-convert` gives them: the same bytes out, the voxels that numpy counts."""

import bags
import pytest
import recount
from left_out import leave_out
from replay import Replay, same_map

NAMES = ("cabinet", "desk")


@pytest.fixture(scope="session")
def _counts():
    return {}


@pytest.fixture
def counted(recording, _counts):
    """`counted(name)`: what numpy finds in a recording."""
    def of(name):
        if name not in _counts:
            _counts[name] = recount.Voxels(recording(name).folder(), bags.POINTS)
        return _counts[name]
    return of


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
def test_the_voxels_are_those_that_numpy_counts(name, recording, counted):
    one = recording(name)
    own, summary = counted(name), one.replay().summary()
    recount.assert_same_voxels(one.replay().voxels(), own)
    assert (own.scans, own.skipped) == (one.scans, 0), "the recording is not what this test takes it for"
    assert (summary["scans"], summary["points"], summary["points_valid"]) == (one.scans, own.points, own.valid)
    assert summary["voxels"] == pytest.approx(len(own.count), rel=1e-3)


def test_the_cabinet_at_full_size_gives_the_accepted_counts(request, recording):
    if not bags.FULL:
        leave_out(request, "at full size only (CFODI_FULL_BAGS=1)")
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


def test_a_depth_image_gives_the_voxels_of_its_cloud(recording, made, counted, tmp_path):
    """The 16UC1 image is the cloud rounded to millimetres: what the rounding alone does to the voxels, numpy says."""
    one = recording("cabinet")
    options = () if bags.FULL else ("--decimate", "2")
    images = made.folder("images", "tum_fr3_cabinet58", *options, "--no-points", compression="storage")
    run = Replay(images, tmp_path, parameters={"mode": "paper"})
    cloud, image = set(one.replay().voxels()), set(run.voxels())
    exact, rounded = counted("cabinet"), recount.Voxels(one.folder(), bags.POINTS, millimetres=True)
    share = len(cloud ^ image) / len(cloud | image)
    alone = len(set(exact.dense()) ^ set(rounded.dense())) / len(exact.dense())
    print(f"dense voxels of the cloud: {len(cloud)}, of the image: {len(image)}, of one alone: {len(cloud ^ image)} ({share:.3%}); "
          f"of numpy's rounded or exact points: {alone:.3%}")
    assert run.summary()["scans"] == one.scans
    recount.assert_same_voxels(run.voxels(), rounded, allowed=1e-4)  # numpy rounds what was a float already
    assert share <= 0.001


def test_in_mode_consistent_a_depth_image_gives_the_map_of_its_cloud(recording, made, tmp_path):
    options = () if bags.FULL else ("--decimate", "2")
    images = made.folder("images", "tum_fr3_cabinet58", *options, "--no-points", compression="storage")
    of_cloud, of_image = Replay(recording("cabinet").folder(), tmp_path / "cloud"), Replay(images, tmp_path / "image")
    cloud, image = set(of_cloud.voxels()), set(of_image.voxels())
    clusters = [len(run.clusters()) for run in (of_cloud, of_image)]
    print(f"dense voxels of the cloud: {len(cloud)}, of the image: {len(image)}, of one alone: {len(cloud ^ image)}; "
          f"clusters: {clusters[0]} and {clusters[1]}")
    assert len(cloud ^ image) <= 0.001 * len(cloud | image)
    assert abs(clusters[0] - clusters[1]) <= 2


@pytest.mark.parametrize("pose_sigma, is_said", [(0.0, True), (0.02, False)])
def test_that_points_are_off_their_surfaces_is_said_until_pose_sigma_explains_it(pose_sigma, is_said, recordings, tmp_path):
    """Poses of motion capture, and a real sensor's bias: some 16 mm."""
    run = Replay(recordings / "cabinet_depth640_58.mcap", tmp_path, outputs=("summary",), parameters={"pose_sigma": pose_sigma})
    summary = run.summary()
    assert 0.01 < summary["beyond_noise_m"] < 0.025
    of_it = [line for line in summary["remarks"] if "mm off their surfaces beyond the sensor's noise" in line]
    assert len(of_it) == is_said and all("pose_sigma:=0.02 tells by how much" in line for line in of_it), summary["remarks"]
    assert all(line in run.stderr for line in of_it)
