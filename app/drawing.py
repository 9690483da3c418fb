"""What is known -> one picture: drawables, captions, and where the second map stands (no viser, no state).

A picture shows one stage of an integration, as a choice of layers. Everything is drawn in the frame
of the first map; the second map's layers all hang under one frame, so that another candidate moves
only that frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from app import graph_layers, grid, map_layers, marks, pair_layers
from app.claims import NUDGED
from app.content import Content, Pair, merit
from app.drawables import Box, Drawable, label
from app.palette import RGB
from app.sights import CLASSES
from segmap.pose import Pose2

__all__ = ["LAYERS", "LAYERS_OF", "STAGES", "Layer", "Picture", "draw", "layers"]

EMPTY: Box = (-5.0, -5.0, 5.0, 5.0)
"""metres, shown where there is nothing"""


@dataclass(frozen=True)
class _Kind:
    """What a layer is, whatever it shows at the moment."""

    title: str
    unit: str
    drawer: Callable[[Content], Iterator[Drawable]]
    caption: Callable[[Content], str]
    colours: Callable[[Content], tuple[RGB, ...]]


@dataclass(frozen=True)
class Layer:
    """A layer of a picture: what the legend says of it, and whether it is drawn."""

    name: str
    title: str
    caption: str
    unit: str
    colours: tuple[RGB, ...]
    visible: bool


@dataclass(frozen=True, eq=False)
class Picture:
    """What one view shows."""

    drawables: tuple[Drawable, ...]
    layers: tuple[Layer, ...]
    """all layers of the stage, the ones switched off too"""
    T_1_2: Pose2
    """where the frame ``second`` stands in the frame ``first``"""
    bounds: Box
    """metres, the box around what matters"""
    dimension: int
    theme: str
    subject: tuple[str, ...]
    """what is looked at: when it changes, the camera should fit again"""


def draw(content: Content) -> Picture:
    """The picture of a content; empty scans, one segment or no candidate give a sensible, smaller one."""
    shown = layers(content)
    drawables = [d for layer in shown if layer.visible for d in _KINDS[layer.name].drawer(content)]
    drawables += [*marks.picked(content), *marks.laying(content), *marks.measured(content)]
    if content.bounds is None:
        text = content.message or "There is nothing to show yet."
        drawables.append(label("message", "message", text, (0.0, 0.0), content.palette.text))
    return Picture(
        drawables=tuple(drawables),
        layers=shown,
        T_1_2=content.T_1_2,
        bounds=content.bounds or EMPTY,
        dimension=content.dimension,
        theme=content.theme,
        subject=_subject(content),
    )


def layers(content: Content) -> tuple[Layer, ...]:
    """The layers of the content's stage, with captions and units."""
    return tuple(_layer(name, visible, content) for name, visible in LAYERS_OF[content.stage].items())


def _layer(name: str, visible: bool, content: Content) -> Layer:
    kind = _KINDS[name]
    if name == "candidates":
        visible = content.dimension == 3
    if name == "other":
        visible = content.map.other is not None
    if name == "returns" and content.stage == "candidate":
        visible = content.pair is None or content.pair.sights is None  # otherwise they are drawn as lines of sight
    visible = content.shown.get(name, visible)
    return Layer(name, kind.title, kind.caption(content), kind.unit, kind.colours(content), visible)


def _subject(content: Content) -> tuple[str, ...]:
    integration = content.pair.integration if content.pair else ""
    if content.stage == "map":
        beside = (content.map.looks.compare, content.map.looks.side) if content.beside else ()
        return ("map", *(placed.component.name for placed in content.placed[:1]), *beside)
    return (integration, "superimposed" if content.superimposed else "side by side")


# --- the legend -----------------------------------------------------------------------------------


def _of_pair(caption: Callable[[Pair], str]) -> Callable[[Content], str]:
    return lambda content: caption(content.pair) if content.pair else ""


def _ghosts(pair: Pair) -> str:
    found = pair_layers.rivals(pair.ranked, pair.candidate)
    if not found:
        return "no other candidate says something else"
    return "the next best: " + ", ".join(f"#{rank + 1} with {merit(rival):.2f} m" for rank, rival in found)


def _sight_caption(pair: Pair) -> str:
    if pair.sights is None:
        return "no candidate to look at" if pair.candidate is None else "nothing is known of the scans' beams"
    told = ", ".join(f"{name} {getattr(pair.sights.evidence, name):.1f} m" for name in CLASSES)
    return f"what the beams of each scan say of the other's returns: {told}"


def _sight_colours(content: Content) -> tuple[RGB, ...]:
    return content.palette.sights


def _chain_caption(pair: Pair) -> str:
    total = sum(chain.value for chain in pair.chains)
    return f"{_count(len(pair.chains), 'chain')} of matching segments, {total:.2f} m together"


def _fused_caption(pair: Pair) -> str:
    count = len(pair.fusion.polylines) if pair.fusion else 0
    kept = len(pair_layers.unmatched(pair)) if pair.fusion else 0
    return f"{_count(count, 'polyline')} in place of the chains, {_count(kept, 'segment')} kept"


def _candidate_caption(pair: Pair) -> str:
    if not pair.ranked:
        return "none"
    low, high = merit(pair.ranked[-1]), merit(pair.ranked[0])
    told = f"{_count(len(pair.ranked), 'pose')} (x, y, θ) of the second sensor"
    what = "value" if pair.ranked[0].score is None else "score"
    return f"{told}; colour and height by {what}, {low:.2f} to {high:.2f} m"


def _angle_caption(pair: Pair) -> str:
    if pair.candidate is not None and pair.candidate.index < 0:
        return "none: this pose was laid by hand" if pair.candidate.index == NUDGED else "none: this pose was claimed"
    if pair.candidate is not None and len({*pair.candidate.angle_1}) == 1:
        return "the two segments this candidate lays on each other, extreme on extreme"
    return "the two angles this candidate superimposes, vertex on vertex"


def _map_caption(content: Content) -> str:
    length = sum(float(placed.component.map.lengths.sum()) for placed in content.placed)
    scans = sum(len(placed.component.scans) for placed in content.placed)
    alone = content.scans - scans
    told = f"{_count(len(content.placed), 'component')} of {_count(scans, 'scan')}, {length:.0f} m of segments"
    left = f"; {_count(alone, 'scan')} not placed" if alone > 0 else ""
    return told + left + map_layers.map_caption(content)


def _in_map_caption(content: Content) -> str:
    if content.pair is None:
        return ""
    told = zip(content.pair.scans, content.pair.names, strict=True)
    held = [name for scan, name in told if any(scan in placed.component.poses for placed in content.placed)]
    return " and ".join(held) if held else "neither scan of this pair is in the map yet"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _colours(*names: str) -> Callable[[Content], tuple[RGB, ...]]:
    return lambda content: tuple(getattr(content.palette, name) for name in names)


def _trajectory_colours(content: Content) -> tuple[RGB, ...]:
    return tuple(map_layers.component_colour(content, k) for k in range(max(1, min(6, len(content.placed)))))


_KINDS = {
    "first": _Kind(
        "First scan",
        "m",
        pair_layers.first,
        _of_pair(lambda p: f"{p.names[0]}: {_count(len(p.maps[0]), 'segment')}"),
        _colours("first"),
    ),
    "second": _Kind(
        "Second scan",
        "m",
        pair_layers.second,
        _of_pair(lambda p: f"{p.names[1]}: {_count(len(p.maps[1]), 'segment')}"),
        _colours("second"),
    ),
    "returns": _Kind(
        "Laser returns",
        "m",
        pair_layers.returns,
        _of_pair(lambda p: f"{len(p.returns[0])} and {len(p.returns[1])} points the laser met"),
        _colours("first", "second"),
    ),
    "sights": _Kind("Lines of sight", "m", pair_layers.lines_of_sight, _of_pair(_sight_caption), _sight_colours),
    "sensors": _Kind(
        "Sensors",
        "m, rad",
        pair_layers.sensors,
        lambda _: "where the sensor stood and looked",
        _colours("first", "second"),
    ),
    "angle": _Kind(
        "Equal angles",
        "rad",
        pair_layers.angle,
        _of_pair(_angle_caption),
        _colours("accent"),
    ),
    "rivals": _Kind("Rivals", "m", pair_layers.rival_segments, _of_pair(_ghosts), _colours("neutral")),
    "candidates": _Kind(
        "Candidates",
        "m, °",
        map_layers.candidate_points,
        _of_pair(_candidate_caption),
        lambda content: content.palette.values[::2],
    ),
    "chains": _Kind(
        "Matching chains",
        "m",
        pair_layers.chains,
        _of_pair(_chain_caption),
        lambda content: content.palette.chains[: max(1, len(content.pair.chains) if content.pair else 1)],
    ),
    "fused": _Kind(
        "Fused map",
        "m",
        pair_layers.fused,
        _of_pair(_fused_caption),
        lambda content: (*content.palette.chains[:3], content.palette.neutral),
    ),
    "map": _Kind("Merged map", "m", map_layers.components, _map_caption, map_layers.map_colours),
    "pair": _Kind("This pair", "m", map_layers.pair_in_map, _in_map_caption, _colours("first", "second")),
    "trajectory": _Kind(
        "Trajectory", "m", map_layers.trajectory, lambda _: "where the accepted scans were taken", _trajectory_colours
    ),
    "edges": _Kind("Integrations", "σ", graph_layers.edges, graph_layers.edges_caption, graph_layers.colours),
    "closures": _Kind(
        "Loop closures", "m", graph_layers.candidates, graph_layers.candidates_caption, _colours("first")
    ),
    "other": _Kind("Compared with", "m", map_layers.other, map_layers.other_caption, _colours("second")),
    "grid": _Kind("Grid", "m", grid.draw, grid.caption, _colours("neutral")),
}
LAYERS = tuple(_KINDS)
"""Names of all layers."""

LAYERS_OF: dict[str, dict[str, bool]] = {
    "scans": {"returns": True, "first": False, "second": False, "sensors": True, "grid": True},
    "segments": {"first": True, "second": True, "returns": True, "sensors": True, "grid": True},
    "candidate": {
        "first": True,
        "second": True,
        "angle": True,
        "rivals": True,
        "candidates": False,
        "sights": True,
        "returns": False,
        "sensors": True,
        "grid": True,
    },
    "chains": {
        "chains": True,
        "first": True,
        "second": True,
        "angle": False,
        "rivals": False,
        "candidates": False,
        "sights": False,
        "returns": True,
        "sensors": True,
        "grid": True,
    },
    "fused": {"fused": True, "first": True, "second": True, "returns": False, "sensors": True, "grid": True},
    "map": {
        "map": True,
        "pair": True,
        "trajectory": True,
        "edges": True,
        "closures": True,
        "other": True,
        "grid": True,
    },
}
"""The layers of each stage, and whether they are drawn where nobody said otherwise."""

STAGES = tuple(LAYERS_OF)
"""The stages of an integration, in order, and the merged map."""
