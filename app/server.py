"""The server: everything wired together, and started."""

from __future__ import annotations

import asyncio
import gc
import logging
import socket
import sys
import threading
import webbrowser
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import uvicorn
from fastapi import FastAPI
from rich.console import Console
from rich.text import Text
from starlette.concurrency import run_in_threadpool

from app import proxy
from app.access import PARAMETER, token_for
from app.errors import RequestError
from app.failures import answer_failures
from app.jobs import WarmUp
from app.resources import program_version
from app.routes import classes, files, follow, keeping, loops, pages, projects, review, stream, views, walks
from app.schemas import Failure
from app.security import UPLOAD_BYTES, WILDCARDS, Guard
from app.services import Services
from app.views import Views
from app.workspace import Workspace

__all__ = ["create_app", "reached_at", "serve"]

log = logging.getLogger(__name__)
HOST = "127.0.0.1"
PORT = 8000
NEXT_PORTS = 20
TEND_SECONDS = 2.0
GRACE_SECONDS = 3
KEEP_ALIVE_SECONDS = 75
"""that a connection stays open for a browser's next request"""
TURN_SECONDS = 0.001
"""that a thread holds the interpreter while others wait: a request lets it go and waits for its turn many times"""
SOCKET_BYTES = 64 * 1024 * 1024
ROUTERS = (
    pages.router,
    files.router,
    projects.router,
    keeping.router,
    review.router,
    loops.router,
    stream.router,
    views.router,
    follow.router,
    walks.router,
    classes.router,
    proxy.router,
)


def create_app(
    workspace: Workspace | Path | None = None,
    *,
    open_views: Views | None = None,
    warm_up: WarmUp | None = None,
    bound: str = HOST,
    upload_bytes: int = UPLOAD_BYTES,
    token: str | None = None,
) -> FastAPI:
    """The workbench on a folder of projects.

    ``bound`` is the address it listens at; any but loopback asks for ``token``, one of its own where none is given
    (``app.state.token``). ``warm_up`` compiles the kernels ahead, None: when needed.
    """
    token = token or token_for(bound)
    if not isinstance(workspace, Workspace):
        workspace = Workspace(workspace, warm_up=warm_up)
    services = Services(workspace, open_views or Views(), warm_up=warm_up)
    app = FastAPI(
        title="segmap",
        version=program_version(),
        lifespan=_lifespan,
        docs_url=None,  # its page would be loaded from elsewhere
        redoc_url=None,
        openapi_url="/api/openapi.json",
        responses={"4XX": {"model": Failure}},
    )
    app.state.services, app.state.token = services, token
    for router in ROUTERS:
        app.include_router(router)
    answer_failures(app)
    app.add_middleware(Guard, bound=bound, upload_bytes=upload_bytes, token=token)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    services: Services = app.state.services
    services.start()
    tending = asyncio.create_task(_tend(services))
    try:
        yield
    finally:
        tending.cancel()
        services.streams.close()
        await run_in_threadpool(services.close)


async def _tend(services: Services) -> None:
    while True:
        await asyncio.sleep(TEND_SECONDS)
        try:
            await run_in_threadpool(services.tend)
        except Exception:
            log.exception("Open projects could not be looked after.")


# --- serving --------------------------------------------------------------------------------------


def serve(
    files: Iterable[Path] = (),
    host: str = HOST,
    port: int | None = None,
    workspace: Path | None = None,
    open_browser: bool = False,
) -> None:
    """Serve the workbench until it is interrupted, with a project of ``files`` where some are given.

    ``port`` None: 8000, or the next one that is free. ``workspace``: the folder of projects.

    Raises:
        SegmapError: a file cannot be read, or the address cannot be used; nothing was started.
    """
    warm_up = WarmUp()
    projects_of = Workspace(workspace, warm_up=warm_up)
    paths = list(files)
    path = f"/projects/{projects_of.open_files(paths)}" if paths else "/"
    listening = _listen(host, port)
    app = create_app(projects_of, warm_up=warm_up, bound=host)
    link = path if app.state.token is None else f"{path}?{PARAMETER}={app.state.token}"
    urls = [f"http://{_authority(name, listening)}{link}" for name in reached_at(host)]
    _Server(app, listening, urls, open_browser).run_until_stopped()


class _Server(uvicorn.Server):
    """uvicorn that says where it is once it is there, and ends event streams before it waits for pages to go."""

    def __init__(self, app: FastAPI, listening: socket.socket, urls: Sequence[str], open_browser: bool) -> None:
        super().__init__(_config(app))
        self._app, self._listening, self._urls, self._open_browser = app, listening, urls, open_browser

    def run_until_stopped(self) -> None:
        """Serve; Ctrl+C ends it."""
        sys.setswitchinterval(TURN_SECONDS)
        with suppress(KeyboardInterrupt):
            self.run(sockets=[self._listening])
        gc.freeze()  # the interpreter's last collections would take seconds, and free what goes anyway

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        console = Console(stderr=True, soft_wrap=True)
        here, *elsewhere = self._urls
        console.print(Text.assemble("segmap is at ", (here, "bold"), "  (Ctrl+C ends it)"))
        for url in elsewhere:
            console.print(Text.assemble("from other computers at ", (url, "bold")))
        if self._app.state.token is not None:
            console.print("Whoever has the link may read and change all projects here.")
        if self._open_browser:
            threading.Thread(target=webbrowser.open, args=(here,), daemon=True).start()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._app.state.services.streams.close()
        await super().shutdown(sockets)


def _config(app: FastAPI) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        server_header=False,
        ws_max_size=SOCKET_BYTES,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=GRACE_SECONDS,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
    )


def _listen(host: str, port: int | None) -> socket.socket:
    """A socket that listens at the port, or, where none was asked for, at the first free one.

    Raises:
        RequestError: there is no such address, or the port is taken.
    """
    for wanted in (port,) if port is not None else (*range(PORT, PORT + NEXT_PORTS), 0):
        try:
            listening = _bind(host, wanted)
        except OSError as error:
            failure = error
        else:
            if port is None and wanted != PORT:
                print(f"segmap: port {PORT} is taken, so another one is used.", file=sys.stderr)
            return listening
    reason = (failure.strerror or str(failure)).lower()
    raise RequestError(
        f"{host}, port {port if port is not None else PORT}, cannot be used: {reason}. Try another --port."
    )


def _bind(host: str, port: int) -> socket.socket:
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    listening = socket.socket(family, kind, protocol)
    try:
        if sys.platform != "win32":  # there it would let two servers share a port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
    except BaseException:
        listening.close()
        raise
    return listening


def reached_at(host: str) -> list[str]:
    """The addresses to give people: of a server on all of them, this computer's to itself and to others."""
    if host not in WILDCARDS:
        return [host]
    here, foreign, family = ("::1", "2001:db8::1", socket.AF_INET6) if host == "::" else _IPV4
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((foreign, 9))  # sends nothing: the system only says which address it would send from
        return list(dict.fromkeys((here, probe.getsockname()[0])))
    return [here]


_IPV4 = "127.0.0.1", "192.0.2.1", socket.AF_INET


def _authority(host: str, listening: socket.socket) -> str:
    """Host and port as they stand in an address."""
    port = listening.getsockname()[1]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
