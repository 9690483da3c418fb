"""The layers of the merged map, and of the space of poses, each a function from content to drawables."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.content import Content, Placed, merit
from app.drawables import Array32, Drawable, label, lift, lines, points
from app.palette import RGB
from segmap.integration import Candidate
from segmap.merging import witnesses
from segmap.pose import FloatArray
from segmap.scans import ScanId

__all__ = [
    "candidate_points",
    "component_colour",
    "components",
    "map_caption",
    "map_colours",
    "other",
    "other_caption",
    "pair_in_map",
    "trajectory",
]

WORST = 0.15
"""metres; a misfit that is shown as bad"""
WITNESSED = np.array([0, 1, 2, 3, 6])
"""scans; where the classes of walls by the number of scans that saw them begin"""

COMPONENT_COLOURS = (2, 6, 3, 5, 4)
"""of the palette's chains; its blue and orange are the pair's"""
HEIGHT = 0.35
"""height of a full turn in the space of poses, as a share of the width of what is drawn"""
BAR = 0.12
"""height of the best value, as a share of the same"""
FLOOR = 0.05
"""gap between the plane and the space of poses, as a share of the same"""


def component_colour(content: Content, place: int) -> RGB:
    """The colour of a component: the first is neutral, as the pair is shown in colour on it."""
    if place == 0:
        return content.palette.neutral
    return content.palette.chain(COMPONENT_COLOURS[(place - 1) % len(COMPONENT_COLOURS)])


def components(content: Content) -> Iterator[Drawable]:
    """The merged map, one drawable for each component; while it moves, the walls of its scans."""
    motion = content.map.motion
    for place, placed in _shown(content):
        colour = component_colour(content, place)
        name = f"component {placed.component.name}"
        if motion is not None and motion.walls:
            yield _moving(content, placed, name, colour)
        else:
            yield _walls(content, placed, name, colour)
        if len(content.placed) > 1:
            yield label(f"{name}/label", "map", placed.component.name, _corner(placed), colour, "map", 12)


def _shown(content: Content) -> Iterator[tuple[int, Placed]]:
    """The components that are not hidden, each with its place among all."""
    return ((i, placed) for i, placed in enumerate(content.placed) if placed in content.shown_parts)


def _walls(content: Content, placed: Placed, name: str, colour: RGB) -> Drawable:
    coordinates = placed.map.coordinates
    return Drawable(
        name,
        "map",
        "lines",
        lines(coordinates),
        colour,
        "map",
        3,
        2.0,
        _wall_colours(content, placed),
        source=placed.component.name,
        segments=np.arange(len(coordinates)),
    )


def _wall_colours(content: Content, placed: Placed) -> NDArray[np.uint8] | None:
    looks, palette = content.map.looks, content.palette
    if looks.colouring == "misfit":
        off = content.map.misfits.get(placed.component.name)
        return None if off is None else palette.by_heat(off / WORST)
    if looks.colouring == "witnesses":
        classes = np.searchsorted(WITNESSED, witnesses(placed.component.map), side="right") - 1
        return np.array(witness_colours(content), np.uint8)[classes]
    return None


def witness_colours(content: Content) -> tuple[RGB, ...]:
    """Of walls that no scan, one, two and more saw, as ``WITNESSED`` has them."""
    palette = content.palette
    return palette.neutral, palette.bad, palette.sights[2], palette.good, palette.first


def _moving(content: Content, placed: Placed, name: str, colour: RGB) -> Drawable:
    motion = content.map.motion
    assert motion is not None
    walls = [
        content.pose_of(placed, scan) @ motion.walls[scan].reshape(-1, 2, 2)
        for scan in placed.component.scans
        if scan in motion.walls
    ]
    drawn = lines(np.concatenate(walls).reshape(-1, 4) if walls else np.empty((0, 4)))
    return Drawable(f"{name}/moving", "map", "lines", drawn, content.palette.faint(colour, 0.6), "map", 3, 1.5)


def map_caption(content: Content) -> str:
    """What the colours of the map say."""
    colouring, worst = content.map.looks.colouring, content.map.worst()
    if colouring == "misfit" and worst is not None:
        half, most = (100.0 * off for off in worst)
        return (
            f"; colour: how far single scans lie from the wall, 0 to {100.0 * WORST:.0f} cm;"
            f" half within {half:.1f} cm, 95 % within {most:.1f} cm"
        )
    if colouring == "witnesses":
        return "; colour: seen by no scan (put in between), 1, 2, 3 to 5, more scans"
    return ""


def map_colours(content: Content) -> tuple[RGB, ...]:
    """For the legend."""
    colouring = content.map.looks.colouring
    if colouring == "misfit":
        return content.palette.heat
    if colouring == "witnesses":
        return witness_colours(content)
    return tuple(component_colour(content, k) for k in range(max(1, min(6, len(content.placed)))))


def other(content: Content) -> Iterator[Drawable]:
    """The map to compare with, beside the merged one or over it."""
    held = content.map.other
    if held is None:
        return
    colour = content.palette.second
    for place, placed in enumerate(content.beside):
        drawn = lines(placed.map.coordinates)
        yield Drawable(f"other/{place}", "other", "lines", drawn, colour, "map", 4, 1.6)
    if content.beside and content.map.looks.side == "beside":
        left, _, _, top = content.beside[0].map.bounds or (0.0, 0.0, 0.0, 0.0)
        yield label("other/label", "other", held.title, (left, top), colour, "map", 12, "bottom-center")


def other_caption(content: Content) -> str:
    """What it is compared with."""
    held = content.map.other
    if held is None:
        return "none chosen"
    if held.problem:
        return f"{held.title}: {held.problem}"
    length = sum(float(placed.component.map.lengths.sum()) for placed in content.beside)
    scans = sum(len(placed.component.scans) for placed in content.beside)
    return f"{held.title}: {scans} scans, {length:.0f} m of segments"


def _corner(placed: Placed) -> tuple[float, float]:
    left, _, _, top = placed.map.bounds or (0.0, 0.0, 0.0, 0.0)
    return left, top


def trajectory(content: Content) -> Iterator[Drawable]:
    """Where the sensor stood, scan after scan, in each component."""
    for place, placed in _shown(content):
        colour = component_colour(content, place)
        poses = [content.pose_of(placed, scan) for scan in sorted(placed.component.scans)]
        stops = np.array([[pose.x, pose.y] for pose in poses])
        name = f"trajectory {placed.component.name}"
        steps = np.concatenate((stops[:-1], stops[1:]), axis=1)
        yield Drawable(name, "trajectory", "lines", lines(steps), content.palette.faint(colour, 0.6), "map", 8, 1.5)
        yield Drawable(f"{name}/stops", "trajectory", "points", points(stops), colour, "map", 9, 5.0)


def pair_in_map(content: Content) -> Iterator[Drawable]:
    """The selected scans, highlighted where the merged map has them."""
    if content.pair is None:
        return
    palette = content.palette
    sides = zip(
        ("first", "second"),
        content.pair.scans,
        content.pair.maps,
        content.pair.names,
        (palette.first, palette.second),
        strict=True,
    )
    for name, scan, segment_map, title, colour in sides:
        placed = _home(content, scan)
        if placed is not None:
            pose = content.pose_of(placed, scan)
            moved = segment_map.moved(pose).coordinates
            yield Drawable(f"pair/{name}", "pair", "lines", lines(moved), colour, "map", 5, 3.5)
            yield label(f"pair/{name}/label", "pair", title, (pose.x, pose.y), colour, "map", 12)


def _home(content: Content, scan: ScanId) -> Placed | None:
    """The component that has a scan."""
    return next((p for p in content.shown_parts if scan in p.component.poses), None)


# --- the space of poses ---------------------------------------------------------------------------


def candidate_points(content: Content) -> Iterator[Drawable]:
    """Ranked candidates at (x, y, theta), each with a bar as high as its value or score; in the plane only (x, y)."""
    pair = content.pair
    if pair is None or not pair.ranked:
        return
    palette, places = content.palette, _places(content, pair.ranked)
    values = np.array([merit(c) for c in pair.ranked])
    colours = palette.by_value((values - values.min()) / (np.ptp(values) or 1.0))
    yield Drawable("candidates/points", "candidates", "points", places, palette.neutral, "first", 13, 8.0, colours)
    if content.dimension == 3:
        yield from _bars(content, places, values.clip(0.0) / (values.max() if values.max() > 0.0 else 1.0))
        yield from _turn_axis(content)
    if pair.candidate is not None:
        yield from _chosen(content, _places(content, (pair.candidate,))[0])


def _width(content: Content) -> float:
    left, bottom, right, top = content.bounds or (0.0, 0.0, 10.0, 10.0)
    return max(right - left, top - bottom)


def _places(content: Content, candidates: tuple[Candidate, ...]) -> Array32:
    poses = np.array([tuple(c.T_1_2) for c in candidates])
    return lift(poses[:, :2], _heights(poses[:, 2], content) if content.dimension == 3 else 0.0)


def _heights(thetas: ArrayLike, content: Content) -> FloatArray:
    turns = (np.asarray(thetas, dtype=np.float64) + math.pi) / (2.0 * math.pi)
    return _width(content) * (FLOOR + HEIGHT * turns)


def _bars(content: Content, places: Array32, shares: FloatArray) -> Iterator[Drawable]:
    tops = places.copy()
    tops[:, 2] += _width(content) * BAR * shares
    colour = content.palette.values[len(content.palette.values) // 2]
    yield Drawable("candidates/bars", "candidates", "lines", np.stack((places, tops), axis=1), colour, depth=13)


def _turn_axis(content: Content) -> Iterator[Drawable]:
    """The axis of theta, at a far corner of what is drawn."""
    colour = content.palette.neutral
    left, _, _, top = content.bounds or (0.0, 0.0, 10.0, 10.0)
    corner = (left, top)
    ends = lift([corner, corner], _heights([-math.pi, math.pi], content))
    yield Drawable("candidates/axis", "candidates", "lines", ends[None], colour, depth=13, thickness=1.5)
    for degrees in (-180, 0, 180):
        at = (*corner, float(_heights(math.radians(degrees), content)))
        yield label(
            f"candidates/axis {degrees}", "candidates", f"θ = {degrees}°".replace("-", "−"), at, colour, depth=13
        )


def _chosen(content: Content, at: Array32) -> Iterator[Drawable]:
    """A mark on the candidate that is shown, and a stem down to the plane."""
    colour = content.palette.accent
    yield Drawable("candidates/shown", "candidates", "points", at[None], colour, depth=14, thickness=12.0)
    if content.dimension == 3:
        stem = np.stack((lift(at[:2]), at))
        yield Drawable("candidates/stem", "candidates", "lines", stem[None], colour, depth=13, thickness=1.5)
