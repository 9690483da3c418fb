"""Bytes -> a file, whole or not at all."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from segmap.errors import ExportError

__all__ = ["write_whole"]


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file beside its place and put it there when it is complete.

    Raises:
        ExportError: it cannot be written; what was there before is kept.
    """
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
