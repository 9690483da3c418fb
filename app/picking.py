"""A place in the picture -> the segment nearest to it, and what that segment adds to the value."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import shapely

from app.content import Content, Pair, Tie
from app.drawables import CHAIN, Pick
from app.drawing import Picture
from app.graph_layers import TIES
from app.marks import seen_by
from app.palette import hexadecimal
from segmap.scans import ScanId

__all__ = ["corner", "explain", "nearest"]

TOLD = 12
"""integrations that are told of a merged wall"""


def nearest(picture: Picture, x: float, y: float, reach: float, sources: Collection[str] | None = None) -> Pick | None:
    """The segment drawn nearest to a place, at most ``reach`` away, metres; of equally near ones the one on top.

    ``sources``: only segments of these.
    """
    lines, picks, depths = [], [], []
    for drawable in picture.drawables:
        if drawable.source and (sources is None or drawable.source in sources):
            flat = drawable.points[:, :, :2].astype(np.float64)
            lines.append(picture.T_1_2 @ flat if drawable.frame == "second" else flat)
            picks += [Pick(drawable.source, int(segment)) for segment in drawable.segments]
            depths += [drawable.depth] * len(drawable)
    if not picks:
        return None
    tree = shapely.STRtree(shapely.linestrings(np.concatenate(lines)))
    near = tree.query_nearest(shapely.Point(x, y), max_distance=reach, all_matches=True)
    return picks[max(near, key=lambda index: depths[index])] if len(near) else None


def explain(content: Content) -> dict[str, Any] | None:
    """What the clicked segment is and does, for the panel and the page; None where nothing is clicked."""
    pick = content.picked
    if pick is not None and pick.source == CHAIN:
        return _chain(content, pick.segment)
    segment_map = None if pick is None else content.map_of(pick.source)
    if pick is None or segment_map is None or not 0 <= pick.segment < len(segment_map):
        return None
    told: dict[str, Any] = {
        "source": pick.source,
        "segment": pick.segment,
        "length": float(segment_map.lengths[pick.segment]),
        "heading": float(np.degrees(segment_map.headings[pick.segment])),
        "scans": [str(scan) for scan in seen_by(segment_map, pick.segment)],
    }
    if pick.source in ("first", "second"):
        return {**told, **_in_chain(content, pick)}
    return {**told, **_origin(content, seen_by(segment_map, pick.segment))}


def _origin(content: Content, scans: Sequence[ScanId]) -> dict[str, Any]:
    """The accepted integrations that put a merged wall where it is: those between the scans that saw it.

    Where no integration is between two of them, those that hold one of them.
    """
    seen = set(scans)
    held = [tie for tie in content.ties if tie.accepted]
    inside = [tie for tie in held if tie.first in seen and tie.second in seen]
    chosen = inside or [tie for tie in held if tie.first in seen or tie.second in seen]
    return {
        "between": bool(inside),
        "integrations": [_decision(tie) for tie in chosen[:TOLD]],
        "more": max(0, len(chosen) - TOLD),
        "misfit": _misfit(content),
    }


def _decision(tie: Tie) -> dict[str, Any]:
    told = ("who", "value", "confidence", "chi", "silenced")
    return {"id": tie.integration, **{name: getattr(tie, name) for name in told}}


def _misfit(content: Content) -> float | None:
    pick = content.picked
    off = None if pick is None else content.map.misfits.get(pick.source)
    return None if pick is None or off is None or np.isnan(off[pick.segment]) else float(off[pick.segment])


def corner(picture: Picture, x: float, y: float, reach: float) -> tuple[float, float] | None:
    """The end of a drawn segment nearest to a place, at most ``reach`` away, metres: what measuring snaps to."""
    ends = [
        picture.T_1_2 @ flat if drawable.frame == "second" else flat
        for drawable in picture.drawables
        if drawable.source and drawable.source != TIES
        for flat in (drawable.points[:, :, :2].astype(np.float64).reshape(-1, 2),)
    ]
    if not ends or not sum(map(len, ends)):
        return None
    together = np.concatenate(ends)
    away = np.hypot(*(together - (x, y)).T)
    at = int(away.argmin())
    return (float(together[at, 0]), float(together[at, 1])) if away[at] <= reach else None


def _chain(content: Content, place: int) -> dict[str, Any] | None:
    """A matching chain that was chosen from a list."""
    pair = content.pair
    if pair is None or not 0 <= place < len(pair.chains):
        return None
    return {"source": CHAIN, "segment": place, "chain": _summary(content, pair, place)}


def _summary(content: Content, pair: Pair, place: int) -> dict[str, Any]:
    chain = pair.chains[pair.by_value[place]]
    return {
        "number": place + 1,
        "value": chain.value,
        "segments": len(chain.first) + len(chain.second),
        "colour": hexadecimal(content.palette.chain(place)),
    }


def _in_chain(content: Content, pick: Pick) -> dict[str, Any]:
    """The segment's share in the value: the sum of its matching values, and its chain."""
    pair = content.pair
    assert pair is not None
    side = 0 if pick.source == "first" else 1
    told: dict[str, Any] = {"name": pair.names[side], "adds": 0.0, "matches": [], "chain": None}
    for place, k in enumerate(pair.by_value):
        mine = [pairing for pairing in pair.chains[k].pairs if pairing[side] == pick.segment]
        if mine:
            told["adds"] = sum(value for _, _, value in mine)
            told["matches"] = [{"segment": pairing[1 - side], "value": pairing[2]} for pairing in mine]
            told["chain"] = _summary(content, pair, place)
    return told
