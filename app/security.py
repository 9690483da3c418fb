"""What every request must pass, and what every answer carries.

- The Host must be a name of this machine's loopback or the address bound: a foreign name that was
  made to point here (DNS rebinding) is refused.
- The Origin of everything that can change something, and of every websocket, must be our own; what only reads is
  answered to our own pages and to whoever opens an address, not to pages of others that embed it.
- Where other computers reach the server, the token of the link it printed (:mod:`app.access`).
- Bodies are bounded in size and time (:mod:`app.incoming`).
- Pages may load nothing from elsewhere, run nothing inline, and be framed by nobody else.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.access import Access
from app.incoming import CLOSE, MEBIBYTE, bounded, too_large

__all__ = ["CONTENT_SECURITY_POLICY", "UPLOAD_BYTES", "Guard", "allowed_host", "own_origin"]

UPLOAD_BYTES = 256 * MEBIBYTE
BODY_BYTES = MEBIBYTE
LOOPBACK = ("localhost", "127.0.0.1", "::1")
WILDCARDS = ("0.0.0.0", "::", "")
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'self'"
)
HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


class Guard:
    """ASGI middleware: refuses foreign requests, bounds bodies, adds the headers an answer does not set itself.

    ``bound`` is the address the server listens at; ``token`` what it asks for, None: nothing.
    """

    def __init__(
        self, app: ASGIApp, bound: str = "127.0.0.1", upload_bytes: int = UPLOAD_BYTES, token: str | None = None
    ) -> None:
        self._app, self._bound, self._upload_bytes = app, bound, upload_bytes
        self._access = Access(token)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope, Headers(scope=scope))
        if refusal is not None and scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        elif refusal is not None:
            await refusal(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await self._app(scope, receive, send)
        else:
            limit = self._limit(Headers(scope=scope))
            await self._app(scope, bounded(receive, limit), _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        if not allowed_host(headers.get("host"), self._bound):
            return _refused(403, "ForbiddenHost", "This address is not one the server answers to.")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        if (changes or "origin" in headers) and not own_origin(headers):
            return _refused(403, "ForbiddenOrigin", "Requests from pages of another origin are refused.")
        if not changes and not (_own_site(headers) or _opens_a_page(headers)):
            return _refused(403, "ForbiddenOrigin", "Pages of another origin may embed nothing from here.")
        if (answer := self._access.refusal(scope, headers)) is not None:
            return answer
        if _declared_length(headers) > self._limit(headers):
            return _refused(413, "TooLarge", too_large(self._limit(headers)))
        return None

    def _limit(self, headers: Headers) -> int:
        upload = headers.get("content-type", "").lower().startswith("multipart/form-data")
        return self._upload_bytes if upload else BODY_BYTES


def allowed_host(host: str | None, bound: str) -> bool:
    """Whether a Host header names this server: loopback, or the address it is bound to.

    A server bound to all addresses answers to any address given in numbers: only names can be rebound.

    >>> allowed_host("localhost:8000", "127.0.0.1"), allowed_host("rebound.example", "127.0.0.1")
    (True, False)
    """
    name = _host_name(host or "")
    if name in LOOPBACK or name == bound.lower():
        return name not in WILDCARDS
    return bound in WILDCARDS and _is_address(name)


def own_origin(headers: Headers) -> bool:
    """Whether the Origin, if there is one, is that of the page's own address (the Host)."""
    origin = headers.get("origin")
    if origin is None:
        return _own_site(headers)
    scheme, _, authority = origin.partition("://")
    return scheme in ("http", "https") and authority.lower() == headers.get("host", "").lower()


def _own_site(headers: Headers) -> bool:
    """Whether a browser says that our own page, or nobody's, made the request; older ones say nothing."""
    return headers.get("sec-fetch-site", "none") in ("same-origin", "none")


def _opens_a_page(headers: Headers) -> bool:
    """Whether somebody follows a link to here in a window of its own."""
    return headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"


def _host_name(host: str) -> str:
    """The name or address of ``name:port`` or ``[address]:port``."""
    name = host.strip().lower()
    if name.startswith("["):
        return name[1:].partition("]")[0]
    return name.partition(":")[0]


def _is_address(name: str) -> bool:
    try:
        return not ipaddress.ip_address(name).is_unspecified
    except ValueError:
        return False


def _declared_length(headers: Headers) -> int:
    text = headers.get("content-length", "0")
    return int(text) if text.isdecimal() else 0


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _missing(headers, HEADERS.items()):
                headers[name] = value
        await send(message)

    return sending


def _missing(headers: MutableHeaders, wanted: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    return [(name, value) for name, value in wanted if name not in headers]


def _refused(status: int, kind: str, message: str) -> JSONResponse:
    return JSONResponse({"error": {"message": message, "kind": kind}}, status, CLOSE)
