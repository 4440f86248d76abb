"""The markers of a result bag, as a viewer keeps and draws them."""

import types

import numpy as np
import pytest
from draw_markers import BACKGROUND, Viewer, draw, points_of, rgb
from replay import Replay, cfodi
from result import ResultBag

SECONDS = 3
HERE = types.SimpleNamespace(position=types.SimpleNamespace(x=0, y=0, z=0), orientation=types.SimpleNamespace(w=1))


@pytest.fixture(scope="session")
def drive(space):
    """A few seconds of the simulated room."""
    bag = space / "drive.mcap"
    done = cfodi("simulate", "--out", bag, "--scene", "room", "--seconds", SECONDS)
    assert done.returncode == 0, done.stderr
    return bag


@pytest.fixture(scope="session", params=["consistent", "paper"])
def seen(request, drive, space):
    """`.messages` of ~/markers, `.map` the last snapshot, `.viewer` what one shows who saw all messages."""
    run = Replay(drive, space / f"drive-{request.param}", outputs=("out",), parameters={"mode": request.param})
    bag = ResultBag(run.path("out"))
    messages = [message.value for message in bag.on("/cfodi/markers")]
    viewer = Viewer()
    for message in messages:
        viewer.take(message)
    return types.SimpleNamespace(mode=request.param, messages=messages, map=bag.on("/cfodi/clusters")[-1].value,
                                 viewer=viewer)


def test_who_joins_late_sees_what_all_see(seen):
    assert len(seen.messages) > 5
    late = Viewer()
    late.take(seen.messages[-1])
    assert late.markers.keys() == seen.viewer.markers.keys() and len(late.markers) > 5


def test_every_cluster_is_shown_under_its_id(seen):
    ns = {"consistent": "surfaces", "paper": "clusters"}[seen.mode]
    shown = {int(marker.text): marker for marker in seen.viewer.of(ns).values()}
    clusters = {cluster.id: cluster for cluster in seen.map.clusters}
    assert shown.keys() == clusters.keys()
    if seen.mode == "paper":
        assert {i: len(marker.points) for i, marker in shown.items()} == {
            i: cluster.voxel_count for i, cluster in clusters.items()}
    reliable = {str(i) for i, cluster in clusters.items() if cluster.state != 0}
    assert {marker.text.split()[0] for marker in seen.viewer.of("names").values()} == reliable


def test_voxels_in_no_cluster_are_shown_too(seen):
    cubes = seen.viewer.of("unclustered").values()
    assert sum(len(marker.points) for marker in cubes) == seen.map.unclustered_voxels
    assert len(cubes) == min(1, seen.map.unclustered_voxels)


def test_colours_tell_clusters_apart(seen):
    colours = [tuple(rgb(m)) for (ns, _), m in seen.viewer.markers.items() if ns in ("surfaces", "clusters")]
    assert len(set(colours)) == len(colours)


def before(surface):
    """Where to stand to see an upright surface from the front: from elsewhere it may be a line."""
    if surface.ns != "surfaces":
        return {}
    one, two, three = points_of(surface).reshape(-1, 3, 3).transpose(1, 0, 2)
    x, y, z = np.cross(two - one, three - one).sum(0)
    return {"yaw": np.degrees(np.arctan2(y, x))} if np.hypot(x, y) > abs(z) else {}


def test_what_is_drawn_has_the_colour_of_every_cluster(seen):
    picture = np.asarray(draw(seen.viewer, (300, 200))).reshape(-1, 3)
    assert (np.abs(picture.astype(int) - BACKGROUND).max(1) > 10).mean() > 0.2, "hardly anything is drawn"
    for identity, marker in seen.viewer.markers.items():
        if identity[0] not in ("surfaces", "clusters") or np.ptp(points_of(marker), 0).max() < 0.2:
            continue
        alone = Viewer()
        alone.markers = {identity: marker}
        drawn = np.asarray(draw(alone, (90, 60), **before(marker))).reshape(-1, 3).astype(float)
        # Lit by half at least, and mixed with the background.
        a = marker.color.a
        darkest, lightest = ((1 - a) * np.array(BACKGROUND) + a * light * rgb(marker) for light in (0.5, 1.0))
        near = ((drawn > darkest - 3) & (drawn < lightest + 3)).all(1)
        own = near & (np.abs(drawn - BACKGROUND).max(1) > 3)
        assert own.sum() > 5, f"{identity}: {rgb(marker)} is not in its picture"


def test_surfaces_lie_on_the_planes_of_their_clusters(seen):
    clusters = {cluster.id: cluster for cluster in seen.map.clusters}
    for marker in seen.viewer.of("surfaces").values():
        a, b, c, d = clusters[int(marker.text)].plane.coef
        corners = points_of(marker)
        assert np.abs(corners @ (a, b, c) + d).max() < 1e-6
        one, two, three = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
        assert (np.cross(two - one, three - one) @ (a, b, c) > 0).all(), "lit from behind"


def test_the_renderer_draws_what_is_in_front_and_lets_surfaces_show_through():
    def triangle(z, colour, alpha):
        corners = [types.SimpleNamespace(x=x, y=y, z=z) for x, y in ((-1, -1), (1, -1), (0, 1))]
        colour = types.SimpleNamespace(**dict(zip("rgb", colour)), a=alpha)
        return types.SimpleNamespace(ns="surfaces", id=int(10 * z), type=11, action=0, points=corners, text="",
                                     pose=HERE, color=colour)

    def middle(*markers):
        viewer = Viewer()
        viewer.take(types.SimpleNamespace(markers=markers))
        return np.asarray(draw(viewer, (60, 60), pitch=90))[30, 30].astype(int)

    red, blue = triangle(0.0, (1, 0, 0), 1.0), triangle(0.1, (0, 0, 1), 1.0)
    assert np.abs(middle(red, blue) - (0, 0, 255)).max() < 3 and np.abs(middle(blue, red) - (0, 0, 255)).max() < 3
    through = middle(red, triangle(0.1, (0, 0, 1), 0.5))
    assert np.abs(through - (127, 0, 127)).max() < 4
