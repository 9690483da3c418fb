"""A place in the picture -> the segment nearest to it, and what that segment adds to the value."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from app.content import Content
from app.drawables import Pick
from app.drawing import Picture
from app.palette import hexadecimal

__all__ = ["explain", "nearest"]


def nearest(picture: Picture, x: float, y: float, reach: float) -> Pick | None:
    """The segment drawn nearest to a place, at most ``reach`` away, metres; of equally near ones the one on top."""
    lines, picks, depths = [], [], []
    for drawable in picture.drawables:
        if drawable.source:
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
    segment_map = None if pick is None else content.map_of(pick.source)
    if pick is None or segment_map is None or not 0 <= pick.segment < len(segment_map):
        return None
    told: dict[str, Any] = {
        "source": pick.source,
        "segment": pick.segment,
        "length": float(segment_map.lengths[pick.segment]),
        "heading": float(np.degrees(segment_map.headings[pick.segment])),
        "scans": sorted({f"{s.log}.{s.scan}" for s in segment_map.sources[pick.segment]}),
    }
    return {**told, **_in_chain(content, pick)} if pick.source in ("first", "second") else told


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
            told["chain"] = {
                "number": place + 1,
                "value": pair.chains[k].value,
                "segments": len(pair.chains[k].first) + len(pair.chains[k].second),
                "colour": hexadecimal(content.palette.chain(place)),
            }
    return told
