"""Who may come in where others can reach the server: whoever brings the token of the link it printed.

    /projects/x?token=TOKEN    the link: the token goes into a cookie, and the page is loaded again without it
    Cookie: segmap-PORT=TOKEN  every request of that browser from then on, sockets included
    Authorization: Bearer TOKEN  programs

A server that only this computer can reach asks for nothing.
"""

from __future__ import annotations

import ipaddress
import os
import secrets
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection, cookie_parser
from starlette.responses import FileResponse, JSONResponse, RedirectResponse, Response
from starlette.types import Scope

from app.errors import RequestError
from app.incoming import CLOSE
from app.resources import static_folder

__all__ = ["PARAMETER", "VARIABLE", "Access", "is_loopback", "token_for"]

VARIABLE = "SEGMAP_TOKEN"
"""the environment variable that gives a token of one's own, the same after every start"""
PARAMETER = "token"
FOLLOWING = "/follow/"
"""where nothing is asked: who follows a view is known by the name in the address, and may only look"""
STYLES = ("base", "dialogs", "figures", "menus", "project", "walk")
SCRIPTS = ("api", "appearance", "dom", "follow", "format", "notices", "stream", "theme")
PLAYER = ("chart", "classes", "figure", "page", "player", "races")
FILES = frozenset(
    f"/static/{name}"
    for name in (
        *("favicon.svg", "icons.svg"),
        *(f"css/{name}.css" for name in STYLES),
        *(f"js/{name}.js" for name in SCRIPTS),
        *(f"js/walk/{name}.js" for name in PLAYER),
    )
)
"""what the pages of who follows a view, or a walkthrough, are made of"""
SHORTEST = 16
DAYS = 30
MISSING = "This server asks for the link that it printed when it was started: open that link, or ask who started it."


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches a server bound to this address.

    >>> is_loopback("localhost"), is_loopback("127.0.0.2"), is_loopback("0.0.0.0"), is_loopback("192.168.1.7")
    (True, True, False, False)
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def token_for(host: str) -> str | None:
    """What a server bound to this address asks for: nothing on loopback, else SEGMAP_TOKEN or a new token.

    Raises:
        RequestError: SEGMAP_TOKEN could be guessed, or cannot stand in a cookie.
    """
    if is_loopback(host):
        return None
    given = os.environ.get(VARIABLE, "")
    if not given:
        return secrets.token_urlsafe(24)
    if len(given) < SHORTEST or not all(c.isascii() and (c.isalnum() or c in "-_") for c in given):
        raise RequestError(f"{VARIABLE} must have at least {SHORTEST} letters, digits, - or _, and none else.")
    return given


class Access:
    """Asks every request for a token; None: for nothing."""

    def __init__(self, token: str | None) -> None:
        self._token = token

    def refusal(self, scope: Scope, headers: Headers) -> Response | None:
        """What to answer instead of the request: a redirection for who brings the link, 401 for who brings nothing."""
        if self._token is None or _is_open(scope["path"]) or self._admitted(headers):
            return None
        if scope["type"] == "http" and scope["method"] in ("GET", "HEAD") and self._is_token(_in_link(scope)):
            return self._welcome(scope, headers)
        if "text/html" in headers.get("accept", ""):
            return FileResponse(static_folder() / "refused.html", 401)
        return JSONResponse({"error": {"message": MISSING, "kind": "TokenMissing"}}, 401, CLOSE)

    def _admitted(self, headers: Headers) -> bool:
        scheme, _, brought = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return self._is_token(brought.strip())
        cookies = "; ".join(headers.getlist("cookie"))
        return self._is_token(cookie_parser(cookies).get(_cookie_name(headers), ""))

    def _is_token(self, text: str) -> bool:
        return self._token is not None and secrets.compare_digest(text.encode("utf-8", "replace"), self._token.encode())

    def _welcome(self, scope: Scope, headers: Headers) -> Response:
        """The same address without the token, which stays in a cookie that scripts cannot read."""
        rest = urlencode([(name, value) for name, value in _query(scope) if name != PARAMETER])
        path = "/" + scope["path"].lstrip("/\\")  # two slashes would lead to another server
        answer = RedirectResponse(path + ("?" + rest if rest else ""), 303, headers={"Cache-Control": "no-store"})
        answer.set_cookie(
            _cookie_name(headers),
            self._token or "",
            max_age=DAYS * 86_400,
            secure=scope.get("scheme") == "https",
            httponly=True,
            samesite="lax",  # strict would not come along when the link was followed from somebody's mail
        )
        return answer


def _is_open(path: str) -> bool:
    return path.startswith(FOLLOWING) or path in FILES


def _cookie_name(headers: Headers) -> str:
    """Browsers keep one set of cookies for all ports of an address: each server has a name of its own."""
    port = headers.get("host", "").rpartition(":")[2]
    return f"segmap-{port if port.isdecimal() else 'web'}"


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True, max_num_fields=None)


def _in_link(scope: Scope) -> str:
    return HTTPConnection(scope).query_params.get(PARAMETER, "")
