"""What a walkthrough is made of: stages, their steps, and the pictures of the steps as plain data.

A picture is a list of shapes in frame 1, metres. Each has a *role*, which says what it stands for and leaves the
colours to whoever draws: ``first``, ``second``, ``accent`` (look here), ``good``, ``bad``, ``new``, ``faint``,
``text``, ``chain-0`` ... ``chain-7``, and the classes of lines of sight. What many steps show, such as the two maps,
is named once in the walkthrough's ``base`` and only referred to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from segmap.pose import Pose2

__all__ = [
    "CHAINS",
    "Box",
    "Line",
    "Mark",
    "Quantity",
    "Shape",
    "Stage",
    "Step",
    "Walkthrough",
    "around",
    "degrees",
    "lines",
    "metres",
    "of",
    "path",
    "points",
    "rounded",
    "text",
]

Shape: TypeAlias = dict[str, Any]
"""``kind`` (lines, points, path, text), ``role``, and either ``of`` (a name of the base, with ``rows`` where only some
are meant, and ``pose`` [x, y, theta] where they are moved) or ``at`` (coordinates)"""
Box: TypeAlias = tuple[float, float, float, float]
"""x and y from, x and y to, metres"""
Quantity: TypeAlias = tuple[str, str, str]
"""name, number as text, unit"""
PLACES = 4
"""decimals of coordinates in pictures: a tenth of a millimetre"""
CHAINS = 8
"""colours for chains before they come again"""


@dataclass(frozen=True)
class Line:
    """A numbered line of an algorithm, in our own words."""

    number: str
    text: str
    indent: int = 0


@dataclass(frozen=True)
class Mark:
    """A step worth jumping to."""

    index: int
    label: str


@dataclass(frozen=True)
class Step:
    """One step: which line it executes, what to look at, the quantities of that line, and the picture."""

    line: str
    say: str
    shapes: tuple[Shape, ...] = ()
    quantities: tuple[Quantity, ...] = ()
    box: Box | None = None
    """where to look; None: the stage's box"""
    at: tuple[float, float] | None = None
    """the point of this step on the stage's chart"""
    chart: dict[str, Any] | None = None
    """a chart of this step's own"""
    enter: dict[str, Any] | None = None
    """a walkthrough or a stage that goes into this step: ``label``, and ``stage`` or ``node``"""

    def to_json(self) -> dict[str, Any]:
        """This step as plain data."""
        told: dict[str, Any] = {"line": self.line, "say": self.say, "shapes": list(self.shapes)}
        told["quantities"] = [list(one) for one in self.quantities]
        extra: dict[str, Any] = {"chart": self.chart, "enter": self.enter}
        extra |= {"box": self.box and list(self.box), "at": self.at and list(self.at)}
        return {**told, **{name: one for name, one in extra.items() if one is not None}}


@dataclass(frozen=True, eq=False)
class Stage:
    """A part of a walkthrough. ``step(k)`` gives any of its ``count`` steps, in any order, always the same."""

    id: str
    title: str
    about: str
    """what happens in it, in a sentence or two"""
    algorithm: str
    """a key of :data:`segmap.walkthrough.lines.ALGORITHMS`"""
    count: int
    step: Callable[[int], Step]
    marks: tuple[Mark, ...] = ()
    stops: Sequence[int] = ()
    """where playing stops over when there are too many steps to show each; none: at every step"""
    box: Box | None = None
    chart: dict[str, Any] | None = None
    figure: str = ""
    """the figure of the paper that is drawn here on these data"""

    def to_json(self) -> dict[str, Any]:
        """What is known of it without any of its steps."""
        return {
            "id": self.id,
            "title": self.title,
            "about": self.about,
            "algorithm": self.algorithm,
            "count": self.count,
            "marks": [[mark.index, mark.label] for mark in self.marks],
            "stops": list(self.stops),
            "box": self.box and list(self.box),
            "chart": self.chart,
            "figure": self.figure,
        }


@dataclass(frozen=True, eq=False)
class Walkthrough:
    """A run, as stages of steps."""

    title: str
    stages: tuple[Stage, ...]
    base: dict[str, list[list[float]]]
    """segments (x1, y1, x2, y2) and points (x, y) by name, metres"""
    more: Callable[[str], Stage | None] = field(default=lambda _: None)
    """stages that are made when somebody enters them, by id"""

    def stage(self, id: str) -> Stage | None:
        """A stage by its id; None where there is none."""
        return next((stage for stage in self.stages if stage.id == id), None) or self.more(id)


# --- shapes and numbers -----------------------------------------------------------------------------


def rounded(array: ArrayLike) -> list[Any]:
    """Coordinates as pictures hold them."""
    held: list[Any] = (np.round(np.asarray(array, dtype=np.float64), PLACES) + 0.0).tolist()
    return held


def of(name: str, role: str, rows: Iterable[int] | None = None, pose: Pose2 | None = None, **more: Any) -> Shape:
    """Something of the base, or some of its rows, where it is or moved."""
    shape: Shape = {"kind": "lines", "of": name, "role": role, **more}
    if rows is not None:
        shape["rows"] = [int(row) for row in rows]
    if pose is not None:
        shape["pose"] = [round(pose.x, 6), round(pose.y, 6), round(pose.theta, 8)]
    return shape


def lines(coordinates: ArrayLike, role: str, **more: Any) -> Shape:
    """Segments, rows x1, y1, x2, y2."""
    return {"kind": "lines", "at": rounded(np.reshape(coordinates, (-1, 4))), "role": role, **more}


def points(coordinates: ArrayLike, role: str, **more: Any) -> Shape:
    """Points, rows x, y."""
    return {"kind": "points", "at": rounded(np.reshape(coordinates, (-1, 2))), "role": role, **more}


def path(coordinates: ArrayLike, role: str, **more: Any) -> Shape:
    """A polyline through points, rows x, y."""
    return {"kind": "path", "at": rounded(np.reshape(coordinates, (-1, 2))), "role": role, **more}


def text(at: ArrayLike, words: str, role: str = "text") -> Shape:
    """A word at a point."""
    return {"kind": "text", "at": rounded(at), "text": words, "role": role}


def metres(name: str, value: float, digits: int = 3) -> Quantity:
    """A length."""
    return name, f"{value:.{digits}f}", "m"


def degrees(name: str, radians: float) -> Quantity:
    """An angle, in degrees."""
    return name, f"{math.degrees(radians):.1f}", "°"


def around(*parts: ArrayLike, margin: float = 0.08, least: float = 0.5) -> Box | None:
    """The box around points (..., 2) or segments (..., 4), with a margin; None where there are none."""
    held = [np.asarray(part, dtype=np.float64).reshape(-1, 2) for part in parts if np.size(part)]
    if not held:
        return None
    together = np.concatenate(held)
    low, high = together.min(axis=0), together.max(axis=0)
    pad = max(least, margin * float((high - low).max()))
    x1, y1, x2, y2 = (float(one) for one in (*(low - pad), *(high + pad)))
    return round(x1, 3), round(y1, 3), round(x2, 3), round(y2, 3)
