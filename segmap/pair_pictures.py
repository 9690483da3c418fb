"""Pairs of the benchmark as pictures: both scans at the truth, at the best candidate and at the first rivals.

Every panel has the same scale and the frame of scan 1. Returns are dots, segments lines, sensors arrows; a
return that the other scan sees through is red, one close behind a surface the other scan sees is violet.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from textwrap import wrap

import numpy as np

from segmap._sight_kernels import CONTRADICTED, SHADOWED
from segmap.benchmark import Outcome, is_right
from segmap.integration import Candidate
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.refinement import refined
from segmap.scans import LaserLog
from segmap.segments import SegmentMap, extract
from segmap.visibility import Sighting, classes, look, score, sighting

__all__ = ["Subject", "Truth", "about", "draw", "index_page", "name_of"]

COLUMNS, WIDTH, TALLEST = 2, 470.0, 620.0
"""panels in a row; width of a panel, and its greatest height, pixels"""
MARGIN, LINE, LETTERS = 14.0, 17.0, 132
"""pixels around panels and from line to line; letters in a line of text"""
FIRST, SECOND, AGAINST, BEHIND, INK = "#0b5394", "#c2410c", "#dc2626", "#7c3aed", "#111827"
FEW, PADDING = 2.0, 1.0
"""percent of the returns that may lie beyond each side of a panel; metres around the others"""
DOT, PEN, ARROW = 2.2, 1.4, 14.0
"""pixels"""
TRUTH_STEPS, TRUTH_GATES = 10, (0.3, 0.1)
"""refinement of the truth: steps, and the gate in metres it begins and ends with"""
ORDINALS = ("best", "second", "third")


@dataclass(frozen=True)
class Truth:
    """What the evidence says at the true pose."""

    T_1_2: Pose2
    score: float
    """metres"""
    refined: Pose2
    """where refinement leads from there"""
    refined_score: float
    """metres"""


@dataclass(frozen=True, eq=False)
class Subject:
    """A pair that was matched, with its scans."""

    log: LaserLog
    outcome: Outcome
    parameters: Parameters

    @cached_property
    def maps(self) -> tuple[SegmentMap, SegmentMap]:
        """The segments of both scans."""
        pair = self.outcome.pair
        return extract(self.log.scan(pair.i), self.parameters), extract(self.log.scan(pair.j), self.parameters)

    @cached_property
    def sights(self) -> tuple[Sighting, Sighting] | None:
        """What both scans saw; None where one saw nothing."""
        seen_1, seen_2 = map(sighting, self.maps)
        return None if seen_1 is None or seen_2 is None else (seen_1, seen_2)

    @cached_property
    def truth(self) -> Truth | None:
        """The evidence at the truth; None where the scans have no common wall, or one saw nothing."""
        T_1_2, sights = self.outcome.pair.truth, self.sights
        if T_1_2 is None or sights is None:
            return None
        moved = refined(*sights, np.array([(*T_1_2,)]), TRUTH_STEPS, *TRUTH_GATES)
        before, after = score(look(*sights, np.array([(*T_1_2,), moved[0]]), self.parameters), self.parameters)
        return Truth(T_1_2, float(before), Pose2(*moved[0]), float(after))

    @property
    def points(self) -> tuple[FloatArray, FloatArray]:
        """The returns of both scans, (n, 2) each, metres, each in its own frame."""
        pair = self.outcome.pair
        return self.log.scan(pair.i).returns()[0], self.log.scan(pair.j).returns()[0]


def name_of(log: str, outcome: Outcome) -> str:
    """A name for the picture of a pair, without an extension.

    ``log`` is the path of the log as the pair set has it.
    """
    stem = log.replace("\\", "/").rpartition("/")[2].partition(".")[0]
    safe = "".join(letter if letter.isalnum() else "-" for letter in f"{stem}-{outcome.pair.kind}")
    return f"{safe}-{outcome.pair.i}-{outcome.pair.j}"


def about(outcome: Outcome) -> str:
    """What went wrong with a pair, with how far the best pose is from the truth."""
    off = _off(outcome.match.T_1_2, outcome.pair.truth)
    return ", ".join(part for part in (outcome.fault or "right", off) if part)


def _off(T_1_2: Pose2 | None, truth: Pose2 | None) -> str:
    if T_1_2 is None or truth is None:
        return ""
    distance, angle = T_1_2.distance(truth)
    return f"{distance:.2f} m and {math.degrees(angle):.1f} deg from the truth"


# --- one pair -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Panel:
    T_1_2: Pose2
    caption: tuple[str, ...]


def draw(subject: Subject, title: str) -> str:
    """The picture of one pair as an SVG document; the same input gives the same text."""
    panels = list(_panels(subject))
    box = _box(subject, [panel.T_1_2 for panel in panels])
    scale = min(WIDTH / (box[2] - box[0]), TALLEST / (box[3] - box[1]))
    height = scale * (box[3] - box[1])
    head = [title, about(subject.outcome), *_reasons(subject.outcome)]
    top, row = MARGIN + LINE * (len(head) + 1), height + 3 * LINE + MARGIN
    places = [(MARGIN + (k % COLUMNS) * (WIDTH + MARGIN), top + (k // COLUMNS) * row) for k in range(len(panels))]
    size = COLUMNS * (WIDTH + MARGIN) + MARGIN, top + row * max(1, math.ceil(len(panels) / COLUMNS))
    body = [_panel(subject, panel, place, box, scale) for panel, place in zip(panels, places, strict=True)]
    return "\n".join((_opening(title, size), *_defs(subject, scale), *_text(head, MARGIN, MARGIN), *body, "</svg>\n"))


def _panels(subject: Subject) -> Iterator[_Panel]:
    if subject.truth is not None:
        yield _Panel(subject.truth.T_1_2, tuple(_of_truth(subject.truth)))
    for ordinal, rival in zip(ORDINALS, subject.outcome.rivals, strict=False):
        yield _Panel(rival.T_1_2, tuple(_of_rival(ordinal, rival, subject.outcome)))


def _of_truth(truth: Truth) -> Iterator[str]:
    distance, angle = truth.T_1_2.distance(truth.refined)
    yield f"truth: score {truth.score:.2f} m"
    yield f"refined from it: score {truth.refined_score:.2f} m, {distance:.2f} m and {math.degrees(angle):.1f} deg away"


def _of_rival(ordinal: str, rival: Candidate, outcome: Outcome) -> Iterator[str]:
    held = "" if rival.score is None else f"score {rival.score:.2f} m, "
    right = " (right)" if is_right(rival.T_1_2, outcome.pair.truth) else ""
    yield f"{ordinal}{right}: {held}value {rival.value:.2f} m"
    yield _off(rival.T_1_2, outcome.pair.truth)


def _reasons(outcome: Outcome) -> list[str]:
    told = " ".join((f"Verdict: {outcome.match.verdict.value}.", *outcome.match.reasons))
    return wrap(told, LETTERS)


def _box(subject: Subject, poses: Sequence[Pose2]) -> tuple[float, float, float, float]:
    """A box around the sensors and most returns under all poses, metres in frame 1; never empty."""
    first, second = subject.points
    sensors = np.array([(0.0, 0.0), *((T.x, T.y) for T in poses)])
    held = np.concatenate([sensors, first, *(T @ second for T in poses)])
    low, high = np.percentile(held, (FEW, 100.0 - FEW), axis=0)
    (x1, y1) = np.minimum(low, sensors.min(axis=0)) - PADDING
    (x2, y2) = np.maximum(high, sensors.max(axis=0)) + PADDING
    return float(x1), float(y1), float(x2), float(y2)


# --- markup ---------------------------------------------------------------------------------------


def _opening(title: str, size: tuple[float, float]) -> str:
    width, height = size
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}"'
        f' viewBox="0 0 {width:.0f} {height:.0f}" font-family="sans-serif" font-size="12.5">\n'
        f'<title>{escape(title)}</title>\n<rect width="100%" height="100%" fill="#ffffff"/>'
    )


def _defs(subject: Subject, scale: float) -> Iterator[str]:
    """Both scans once, each in its own frame; panels use them."""
    yield "<defs>"
    for name, colour, points, walls in zip(("one", "two"), (FIRST, SECOND), subject.points, subject.maps, strict=True):
        yield f'<g id="{name}" fill="none" stroke="{colour}" stroke-linecap="round">'
        yield _dots(points, DOT / scale, 'stroke-opacity="0.55"')
        lines = "".join(f"M{x1:.2f} {y1:.2f}L{x2:.2f} {y2:.2f}" for x1, y1, x2, y2 in walls.coordinates.tolist())
        yield f'<path d="{lines}" stroke-width="{PEN / scale:.4f}"/>'
        reach, side = ARROW / scale, 0.35 * ARROW / scale
        arrow = f"M0 {side:.3f}L{reach:.3f} 0L0 {-side:.3f}Z"
        yield f'<path d="{arrow}" fill="{colour}" stroke="none"/></g>'
    yield "</defs>"


def _dots(points: FloatArray, size: float, more: str = "") -> str:
    moves = "".join(f"M{x:.2f} {y:.2f}h0" for x, y in points.tolist())
    return f'<path d="{moves}" stroke-width="{size:.4f}" {more}/>'


def _panel(
    subject: Subject,
    panel: _Panel,
    place: tuple[float, float],
    box: tuple[float, float, float, float],
    scale: float,
) -> str:
    left, top = place
    height = scale * (box[3] - box[1])
    window = f'<svg x="{left:.1f}" y="{top:.1f}" width="{WIDTH}" height="{height:.1f}" overflow="hidden">'
    frame = '<rect width="100%" height="100%" fill="none" stroke="#9ca3af"/>'
    view = f"translate({-scale * box[0]:.3f} {scale * box[3]:.3f}) scale({scale:.5f} {-scale:.5f})"
    parts = [window, frame, f'<g class="panel" transform="{view}">', '<use href="#one"/>']
    parts += [f'<use href="#two" transform="{_matrix(panel.T_1_2)}"/>', *_doubts(subject, panel.T_1_2, scale)]
    return "\n".join((*parts, "</g></svg>", *_text(panel.caption, left, top + height + 3.0)))


def _matrix(T: Pose2) -> str:
    cosine, sine = math.cos(T.theta), math.sin(T.theta)
    return f"matrix({cosine:.6f} {sine:.6f} {-sine:.6f} {cosine:.6f} {T.x:.4f} {T.y:.4f})"


def _doubts(subject: Subject, T_1_2: Pose2, scale: float) -> Iterator[str]:
    """The returns that speak against a pose."""
    if subject.sights is None:
        return
    seen_1, seen_2 = subject.sights
    found = classes(seen_1, seen_2, T_1_2, subject.parameters)
    points = np.concatenate([seen_1.points[:, :2], T_1_2 @ seen_2.points[:, :2]])
    for kind, colour in ((SHADOWED, BEHIND), (CONTRADICTED, AGAINST)):
        chosen = points[np.concatenate(found) == kind]
        yield _dots(chosen, 1.8 * DOT / scale, f'fill="none" stroke="{colour}" stroke-linecap="round"')


def _text(lines: Iterable[str], x: float, y: float) -> Iterator[str]:
    for number, line in enumerate(lines, start=1):
        yield f'<text x="{x:.1f}" y="{y + number * LINE:.1f}" fill="{INK}">{escape(line)}</text>'


# --- all of them ----------------------------------------------------------------------------------


def index_page(pictures: Sequence[tuple[str, str]]) -> str:
    """A page with all pictures: (file name, what it shows) each."""
    shown = (
        f'<figure><figcaption>{escape(told)}</figcaption><img src="{escape(name)}" alt="{escape(told)}"></figure>'
        for name, told in pictures
    )
    legend = (
        f'<b style="color:{FIRST}">scan 1</b>, <b style="color:{SECOND}">scan 2</b>, '
        f'<b style="color:{AGAINST}">seen through</b>, <b style="color:{BEHIND}">close behind a surface</b>'
    )
    head = '<!doctype html><html lang="en"><meta charset="utf-8"><title>Pairs that failed</title>'
    style = "<style>body{font-family:sans-serif;margin:2rem}img{max-width:100%}figure{margin:2rem 0}</style>"
    return "\n".join((head, style, f"<h1>{len(pictures)} pairs that failed</h1><p>{legend}</p>", *shown, "</html>\n"))
