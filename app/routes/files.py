"""The files of the pages: only those that are there by name, kept in memory, and read again when they change."""

from __future__ import annotations

import hashlib
import mimetypes
from dataclasses import dataclass
from pathlib import Path

from fastapi import APIRouter
from fastapi.requests import Request
from fastapi.responses import Response

from app.errors import UnknownError
from app.resources import static_folder

__all__ = ["router"]

router = APIRouter(include_in_schema=False)


@dataclass(frozen=True)
class _Held:
    stamp: int
    content: bytes
    kind: str
    tag: str


class _Files:
    """Files below a folder by name; a name is looked up and never made into a path."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._paths: dict[str, Path] = {}
        self._held: dict[str, _Held] = {}

    def get(self, name: str) -> _Held:
        """A file as it is now. Raises UnknownError where there is none."""
        if name not in self._paths:
            files = (path for path in self._folder.rglob("*") if path.is_file())
            self._paths = {path.relative_to(self._folder).as_posix(): path for path in files}
        path = self._paths.get(name)
        if path is None or not path.is_file():
            raise UnknownError("There is no such file here.")
        stamp, held = path.stat().st_mtime_ns, self._held.get(name)
        if held is None or held.stamp != stamp:
            content, kind = path.read_bytes(), mimetypes.guess_type(name)[0] or "application/octet-stream"
            held = _Held(stamp, content, kind, f'"{hashlib.sha256(content).hexdigest()[:20]}"')
            self._held[name] = held
        return held


_files = _Files(static_folder())


@router.api_route("/static/{name:path}", methods=["GET", "HEAD"])
async def file(name: str, request: Request) -> Response:
    """A script, style or picture of the pages; browsers ask each time, and mostly hear that theirs is the same."""
    held = _files.get(name)
    if held.tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers={"ETag": held.tag})
    return Response(held.content, media_type=held.kind, headers={"ETag": held.tag})
