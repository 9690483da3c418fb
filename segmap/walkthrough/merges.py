"""Merging a sequence of scans: sequential, tree and pivot as trees of integrations one can go into (Section IV)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from segmap import tracing
from segmap.fusion import spurious_length, spurious_stretches
from segmap.merging import METHODS, Merge, MergeNode, MergeStep, merge
from segmap.parameters import Parameters
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.walkthrough.graphs import graph_stages, matched_edges
from segmap.walkthrough.pairs import PairWalk, walk_maps
from segmap.walkthrough.steps import Mark, Quantity, Stage, Step, Walkthrough, around, lines, metres, rounded

__all__ = ["MergeWalk", "walk_merge"]

ABOUT = {
    "sequential": "Each new scan is integrated with the whole map so far. The larger the map, the longer that takes,"
    " and the more there is in it that a small scan may be mistaken for.",
    "tree": "Neighbours are integrated, then the results with their neighbours, and so on. The two are always about"
    " as large as each other, but the same walls are fused again and again: doubled walls pile up.",
    "pivot": "Neighbours are integrated only to learn how each scan lies on the one before it. The motions are composed"
    " and each scan is fused once: as few integrations as the sequential method, of two scans each, and as a rule fewer"
    " doubled walls than the tree method.",
}
DOTS = {
    "sequential": "is a call of INTEGRATE, which finds how a scan lies on the map so far and fuses them",
    "tree": "is a call of INTEGRATE, which finds how two maps lie on each other and fuses them",
    "pivot": "is a scan fused with the map so far, where a call of INTEGRATE on it and its neighbour alone has it",
}
LINES = {"sequential": ("1", "3"), "tree": ("1", "3"), "pivot": ("1", "6")}


@dataclass(frozen=True, eq=False)
class MergeWalk:
    """A walkthrough of merges of one sequence, and a way into each integration."""

    walk: Walkthrough
    merges: Mapping[str, Merge]
    parameters: Parameters
    mode: str

    def enter(self, name: str) -> PairWalk | None:
        """The walkthrough of one integration by the name its step gives, such as ``tree:7``; None: there is none."""
        method, _, number = name.partition(":")
        if method not in self.merges or not (number.isdecimal() and len(number) < 7):
            return None
        nodes = _nodes(self.merges[method])
        node = nodes[int(number)] if int(number) < len(nodes) else None
        if node is None or node.step is None or node.step.match is None:
            return None
        first, second = _integrated(method, node, node.step)
        title = f"{_name(first)} with {_name(second)}"
        return walk_maps(first.map, second.map, self.parameters, node.step.match.heuristic, self.mode, title)


def walk_merge(
    maps: Mapping[ScanId, SegmentMap],
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    title: str = "",
) -> MergeWalk:
    """The three methods on one sequence of scans, step by step, and how the pose graph makes all fit.

    Raises:
        ParameterError: there is no such heuristic or mode.
    """
    parameters = parameters or Parameters()
    merges: dict[str, Merge] = {}
    for method in METHODS:
        with tracing.recording() as trace:
            merges[method] = merge(maps, parameters, heuristic, mode, method)
        assert len(trace.all("joined")) >= sum(len(part.scans) > 1 for part in merges[method].components)
    stages = [_method_stage(method, made) for method, made in merges.items()]
    stages.append(_comparison(merges))
    stages += graph_stages(matched_edges(maps, parameters, heuristic, mode), maps)
    base = {f"scan {scan}": rounded(one.coordinates) for scan, one in maps.items()}
    return MergeWalk(Walkthrough(title, tuple(stages), base), merges, parameters, mode)


def _nodes(made: Merge) -> list[MergeNode]:
    """Every node of all trees of a merge, parts before the whole, each once."""
    found: dict[int, MergeNode] = {}
    for part in made.components:
        for node in part.tree.nodes() if part.tree else ():
            found.setdefault(id(node), node)
    return list(found.values())


def _integrated(method: str, node: MergeNode, step: MergeStep) -> tuple[MergeNode, MergeNode]:
    """What INTEGRATE was called on: the two maps that became one, or of the pivot method the neighbours alone."""
    first, second = (node.leaf(scan) for scan in step.pair) if method == "pivot" else (None, None)
    return first or step.first, second or step.second


def _spoken(scans: Sequence[ScanId]) -> str:
    numbers = sorted(scan.scan for scan in scans)
    return f"scan {numbers[0]}" if len(numbers) == 1 else f"scans {numbers[0]} to {numbers[-1]}"


def _name(node: MergeNode) -> str:
    numbers = [scan.scan for scan in node.scans]
    return f"scan {numbers[0]}" if len(numbers) == 1 else f"the map of scans {numbers[0]} to {max(numbers)}"


# --- one method -------------------------------------------------------------------------------------


def _method_stage(method: str, made: Merge) -> Stage:
    held = _Method(method, made)
    marks = (Mark(0, "the plan"), Mark(len(held.joined), "the whole map"))
    return Stage(
        id=method,
        title=f"The {method} method",
        about=ABOUT[method],
        algorithm="6" if method == "pivot" else method,
        count=len(held.joined) + 1,
        step=held.step,
        marks=marks,
        box=around(*(part.map.coordinates for part in made.components)),
        chart=held.chart(),
        figure="Fig. 6",
    )


class _Method:
    def __init__(self, method: str, made: Merge) -> None:
        self.method, self.made = method, made
        self.nodes = _nodes(made)
        self.place = {id(node): number for number, node in enumerate(self.nodes)}
        self.joined = [number for number, node in enumerate(self.nodes) if node.step is not None]

    def step(self, k: int) -> Step:
        """The plan, or one integration."""
        return self._plan() if k == 0 else self._joined(self.joined[k - 1], k)

    def _plan(self) -> Step:
        scans = [scan for part in self.made.components for scan in part.scans]
        say = (
            f"{len(scans)} scans, and the map they end in. The small picture shows which maps become one: each dot"
            f" below the first row {DOTS[self.method]}. Click one, then go into it."
        )
        if len(self.made.components) > 1:
            left = " and of ".join(_spoken(part.scans) for part in self.made.components)
            say += f" Not everything could be joined: {len(self.made.components)} maps are left, of {left}; the picture"
            say += " shows the first. Calls that found nothing have no dot."
        shapes = [lines(part.map.coordinates, "first", width=2) for part in self.made.components[:1]]
        return Step(LINES[self.method][0], say, tuple(shapes), self._counts())

    def _counts(self) -> tuple[Quantity, ...]:
        calls = ("calls of INTEGRATE", str(len(self.made.calls)), "")
        doubled = sum(spurious_length(part.map) for part in self.made.components)
        return calls, ("maps left", str(len(self.made.components)), ""), metres("doubled walls", doubled, 2)

    def _joined(self, number: int, k: int) -> Step:
        node = self.nodes[number]
        assert node.step is not None
        first, second, T_1_2 = node.step.first, node.step.second, node.step.T_1_2
        doubled = spurious_stretches(node.map)
        shapes = [lines(first.map.coordinates, "first", width=2.5)]
        shapes += [lines(second.map.moved(T_1_2).coordinates, "second", width=1.8), lines(doubled, "bad", width=6)]
        match = node.step.match
        say = (
            f"{_capital(_name(first))} (blue) and {_name(second)} (orange) become one.{self._known(node, node.step)}"
            f" {'Red: walls that are in the new map twice.' if len(doubled) else 'No wall is doubled.'}"
            f" {' '.join(node.step.remarks)}"
        ).strip()
        told = (("segments", f"{len(first.map)} + {len(second.map)} → {len(node.map)}", ""),)
        told += (metres("doubled walls", spurious_length(node.map), 2),)  # type: ignore[assignment]
        enter = None if match is None else {"label": "Go into this integration", "node": f"{self.method}:{number}"}
        line = LINES[self.method][0 if k == 1 and self.method == "pivot" else 1]
        leaf = first.step is None and second.step is None and self.method == "tree"
        return Step(
            "1" if leaf else line,
            say,
            tuple(shapes),
            told,
            box=around(node.map.coordinates),
            at=(float(number), 0.0),
            enter=enter,
        )

    def _known(self, node: MergeNode, step: MergeStep) -> str:
        """Where the pose comes from."""
        if step.match is None:
            return ""
        value = f"a value of {step.match.value:.2f} m"
        parts = _integrated(self.method, node, step)
        if parts[0] is step.first:
            return f" INTEGRATE gave it {value}."
        alone, other = (_name(part) for part in parts)
        return (
            f" INTEGRATE saw {alone} and {other} alone, and gave them {value}; composed with where {alone} lies"
            f" already, that is where {other} lies."
        )

    def chart(self) -> dict[str, object]:
        """The tree of integrations, scans on top (Fig. 6)."""
        scans = sorted({scan for node in self.nodes for scan in node.scans})
        column = {scan: float(k) for k, scan in enumerate(scans)}
        level: dict[int, int] = {}
        rows = []
        for number, node in enumerate(self.nodes):
            parts = () if node.step is None else (node.step.first, node.step.second)
            level[number] = 1 + max((level[self.place[id(part)]] for part in parts), default=-1)
            step = self.joined.index(number) + 1 if node.step is not None else None
            x = float(np.mean([column[scan] for scan in node.scans]))
            row = {"x": x, "y": level[number], "label": _name(node), "role": "first" if step is None else "second"}
            rows.append({**row, **({} if step is None else {"enter": step})})
        edges = [
            [self.place[id(part)], number]
            for number, node in enumerate(self.nodes)
            if node.step is not None
            for part in (node.step.first, node.step.second)
        ]
        title = "Which maps become one, scans on top"
        return {"kind": "tree", "title": title, "nodes": rows, "edges": edges}


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


# --- all of them ------------------------------------------------------------------------------------


def _comparison(merges: Mapping[str, Merge]) -> Stage:
    """The three maps one after the other, with what each cost."""
    names = list(merges)
    doubled = [sum(spurious_length(part.map) for part in made.components) for made in merges.values()]
    chart = {
        "kind": "bars",
        "title": "Doubled walls by method",
        "x": "",
        "names": names,
        "y": "m",
        "values": [round(length, 3) for length in doubled],
        "marked": {str(int(np.argmax(doubled))): "bad"},
        "legend": [],
    }

    def step(k: int) -> Step:
        made, length = merges[names[k]], doubled[k]
        rows = sum(len(part.map) for part in made.components)
        shapes = [lines(part.map.coordinates, "first", width=2) for part in made.components[:1]]
        shapes += [lines(spurious_stretches(part.map), "bad", width=5) for part in made.components[:1]]
        say = (
            f"{names[k].capitalize()}: {len(made.calls)} calls of INTEGRATE, {rows} segments, {length:.2f} m of wall"
            " twice in the map (red)."
        )
        if len(made.components) > 1:
            say += f" {len(made.components)} maps are left; the picture shows the first, the numbers are of all."
        told = (("calls of INTEGRATE", str(len(made.calls)), ""), ("segments", str(rows), ""))
        return Step("ABC"[k], say, tuple(shapes), (*told, metres("doubled walls", length, 2)))

    return Stage(
        id="comparison",
        title="The three methods compared",
        about="The same scans by each method: what differs is what is integrated and fused with what, and how often.",
        algorithm="methods",
        count=len(names),
        step=step,
        marks=tuple(Mark(k, name) for k, name in enumerate(names)),
        box=around(*(part.map.coordinates for made in merges.values() for part in made.components[:1])),
        chart=chart,
        figure="Figs. 7 and 11 to 13",
    )
