"""Bytes -> a file, whole or not at all; several files -> one archive."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from segmap.errors import ExportError

__all__ = ["check_place", "packed", "write_whole"]

FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""the earliest time an archive can give a file: the same files make the same archive, whenever"""


def check_place(path: str | os.PathLike[str]) -> None:
    """Say before the work that its result could not be written.

    Raises:
        ExportError: the path is a folder, or lies in none that may be written to.
    """
    target = Path(path)
    if not target.name or target.is_dir():
        raise ExportError(f"{target} is a folder: name the file to write in it.")
    if target.parent.exists() and not target.parent.is_dir():
        raise ExportError(f"{target} cannot be written: {target.parent} is no folder. Choose another place.")
    if not target.parent.is_dir():
        raise ExportError(f"{target} cannot be written: there is no folder {target.parent}. Choose another place.")
    if not os.access(target.parent, os.W_OK):
        raise ExportError(f"{target} cannot be written: its folder is read-only. Choose another place.")


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file beside its place and put it there when it is complete.

    Raises:
        ExportError: it cannot be written; what was there before is kept.
    """
    check_place(path)
    target = Path(path)
    beside = target.with_name(f"{target.name}.part")
    try:
        beside.write_bytes(content)
        beside.replace(target)
    except OSError as error:
        with suppress(OSError):
            beside.unlink()
        reason = (error.strerror or str(error)).lower()
        raise ExportError(f"{target} cannot be written: {reason}. Choose another place.") from None


def packed(files: Mapping[str, bytes]) -> bytes:
    """Files as a zip archive; the same files give the same bytes."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as pack:
        for name, content in files.items():
            pack.writestr(zipfile.ZipInfo(name, FIRST_DAY), content, zipfile.ZIP_DEFLATED)
    return archive.getvalue()
