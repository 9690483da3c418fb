"""Hypothesis strategies and small maps that tests share."""

import math

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from segmap.pose import Pose2
from segmap.segments import Order, SegmentMap

coordinate = st.floats(-20.0, 20.0, allow_nan=False).map(lambda x: round(x, 3))
heading = st.one_of(
    st.floats(-math.pi, math.pi),
    st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi, math.pi / 4, 1e-9, math.pi - 1e-9]),
)
poses = st.builds(Pose2, coordinate, coordinate, heading)


@st.composite
def segments(draw):
    """One segment, often on the axes, often touching round coordinates, never without length."""
    x, y, length = draw(coordinate), draw(coordinate), draw(st.floats(0.05, 6.0))
    angle = draw(heading)
    return x, y, x + length * math.cos(angle), y + length * math.sin(angle)


@st.composite
def maps(draw, most=8, orders=tuple(Order)):
    """A map of up to ``most`` segments, some undirected, in any order."""
    rows = draw(st.lists(segments(), min_size=0, max_size=most))
    directed = draw(npst.arrays(bool, len(rows)))
    order = draw(st.sampled_from(orders))
    return SegmentMap(np.array(rows).reshape(-1, 4), order, directed if order is Order.NONE else None)


def room(width=4.0, depth=3.0):
    """The four walls of a room with the sensor inside, in beam order, free space on the left."""
    w, d = width / 2, depth / 2
    return SegmentMap(np.array([[-w, -d, w, -d], [w, -d, w, d], [w, d, -w, d], [-w, d, -w, -d]]), Order.BEAMS)
