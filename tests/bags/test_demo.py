"""`cfodi demo`, which needs nothing installed, and the bag that it leaves."""

import time

import bags
from replay import cfodi
from result import DELTA, SNAPSHOT, TOPICS, ResultBag


def test_a_demo_leaves_map_picture_and_a_bag_of_its_drive(tmp_path):
    begin = time.time_ns()
    done = cfodi("demo", "--seconds=3", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    heading, columns, *rows = done.stdout.splitlines()
    assert "dense voxels" in heading and "the largest:" in heading, done.stdout
    assert "normal" in columns and len([row for row in rows if row.split()[0].isdigit()]) >= 5, done.stdout
    assert all((tmp_path / name).stat().st_size > 1000 for name in ("map.ply", "map.png"))
    bag = ResultBag(tmp_path / "result.mcap")
    for topic in (*TOPICS, "/tf", "/tf_static"):
        assert bag.on(topic), f"nothing on {topic}"
    assert {message.value.kind for message in bag.on("/cfodi/clusters")} == {SNAPSHOT}
    assert {message.value.kind for message in bag.on("/cfodi/clusters_delta")} == {DELTA}
    assert bag.on("/cfodi/clusters")[-1].value.clusters
    # A player waits from one message to the next.
    assert bag.statistics.message_start_time >= begin - bags.SECOND, "what has no stamp begins it in 1970"
    assert bag.statistics.message_end_time <= time.time_ns()
