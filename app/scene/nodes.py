"""Drawables -> nodes of a viser scene, changed in place.

Lines are as wide as told on the screen, whatever the zoom. Points are very short lines, so that they
are too. Depths become heights: much in 2D, where the camera looks straight down from far away, and
little in 3D.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import viser

from app.drawables import Array32, Drawable
from app.drawing import Picture
from segmap.pose import Pose2

__all__ = ["Nodes"]

Handle: TypeAlias = viser.LineSegmentsHandle | viser.LabelHandle
STEP = {2: 0.02, 3: 0.002}
"""metres between two depths, by dimension"""
DOT = 1e-3
"""metres, the length of the line a point is drawn as"""


class Nodes:
    """The nodes of one scene; :meth:`show` makes them those of a picture."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._held: dict[str, tuple[Drawable, Handle]] = {}
        self._step = 0.0
        scene.world_axes.visible = False
        self._frames = {name: scene.add_frame(f"/{name}", show_axes=False) for name in ("first", "second", "map")}

    def show(self, picture: Picture) -> None:
        """Draw a picture: move the second map, change what differs, hide what is not in it."""
        self._step = STEP[picture.dimension]
        self._move(picture.T_1_2)
        wanted = {drawable.path: drawable for drawable in picture.drawables}
        for path, (_, handle) in self._held.items():
            if path not in wanted and handle.visible:
                handle.visible = False
        for path, drawable in wanted.items():
            self._draw(path, drawable)

    def _move(self, T_1_2: Pose2) -> None:
        frame = self._frames["second"]
        wxyz = (math.cos(T_1_2.theta / 2.0), 0.0, 0.0, math.sin(T_1_2.theta / 2.0))
        if not np.array_equal(frame.wxyz, wxyz):
            frame.wxyz = wxyz
        if not np.array_equal(frame.position, (T_1_2.x, T_1_2.y, 0.0)):
            frame.position = (T_1_2.x, T_1_2.y, 0.0)

    def _draw(self, path: str, drawable: Drawable) -> None:
        held = self._held.get(path)
        if held is None:
            handle = self._add(path, drawable)
        else:
            handle = held[1]
            if isinstance(handle, viser.LabelHandle):
                _change_label(handle, held[0], drawable)
            else:
                _change_lines(handle, held[0], drawable)
            if not handle.visible:
                handle.visible = True
        self._place(handle, drawable)
        self._held[path] = (drawable, handle)

    def _add(self, path: str, drawable: Drawable) -> Handle:
        if drawable.kind == "label":
            return self._scene.add_label(path, drawable.text, anchor=drawable.anchor, font_screen_scale=0.9)
        return self._scene.add_line_segments(
            path, _vertices(drawable), _colours(drawable), thickness=drawable.thickness, thickness_units="screen"
        )

    def _place(self, handle: Handle, drawable: Drawable) -> None:
        """At the height of its depth; a label also at its own place."""
        x, y, z = drawable.points if drawable.kind == "label" else (0.0, 0.0, 0.0)
        position = (float(x), float(y), float(z) + drawable.depth * self._step)
        if not np.array_equal(handle.position, position):
            handle.position = position


def _change_label(handle: viser.LabelHandle, old: Drawable, new: Drawable) -> None:
    if old.text != new.text:
        handle.text = new.text


def _change_lines(handle: viser.LineSegmentsHandle, old: Drawable, new: Drawable) -> None:
    moved, coloured = not _same(old.points, new.points), not _same_colours(old, new)
    if moved:
        handle.points = _vertices(new)
    if coloured:
        handle.colors = _colours(new)
    if old.thickness != new.thickness:
        handle.thickness = new.thickness


def _vertices(drawable: Drawable) -> Array32:
    if drawable.kind == "lines":
        return drawable.points
    shift = np.array([DOT / 2.0, 0.0, 0.0], np.float32)
    return np.stack((drawable.points - shift, drawable.points + shift), axis=1)


def _colours(drawable: Drawable) -> Any:
    """One colour, or one for each vertex: those the browser takes as linear."""
    if drawable.colours is None:
        return np.array(drawable.colour, np.uint8)
    linear = _linear(drawable.colours)
    return np.repeat(linear[:, None, :], 2, axis=1)


def _linear(colours: np.ndarray[Any, np.dtype[np.uint8]]) -> np.ndarray[Any, np.dtype[np.uint8]]:
    share = colours / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)


def _same(a: Any, b: Any) -> bool:
    return a is b or np.array_equal(a, b)


def _same_colours(old: Drawable, new: Drawable) -> bool:
    if (old.colours is None) != (new.colours is None):
        return False
    return old.colour == new.colour if new.colours is None else _same(old.colours, new.colours)
