"""Compressed pieces inside bags, expanded no farther than a bound; of a piece that is cut off, what is there."""

from __future__ import annotations

import bz2
from typing import Any

from segmap.logs.text import MalformedError

__all__ = ["LARGEST", "expand"]

LARGEST = 1 << 28
"""bytes, of one piece, expanded; recorders make pieces of about one megabyte"""
WINDOW = 1 << 27
"""bytes that zstd may look back; more is refused"""


def expand(kind: str, packed: bytes, most: int = LARGEST) -> bytes:
    """The bytes that were compressed; ``kind`` is ``bz2``, ``lz4``, ``zstd``, or ``none`` for bytes as they are.

    Raises:
        MalformedError: the compression is unknown, the piece damaged, or more than ``most`` bytes come out.
    """
    if kind in ("none", ""):
        return packed
    if kind not in ("bz2", "lz4", "zstd"):
        raise MalformedError(f"it is compressed with {kind[:24]!r}, which segmap does not know")
    try:
        found: bytes = _expanded(kind, packed, most + 1)
    except (OSError, EOFError, RuntimeError, ValueError, MemoryError) as error:
        raise MalformedError(f"its {kind} data are damaged") from error
    if len(found) > most:
        raise MalformedError(f"it grows to more than {most >> 20} MiB when decompressed")
    return found


def _expanded(kind: str, packed: bytes, most: int) -> Any:
    if kind == "bz2":
        return bz2.BZ2Decompressor().decompress(packed, most)
    if kind == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor().decompress(packed, most)
    return _zstd(packed, most)


def _zstd(packed: bytes, most: int) -> bytes:
    from zstandard import ZstdDecompressor, ZstdError

    try:
        with ZstdDecompressor(max_window_size=WINDOW).stream_reader(packed) as reader:
            return reader.read(most)
    except ZstdError as error:
        raise ValueError(str(error)) from error
