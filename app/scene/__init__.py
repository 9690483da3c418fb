"""One view on the screen: a viser server of its own, kept in step with the view.

The scene owns no truth. It redraws in a thread of its own, so whoever changed the view waits for
nothing, and several changes in a row are drawn once.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

import viser

from app.content import Content
from app.drawing import draw
from app.motion import FRAME_SECONDS, on_the_way
from app.palette import PALETTES
from app.scene.camera import Cameras, reach
from app.scene.gizmo import Gizmo
from app.scene.nodes import Nodes
from app.scene.panel import Onlookers, Panel
from app.scene.server import PASS_HEADER, QuietServer
from app.workbench import View
from segmap.errors import SegmapError

__all__ = ["Scene"]

CLOSE_SECONDS = 5.0
log = logging.getLogger(__name__)


class Scene:
    """The scene of a view, on a loopback port; close it before the view.

    That of an ``audience`` shows what the view shows, and nobody who looks at it can change anything.
    """

    def __init__(self, view: View, *, audience: bool = False) -> None:
        self._view = view
        self._server = QuietServer()
        self._theme = ""
        self._content: Content | None = None
        self._doing = threading.Lock()
        self._stale, self._closed = threading.Event(), False
        self._nodes = Nodes(self._server.scene)
        self._cameras = Cameras(self._server)
        self._panel = Onlookers(self._server.gui) if audience else Panel(self._server.gui, view, self._do)
        self._gizmo = None if audience else Gizmo(self._server.scene, view, self._do)
        self._draw()
        if not audience:
            self._server.scene.on_click()(self._clicked)
        self._server.on_client_connect(self._cameras.welcome)
        self._server.on_client_disconnect(self._cameras.forget)
        self._unsubscribe = view.subscribe(lambda _: self._stale.set())
        self._thread = threading.Thread(target=self._follow, name="scene", daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where it listens, on the loopback interface."""
        return self._server.get_port()

    @property
    def headers(self) -> dict[str, str]:
        """What a socket must bring to be let in."""
        return {PASS_HEADER: self._server.secret}

    def lead(self, audience: Scene) -> None:
        """Let another scene look where this one looks, from now on."""
        self._cameras.lead(audience._cameras)

    def close(self) -> None:
        """Stop serving; closing twice is harmless."""
        if not self._closed:
            self._closed = True
            self._unsubscribe()
            self._stale.set()
            self._thread.join(CLOSE_SECONDS)
            if self._gizmo is not None:
                self._gizmo.close(CLOSE_SECONDS)
            self._server.stop()

    # --- drawing ----------------------------------------------------------------------------------

    def _follow(self) -> None:
        while self._stale.wait() and not self._closed:
            self._stale.clear()
            try:
                self._draw()
            except Exception as error:
                self._fail(error)

    def _draw(self) -> None:
        before, self._content = self._content, self._view.content()
        content, snapshot, fits = self._content, self._view.snapshot(), self._view.looks.fits
        if before is not None:
            self._move(before, content)
        picture = draw(content)
        with self._server.atomic():
            self._dress(picture.theme)
            self._nodes.show(picture)
            self._panel.show(snapshot)
            if self._gizmo is not None:
                self._gizmo.show(picture, snapshot["nudging"])
        self._cameras.follow(picture, fits)

    def _move(self, before: Content, after: Content) -> None:
        """Show the map on its way from one state of the graph to the next, as long as nothing newer is to be shown."""
        for content in on_the_way(before, after, self._view.walls_of):
            if self._stale.is_set() or self._closed:
                return
            with self._server.atomic():
                self._nodes.show(draw(content))
            time.sleep(FRAME_SECONDS)

    def _dress(self, theme: str) -> None:
        if theme != self._theme:
            self._theme = theme
            self._server.gui.configure_theme(
                dark_mode=theme == "dark",
                show_logo=False,
                show_share_button=False,
                brand_color=PALETTES[theme].first,
            )

    # --- what people do ---------------------------------------------------------------------------

    def _do(self, action: Callable[[], None]) -> None:
        """Run an action, one at a time, and say what goes wrong where the person looks."""
        with self._doing:
            try:
                action()
            except Exception as error:
                self._fail(error)

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        self._do(lambda: self._pick(event))

    def _pick(self, event: viser.SceneClickEvent) -> None:
        (x, y, z), (dx, dy, dz) = event.ray_origin, event.ray_direction
        if abs(dz) > 1e-9:
            along = -z / dz
            self._view.pick(x + along * dx, y + along * dy, reach(event.client))

    def _fail(self, error: Exception) -> None:
        known = isinstance(error, SegmapError)
        if not known:
            log.error("The scene failed.", exc_info=error)
        text = str(error) if known else "Something went wrong here; the server's log says what. Try again."
        for client in self._server.get_clients().values():
            client.add_notification("That did not work", text, color="red", auto_close_seconds=8.0)
