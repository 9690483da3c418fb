"""Where the pages and the sample logs lie: beside the packages in a checkout, inside ``app`` when installed."""

from __future__ import annotations

from pathlib import Path

__all__ = ["samples_folder", "static_folder"]

PACKAGE = Path(__file__).resolve().parent


def static_folder() -> Path:
    """The folder of the pages, scripts and styles."""
    return _folder("static")


def samples_folder() -> Path:
    """The folder of the sample logs."""
    return _folder("sample_logs")


def _folder(name: str) -> Path:
    installed = PACKAGE / name
    return installed if installed.is_dir() else PACKAGE.parent / name
