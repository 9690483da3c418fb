"""Every failure answers in one shape: {"error": {"message": a sentence for people, "kind": the name of the error}}."""

from __future__ import annotations

import errno
import logging

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from app.errors import BusyError, UnknownError
from segmap.errors import CancelledError, ConflictError, SegmapError

__all__ = ["answer_failures"]

STATUS: dict[type[SegmapError], int] = {UnknownError: 404, ConflictError: 409, CancelledError: 409, BusyError: 429}
OTHERWISE = 400
log = logging.getLogger(__name__)
NOBODY_WAITS = 499
NO_SPACE = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
FULL = "The server's disk is full: nothing of this was kept. Free some space there and try again."
INTERNAL = "Something went wrong inside segmap; the server's output says where. What was decided before is kept."


def answer_failures(app: FastAPI) -> None:
    """Register what answers each kind of failure."""
    app.add_exception_handler(SegmapError, _known)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(ClientDisconnect, _gone)
    app.add_exception_handler(OSError, _system)
    app.add_exception_handler(Exception, _unexpected)


async def _known(_: Request, error: Exception) -> Response:
    status = next((code for kind, code in STATUS.items() if isinstance(error, kind)), OTHERWISE)
    return _failure(status, str(error), type(error).__name__)


async def _invalid(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"] if part not in ("body", "query", "path"))
    return _failure(422, f"{where or 'The request'}: {first['msg'].lower()}.", "RequestError")


async def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if isinstance(error.__cause__, OSError | ClientDisconnect):  # while an upload was taken in
        return await (_system if isinstance(error.__cause__, OSError) else _gone)(request, error.__cause__)
    return _failure(error.status_code, str(error.detail), "HTTPError", error.headers)


async def _gone(_: Request, __: Exception) -> Response:
    return Response(status_code=NOBODY_WAITS)


async def _system(request: Request, error: Exception) -> Response:
    assert isinstance(error, OSError)
    if error.errno in NO_SPACE:
        return _failure(507, FULL, "DiskFull")
    log.error("A request failed: %s %s", request.scope.get("method", "socket"), request.url.path, exc_info=error)
    return await _unexpected(request, error)


async def _unexpected(_: Request, __: Exception) -> Response:
    return _failure(500, INTERNAL, "InternalError")  # the traceback is written by the server


def _failure(status: int, message: str, kind: str, headers: object = None) -> JSONResponse:
    text = message.encode("utf-8", "replace").decode()  # requests can hold what UTF-8 cannot
    return JSONResponse({"error": {"message": text, "kind": kind}}, status, headers)  # type: ignore[arg-type]
