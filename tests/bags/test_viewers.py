"""The set-ups for RViz and Foxglove in launch_scripts: what they ask for is what the node offers."""

import json

import bags
import pytest
from replay import Replay, cfodi
from result import TOPICS, ResultBag
from ruamel.yaml import YAML

FOLDER = bags.REPOSITORY / "launch_scripts"
INPUT = "/points"  # of a driver, most of which send best effort
NAMESPACES = {"clusters", "names", "normals", "outlines", "surfaces", "unclustered"}


@pytest.fixture(scope="module")
def rviz():
    return YAML(typ="safe").load((FOLDER / "cfodi.rviz").read_text())["Visualization Manager"]


@pytest.fixture(scope="module")
def foxglove():
    return json.loads((FOLDER / "foxglove.json").read_text())


@pytest.fixture(scope="module")
def result(space):
    """A result bag, which says of each topic what the node offers it with."""
    bag = space / "second.mcap"
    done = cfodi("simulate", "--out", bag, "--scene", "room", "--seconds", 1)
    assert done.returncode == 0, done.stderr
    return ResultBag(Replay(bag, space / "second", outputs=("out",)).path("out"))


@pytest.fixture(scope="module")
def offered(result):
    profiles = {t: YAML(typ="safe").load(result.channels[t].metadata["offered_qos_profiles"])[0]
                for t in TOPICS if t in result.channels}
    return {t: (p["reliability"], p["durability"]) for t, p in profiles.items()} | {INPUT: ("best_effort", "volatile")}


def asked(display):
    topic = display["Topic"]
    words = (topic[f"{name} Policy"].lower().replace(" ", "_") for name in ("Reliability", "Durability"))
    return topic["Value"], tuple(words)


def with_topic(rviz):
    return {display["Topic"]["Value"]: display for display in rviz["Displays"] if "Topic" in display}


def test_rviz_has_the_displays_for_the_nodes_topics(rviz):
    assert rviz["Global Options"]["Fixed Frame"] == "odom"
    found = {topic: (display["Class"].split("/")[1], display["Enabled"]) for topic, display in with_topic(rviz).items()}
    assert found == {"/cfodi/markers": ("MarkerArray", True), "/cfodi/points_labelled": ("PointCloud2", True),
                     INPUT: ("PointCloud2", False)}
    others = {display["Class"] for display in rviz["Displays"] if "Topic" not in display}
    assert others == {"rviz_default_plugins/Grid", "rviz_default_plugins/TF"}
    for display in rviz["Displays"]:
        # RViz reads the one and writes both.
        assert display["Enabled"] == display["Value"], display["Name"]
        assert display["Class"].startswith("rviz_default_plugins/")


def test_rviz_asks_for_no_more_than_is_offered(rviz, offered):
    for topic, display in with_topic(rviz).items():
        name, (reliability, durability) = asked(display)
        assert reliability in ("best_effort", offered[name][0]), f"{name} would stay empty: {offered[name]}"
        assert durability in ("volatile", offered[name][1]), f"{name} would stay empty: {offered[name]}"
        assert display["Topic"]["History Policy"] == "Keep Last" and display["Topic"]["Depth"] == 1, topic
    assert asked(with_topic(rviz)["/cfodi/markers"])[1] == ("reliable", "transient_local")


def test_the_points_are_coloured_by_a_field_that_they_have(rviz, foxglove, result):
    points = result.on("/cfodi/points_labelled")[-1].value
    display = with_topic(rviz)["/cfodi/points_labelled"]
    assert display["Color Transformer"] == "Intensity"
    field = foxglove["configById"]["3D!surfaces"]["topics"]["/cfodi/points_labelled"]["colorField"]
    assert {display["Channel Name"], field} == {"label"} <= {field.name for field in points.fields}


def test_the_namespaces_are_those_of_the_markers(rviz, foxglove, result):
    listed = with_topic(rviz)["/cfodi/markers"]["Namespaces"]
    topics = foxglove["configById"]["3D!surfaces"]["topics"]
    assert set(listed) == set(topics["/cfodi/markers"]["namespaces"]) == NAMESPACES
    assert all(listed.values())
    sent = {m.ns for message in result.on("/cfodi/markers") for m in message.value.markers if m.action == 0}
    # `clusters` are those of mode `paper`.
    assert sent == NAMESPACES - {"clusters"}


def panels(layout):
    return [layout] if isinstance(layout, str) else panels(layout["first"]) + panels(layout["second"])


def test_foxglove_has_the_panels_for_the_nodes_topics(foxglove):
    configured = foxglove["configById"]
    assert sorted(panels(foxglove["layout"])) == sorted(configured)
    kinds = {name.split("!")[0]: panel for name, panel in configured.items()}
    assert set(kinds) == {"3D", "DiagnosticSummary", "RawMessages"}
    assert kinds["3D"]["followTf"] == "odom"
    used = {*kinds["3D"]["topics"], kinds["DiagnosticSummary"]["topicToRender"], kinds["RawMessages"]["topicPath"]}
    assert used == {"/cfodi/markers", "/cfodi/points_labelled", INPUT, "/diagnostics", "/cfodi/clusters"}
    assert used <= {*TOPICS, INPUT}
