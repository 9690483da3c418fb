"""One origin: the scene's viser server behind our own address.

    GET  /views/{view}/scene/     viser's page, with our policy and our script
    GET  /views/{view}/scene/...  whatever else it asks for
    WS   /views/{view}/scene      its socket: the page drops the last slash
    /follow/{token}/scene...      the same of the scene that only shows what the view shows

viser itself knows no origins: what a foreign page must not do is stopped here.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import httpx
from fastapi import APIRouter, Request, Response, WebSocket
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection
from starlette.websockets import WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.typing import Subprotocol

from app.dressing import SCRIPT, STYLE
from app.errors import RequestError, UnknownError
from app.routes.common import Site
from app.security import own_origin

if TYPE_CHECKING:
    from app.scene import Scene

__all__ = ["POLICY", "router"]

HOST = "127.0.0.1"
QUERY = frozenset({"darkMode", "fixedDpr"})
"""what may stand in the page's address; viser would also take another server to obey from there"""
POLICY = (
    "default-src 'none'; connect-src 'self' blob: data:; script-src 'self' 'unsafe-inline' 'unsafe-eval' "
    "'wasm-unsafe-eval' blob:; worker-src blob:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""viser needs inline and evaluated scripts; nothing is loaded from, or sent to, another origin"""
router = APIRouter(include_in_schema=False)
STEER, FOLLOW = "/views/{view}/scene", "/follow/{view}/scene"
"""of who may steer the view, and of who may only look; each is known by a name of its own"""


def _scene_of(site: Site, request: HTTPConnection, view: str) -> Scene:
    """The scene that belongs to an address. Raises UnknownError where there is none (any more)."""
    if request.url.path.startswith("/follow/"):
        return site.views.audience_of(view)
    return site.views.get(view).scene


@router.get(STEER + "/")
@router.get(FOLLOW + "/")
async def page(site: Site, view: str, request: Request) -> Response:
    """viser's page.

    Raises:
        RequestError: the address would make the page do something else than show this view.
    """
    foreign = sorted(set(request.query_params) - QUERY)
    if foreign:
        raise RequestError(
            f"The scene takes no {foreign[0][:40]!r} in its address; it takes {', '.join(sorted(QUERY))}."
        )
    html = await _page((await run_in_threadpool(_scene_of, site, request, view)).port)
    return Response(html, media_type="text/html", headers={"Content-Security-Policy": POLICY})


@router.get(STEER + "/{path:path}")
@router.get(FOLLOW + "/{path:path}")
async def asset(site: Site, view: str, path: str, request: Request) -> Response:
    """Anything else of viser's page."""
    scene = await run_in_threadpool(_scene_of, site, request, view)
    answer = await _fetch(scene.port, "/" + quote(path))
    kind = answer.headers.get("content-type")
    return Response(answer.content, answer.status_code, media_type=kind, headers={"Content-Security-Policy": POLICY})


@router.websocket(STEER)
@router.websocket(FOLLOW)
async def socket(site: Site, view: str, browser: WebSocket) -> None:
    """viser's socket, for pages of our own origin; the view stays open as long as it is."""
    if not own_origin(browser.headers):
        await browser.close(1008)
        return
    try:
        with site.views.watched(view):
            await _bridge(browser, await run_in_threadpool(_scene_of, site, browser, view))
    except UnknownError:
        with suppress(OSError):  # whoever asked may be gone, too
            await browser.close(1008)


async def _fetch(port: int, path: str) -> httpx.Response:
    """A file of a viser server.

    Raises:
        UnknownError: it does not answer.
    """
    try:
        async with httpx.AsyncClient(trust_env=False, verify=False) as client:
            return await client.get(f"http://{HOST}:{port}{path}")
    except httpx.HTTPError:
        raise UnknownError("The scene of this view is closed: load the page again.") from None


_pages: dict[str, bytes] = {}
"""viser's page with our script, fetched once: that of every view is the same"""


async def _page(port: int) -> bytes:
    """The page with our script and our colours as the first things in its head."""
    if "/" not in _pages:
        before, head, after = (await _fetch(port, "/")).content.partition(b"<head>")
        _pages["/"] = before + head + SCRIPT + STYLE + after
    return _pages["/"]


async def _bridge(browser: WebSocket, scene: Scene) -> None:
    """Pass messages both ways until either side goes."""
    offered = [Subprotocol(name) for name in browser.scope.get("subprotocols", ())]
    try:
        async with connect(
            f"ws://{HOST}:{scene.port}",
            subprotocols=offered or None,
            additional_headers=scene.headers,
            compression=None,
            max_size=None,
            proxy=None,
        ) as viser:
            await browser.accept(viser.subprotocol)
            await _first_of(_outwards(browser, viser), _inwards(viser, browser))
    except (OSError, TimeoutError, WebSocketException):
        pass  # viser is gone, or would not have us: the browser is told below
    if browser.client_state is not WebSocketState.DISCONNECTED:
        await browser.close(1001)


async def _first_of(*works: Coroutine[Any, Any, None]) -> None:
    """Do several things until one of them is done; stop the others then."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _outwards(browser: WebSocket, viser: ClientConnection) -> None:
    try:
        while (message := await browser.receive())["type"] == "websocket.receive":
            held = message.get("bytes")
            await viser.send(message["text"] if held is None else held)
    except (ConnectionClosed, WebSocketDisconnect):
        pass


async def _inwards(viser: ClientConnection, browser: WebSocket) -> None:
    try:
        async for message in viser:
            if isinstance(message, str):
                await browser.send_text(message)
            else:
                await browser.send_bytes(message)
    except (ConnectionClosed, WebSocketDisconnect, RuntimeError):
        pass  # RuntimeError: the browser went while something was on its way
