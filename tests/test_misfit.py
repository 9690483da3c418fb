"""How far scans lie from the merged map: laws, a twin by hand, and what has nothing beside it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from segmap.merging import Component, misfit, witnesses
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import Order, SegmentMap, Source

A, B = ScanId(0, 0), ScanId(0, 1)


def component(walls: list[list[float]], sources: list[tuple[Source, ...]], **poses: Pose2) -> Component:
    held = {A: poses.get("a", Pose2.identity()), B: poses.get("b", Pose2.identity())}
    return Component("one", (A, B), held, SegmentMap(np.array(walls), Order.NONE, sources=tuple(sources)))


def maps(a: list[list[float]], b: list[list[float]]) -> dict[ScanId, SegmentMap]:
    return {A: SegmentMap(np.array(a)), B: SegmentMap(np.array(b))}


@given(
    off=st.floats(-0.5, 0.5),
    x=st.floats(-20.0, 20.0),
    theta=st.floats(-math.pi, math.pi),
    share=st.floats(0.1, 1.0),
)
def test_a_parallel_wall_is_off_by_its_distance(off: float, x: float, theta: float, share: float) -> None:
    """A wall seen ``off`` metres beside the merged one has that misfit, however the map lies whatever part is seen."""
    T = Pose2(x, -x, theta)
    wall = SegmentMap(np.array([[0.0, 0.0, 4.0, 0.0]])).moved(T).coordinates.tolist()
    seen = {A: SegmentMap(np.array([[0.0, off, 4.0 * share, off]]))}
    held = component(wall, [(Source(0, 0, 0),)], a=T)
    assert misfit(held, {**seen, B: SegmentMap.empty()}) == pytest.approx([abs(off)], abs=1e-9)


def test_what_lies_beyond_the_wall_does_not_count() -> None:
    """Of a slanted segment only the part beside the wall counts, sampled densely by hand."""
    held = component([[0.0, 0.0, 2.0, 0.0]], [(Source(0, 0, 0), Source(0, 1, 0))])
    told = misfit(held, maps([[-2.0, -0.2, 4.0, 0.4]], [[0.0, 0.1, 2.0, 0.1]]))
    ends = np.array([0.0, 0.2, 0.1, 0.1])  # the first at x 0 and 2, the second at both of its ends
    assert told == pytest.approx([math.sqrt(np.mean(ends**2))])


def test_nothing_beside_it() -> None:
    """A connector, a source that lies elsewhere and one that is not there have no misfit."""
    walls = [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, 1.0], [0.0, 2.0, 1.0, 2.0]]
    held = component(walls, [(), (Source(0, 0, 0),), (Source(0, 0, 9),)])
    assert np.isnan(misfit(held, maps([[5.0, 1.0, 6.0, 1.0]], [[0.0, 0.0, 1.0, 0.0]]))).all()


def test_witnesses_are_scans() -> None:
    """Two segments of one scan are one witness."""
    sources = [(), (Source(0, 0, 0), Source(0, 0, 1)), (Source(0, 0, 0), Source(0, 1, 0))]
    held = component([[0.0, 0.0, 1.0, 0.0]] * 3, sources)
    assert witnesses(held.map).tolist() == [0, 1, 2]
