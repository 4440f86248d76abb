"""The files that `cfodi replay` writes, read as their readers would."""

import json
import math
import os
import subprocess

import numpy as np
import pytest
from replay import BINARY, Replay
from scipy.spatial import cKDTree

SUMMARY = {"scans", "scans_skipped", "points", "points_valid", "voxels", "dense_voxels", "clusters", "clusters_active",
           "engine_ms", "ingest_ns_per_point", "wall_s", "peak_rss_mb", "parameters"}
CLUSTER = ["id", "revision", "state", "surface_class", "class_confidence", "merged_from", "first_seen", "last_seen",
           "plane", "pose", "size", "centroid", "point_covariance", "plane_covariance", "rms_error", "area",
           "voxel_count", "point_count", "boundary", "holes"]
VOXEL_SIZE = 0.08


@pytest.fixture(params=["cabinet", "desk"])
def run(request, recording):
    return recording(request.param).replay()


def test_the_voxels_are_sorted_and_their_centres_lie_inside(run):
    text = run.bytes("voxels").decode("ascii")
    assert text.endswith("\n") and "\r" not in text
    voxels = run.voxels()
    assert len(voxels) == text.count("\n") - 1, "a key twice"
    assert len(voxels) == run.summary()["dense_voxels"] > 5_000
    assert list(voxels) == sorted(voxels)
    for key, voxel in voxels.items():
        assert voxel.count >= 15
        for index, centre in zip(key, voxel.centre):
            assert index * VOXEL_SIZE - 1e-9 <= centre <= (index + 1) * VOXEL_SIZE + 1e-9
        assert voxel.normal == (0.0, 0.0, 0.0) or math.isclose(math.hypot(*voxel.normal), 1.0, abs_tol=1e-6)
    assert sum(voxel.normal != (0.0, 0.0, 0.0) for voxel in voxels.values()) > len(voxels) / 2


def test_the_summary_has_every_key_and_its_numbers_fit(run):
    summary, voxels = run.summary(), run.voxels()
    assert SUMMARY <= set(summary), SUMMARY - set(summary)
    assert isinstance(summary["scans_skipped"], dict) and sum(summary["scans_skipped"].values()) == 0
    assert 0 < summary["points_valid"] < summary["points"]
    assert sum(voxel.count for voxel in voxels.values()) <= summary["points_valid"]
    assert summary["dense_voxels"] <= summary["voxels"]
    assert summary["clusters_active"] <= summary["clusters"] == len(run.clusters())
    times = [summary["engine_ms"][name] for name in ("p50", "p90", "p99", "max")]
    assert times == sorted(times) and times[0] > 0
    assert all(summary[name] > 0 for name in ("ingest_ns_per_point", "wall_s", "peak_rss_mb"))
    assert summary["parameters"]["voxel_size"] == VOXEL_SIZE and summary["parameters"]["mode"] == "paper"
    assert summary["parameters"]["min_points"] == 15


def test_the_summary_names_the_frame_that_was_taken(run):
    """No `odom` in these bags, and none was asked for: the root of the sensor's tree, said on stderr."""
    assert "map" in run.stderr and "odom" in run.stderr
    assert run.summary()["parameters"]["fixed_frame"] == "map"


def test_the_clusters_have_the_fields_of_the_message(run):
    clusters = run.clusters()
    assert len(clusters) > 10
    for cluster in clusters:
        assert sorted(cluster) == sorted(CLUSTER)
        assert isinstance(cluster["id"], str) and int(cluster["id"]) > 0, "u64 is a string in JSON"
        assert isinstance(cluster["point_count"], str) and int(cluster["point_count"]) >= 15 * cluster["voxel_count"]
        assert all(isinstance(i, str) for i in cluster["merged_from"])
        assert isinstance(cluster["revision"], int) and cluster["state"] in (0, 1, 2)
        coefficients = cluster["plane"]["coef"]
        assert len(coefficients) == 4 and math.isclose(math.hypot(*coefficients[:3]), 1.0, abs_tol=1e-6)
        assert len(cluster["point_covariance"]) == len(cluster["plane_covariance"]) == 9
    assert len({cluster["id"] for cluster in clusters}) == len(clusters)


def test_voxels_clusters_and_points_speak_of_one_map(run):
    voxels, vertices = run.voxels(), run.ply()
    counts, points = {}, {}
    for voxel in voxels.values():
        counts[voxel.cluster] = counts.get(voxel.cluster, 0) + 1
        points[voxel.cluster] = points.get(voxel.cluster, 0) + voxel.count
    assert {int(c["id"]): c["voxel_count"] for c in run.clusters()} == {i: n for i, n in counts.items() if i}
    assert {int(c["id"]): int(c["point_count"]) for c in run.clusters()} == {i: n for i, n in points.items() if i}
    assert {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "label"} <= set(vertices.dtype.names)
    assert len(vertices) == len(voxels)
    drawn = np.stack([vertices[n] for n in ("x", "y", "z", "nx", "ny", "nz", "label")], 1)
    listed = np.array([(*v.centre, *v.normal, v.cluster) for v in voxels.values()])
    _, place = cKDTree(listed[:, :3]).query(drawn[:, :3])
    assert len(set(place.tolist())) == len(listed), "a voxel drawn twice"
    assert np.abs(drawn - listed[place]).max() < 1e-5
    colours = {label: set(vertices[["red", "green", "blue"]][vertices["label"] == label].tolist())
               for label in np.unique(vertices["label"]).tolist()}
    assert all(len(of_label) == 1 for of_label in colours.values()), "a cluster of two colours"


def test_outputs_can_be_left_out_one_by_one(recording, tmp_path):
    bag = recording("cabinet").folder()
    run = Replay(bag, tmp_path / "none", outputs=())
    assert list((tmp_path / "none").iterdir()) == []
    assert "\r" not in run.stderr and "\x1b" not in run.stderr, "a progress bar in a pipe"
    Replay(bag, tmp_path / "one", outputs=("clusters",))
    assert [path.name for path in (tmp_path / "one").iterdir()] == ["C.json"]


def test_parameters_reach_the_engine(recording, tmp_path):
    run = Replay(recording("cabinet").folder(), tmp_path, outputs=("summary", "voxels"),
                 parameters={"mode": "paper", "voxel_size": 0.16, "min_points": 100, "max_range": 2.0})
    assert json.dumps(run.summary()["parameters"]["voxel_size"]) == "0.16"
    assert all(voxel.count >= 100 for voxel in run.voxels().values())
    coarse = {tuple(i // 2 for i in key) for key in recording("cabinet").replay().voxels()}
    inside = sum(key in coarse for key in run.voxels())
    assert 0 < len(run.voxels()) < len(coarse) and inside >= 0.9 * len(run.voxels())


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
@pytest.mark.parametrize("verb", ["replay", "simulate", "experiment"])
def test_a_reader_who_has_gone_takes_no_result_with_it(verb, stream, recording, tmp_path):
    """`cfodi ... | head -1`: all that is said is said to nobody, and the files are there."""
    bag = recording("cabinet").folder()
    commands = {"replay": (["replay", bag, "--out", "r.mcap", "--summary", "s.json"], ["r.mcap", "s.json"]),
                "simulate": (["simulate", "--seconds", "0.2", "--out", "s.mcap", "--truth", "t.json"], ["s.mcap", "t.json"]),
                "experiment": (["experiment", "--scene", "room", "--seconds", "0.2", "--seeds", "1", "--out", "e"],
                               ["e/quality.md", "e/quality.csv"])}
    command, files = commands[verb]
    reader, writer = os.pipe()
    os.close(reader)
    other = {"stdout": "stderr", "stderr": "stdout"}[stream]
    done = subprocess.run([str(BINARY), *map(str, command)], cwd=tmp_path, stdin=subprocess.DEVNULL, timeout=120,
                          **{stream: writer, other: subprocess.PIPE})
    os.close(writer)
    assert done.returncode == 0, done
    assert all((tmp_path / file).stat().st_size > 100 for file in files)
