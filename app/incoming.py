"""What a request may bring: so many bytes, in so much time."""

from __future__ import annotations

import asyncio
import time

from starlette.exceptions import HTTPException
from starlette.types import Message, Receive

__all__ = ["CLOSE", "MEBIBYTE", "SECONDS", "SILENT_SECONDS", "bounded", "too_large"]

MEBIBYTE = 1024 * 1024
SECONDS = 900.0
"""for all of a body; 256 MiB at 0.3 MiB a second"""
SILENT_SECONDS = 60.0
"""without a byte of it"""
CLOSE = {"Connection": "close"}
"""with an answer that comes before the end of the request: what still comes of it is not waited for"""
LATE = "The request did not arrive in time: try again, or open the files on the command line: segmap serve."


def bounded(receive: Receive, limit: int, seconds: float = SECONDS, silent: float = SILENT_SECONDS) -> Receive:
    """``receive`` that raises once a body is longer than ``limit`` bytes, whatever length was declared, or is late."""
    end = time.monotonic() + seconds
    seen, complete = 0, False

    async def next_piece() -> Message:
        nonlocal seen, complete
        if complete:  # what comes now is that the client has gone, however late
            return await receive()
        message = await _in_time(receive, min(silent, end - time.monotonic()))
        complete = not message.get("more_body", False)
        seen += len(message.get("body", b""))
        if seen > limit:
            raise HTTPException(413, too_large(limit), CLOSE)
        return message

    return next_piece


async def _in_time(receive: Receive, seconds: float) -> Message:
    try:
        async with asyncio.timeout(max(seconds, 0.0)):
            return await receive()
    except TimeoutError:
        raise HTTPException(408, LATE, CLOSE) from None


def too_large(limit: int) -> str:
    """What to say about a body above ``limit`` bytes."""
    return f"The request is larger than {limit // MEBIBYTE} MiB; open larger files on the command line: segmap serve."
