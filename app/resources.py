"""What comes with the program: the pages, the sample logs, the version.

The folders lie beside the packages in a checkout and inside ``app`` when installed.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

__all__ = ["program_version", "samples_folder", "static_folder"]

PACKAGE = Path(__file__).resolve().parent


def static_folder() -> Path:
    """The folder of the pages, scripts and styles."""
    return _folder("static")


def samples_folder() -> Path:
    """The folder of the sample logs."""
    return _folder("sample_logs")


@cache
def program_version() -> str:
    """The version of segmap; ``unknown`` where it runs without being installed."""
    try:
        return version("segmap")
    except PackageNotFoundError:
        return "unknown"


def _folder(name: str) -> Path:
    installed = PACKAGE / name
    return installed if installed.is_dir() else PACKAGE.parent / name
