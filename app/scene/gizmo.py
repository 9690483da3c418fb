"""The handle by which the second map is dragged: a gizmo at the second sensor, in the plane."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import viser

from app.drawing import Picture
from app.workbench import View
from segmap.pose import Pose2

__all__ = ["Gizmo"]

Do = Callable[[Callable[[], None]], None]
NAME = "/hand"
PIXELS = 90.0
"""size of the gizmo on the screen"""


class Gizmo:
    """Shown while a view is being nudged; what it says is done in a thread of its own, and only the newest counts.

    viser tells of every movement on its event loop, which must not wait for a view.
    """

    def __init__(self, scene: viser.SceneApi, view: View, do: Do) -> None:
        self._view, self._do = view, do
        self._handle = scene.add_transform_controls(
            NAME, scale=PIXELS, fixed=True, active_axes=(True, True, False), depth_test=False, visible=False
        )
        self._handle.on_update(self._moved)
        self._news, self._dragging = threading.Condition(), False
        self._pose: Pose2 | None = None
        self._released = self._closed = False
        self._thread = threading.Thread(target=self._follow, name="hand", daemon=True)
        self._thread.start()

    def show(self, picture: Picture, shown: bool) -> None:
        """Stand where the second map stands, unless it is in somebody's hand."""
        if self._handle.visible != shown:
            self._handle.visible = shown
        if not self._dragging and shown:
            T_1_2 = picture.T_1_2
            self._handle.position = (T_1_2.x, T_1_2.y, 0.0)
            self._handle.wxyz = (math.cos(T_1_2.theta / 2.0), 0.0, 0.0, math.sin(T_1_2.theta / 2.0))

    def close(self, seconds: float) -> None:
        """Stop; at most so long is waited for what is being done."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join(seconds)

    async def _moved(self, event: viser.TransformControlsEvent) -> None:
        (w, _, _, z), (x, y, _) = event.target.wxyz, event.target.position
        with self._news:
            self._dragging = event.phase != "end"
            self._pose = Pose2(float(x), float(y), 2.0 * math.atan2(float(z), float(w)))
            self._released = self._released or event.phase == "end"
            self._news.notify()

    def _follow(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._pose is not None or self._closed)
                if self._closed:
                    return
                pose, released = self._pose, self._released
                self._pose, self._released = None, False
            assert pose is not None
            self._do(lambda pose=pose, released=released: self._hold(pose, released))  # type: ignore[misc]

    def _hold(self, pose: Pose2, released: bool) -> None:
        self._view.hold(pose)
        if released:
            self._view.let_go()
