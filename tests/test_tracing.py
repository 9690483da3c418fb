"""A run that is recorded is the same run, and tells every step it took."""

import numpy as np
import pytest
from graphs import ring, with_wrong
from worlds import room

from app.resources import samples_folder
from segmap import tracing
from segmap.graph import optimise
from segmap.integration import MODES, heuristics, integrate
from segmap.logs import read_log
from segmap.merging import METHODS, merge
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import extract

T = Pose2(0.4, -0.2, 0.3)


@pytest.fixture(scope="module")
def hall():
    """A few neighbouring scans of the hall."""
    log = read_log(samples_folder() / "hall.log")
    return {ScanId(0, i): extract(log[i], Parameters(), index=i) for i in range(5)}


def facts(integration):
    """Everything an integration says, but for the time it took, to the last bit."""
    match, fusion = integration.match, integration.fusion
    lines = () if fusion is None else tuple(line.vertices.tobytes() for line in fusion.polylines)
    whole = None if fusion is None else (fusion.map.coordinates.tobytes(), fusion.map.sources)
    told = {name: value for name, value in vars(match).items() if name != "milliseconds"}
    return told, lines, whole


@pytest.mark.parametrize(("mode", "heuristic"), [(mode, name) for mode in MODES for name in heuristics(mode)])
@pytest.mark.parametrize("variant", ["greedy", "plain"])
def test_recording_changes_nothing(hall, mode, heuristic, variant):
    """Recorded or not, INTEGRATE gives the same to the last bit, by every heuristic in every mode."""
    parameters = preset("verified" if mode == "verified" else "default").with_text({"fusion_variant": variant})
    one, other = list(hall.values())[:2]
    plain = integrate(one, other, parameters, heuristic, mode)
    with tracing.recording() as trace:
        recorded = integrate(one, other, parameters, heuristic, mode)
    assert facts(recorded) == facts(plain)
    tried = sum(len(event["new"]) for event in trace.all("candidates"))
    assert tried == plain.match.candidates
    assert plain.fusion is None or trace.last("fused")["map"] is recorded.fusion.map


@pytest.mark.parametrize("method", METHODS)
def test_recording_a_merge_changes_nothing(hall, method):
    """Nor does recording change what a merge makes, whose every integration is told."""
    plain = merge(hall, method=method, heuristic="consecutive")
    with tracing.recording() as trace:
        recorded = merge(hall, method=method, heuristic="consecutive")
    assert [part.map.coordinates.tobytes() for part in recorded.components] == [
        part.map.coordinates.tobytes() for part in plain.components
    ]
    nodes = [event["node"] for event in trace.all("joined")]
    held = {id(node) for part in recorded.components for node in part.tree.nodes() if node.step is not None}
    assert held <= {id(node) for node in nodes}


def test_the_optimiser_tells_each_round():
    """The graph's rounds come in the order of its history, with the weights that edges had."""
    edges = with_wrong(ring(12)[1], 0.2, "random")
    plain = optimise(edges)
    with tracing.recording() as trace:
        recorded = optimise(edges)
    assert recorded.poses == plain.poses
    rounds = trace.all("optimised")
    assert [event["poses"].tolist() for event in rounds] == [one.poses.tolist() for one in recorded.history]
    assert [int((event["weights"] < 0.5).sum()) for event in rounds] == [one.silenced for one in recorded.history]


def test_nobody_listens_after_the_block():
    """What is told before and after a recording is not in it, and a recording within another keeps its own."""
    tracing.tell("before")
    with tracing.recording() as outer:
        tracing.tell("outer")
        with tracing.recording() as inner:
            tracing.tell("inner")
        tracing.tell("outer")
    tracing.tell("after")
    assert [event.what for event in outer.events] == ["outer", "outer"]
    assert [event.what for event in inner.events] == ["inner"]


def test_an_array_is_told_as_it_is_then():
    """What is written into an array later does not change what was told."""
    changing = np.zeros(2)
    with tracing.recording() as trace:
        tracing.tell("zero", array=changing)
        changing[0] = 1.0
        tracing.tell("one", array=changing)
    assert [event["array"].tolist() for event in trace.events] == [[0.0, 0.0], [1.0, 0.0]]


def test_a_polyline_is_told_from_its_first_edge_on(hall):
    """P_0 is one edge; the last P_n is what the fusion holds."""
    one, other = list(hall.values())[:2]
    with tracing.recording() as trace:
        integration = integrate(one, other)
    polylines = [event["vertices"] for event in trace.all("polyline")]
    starts = [vertices for vertices in polylines if len(vertices) == 2]
    assert len(starts) >= len(integration.fusion.polylines)
    ends = {vertices.tobytes() for vertices in polylines}
    assert all(line.vertices.tobytes() in ends for line in integration.fusion.polylines)


def test_a_room_with_itself_is_told_whole():
    """Each stage of a small integration is there."""
    with tracing.recording() as trace:
        integrate(room(), room().moved(T))
    wanted = {"heuristic", "chosen", "angles", "equal", "candidates", "search", "chains", "chain", "polyline", "fused"}
    assert wanted <= {event.what for event in trace.events}
