"""Fixtures every test may ask for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


def _folder(variable: str, name: str, what: str) -> Path:
    folder = Path(os.environ.get(variable, SHARED / name))
    if not folder.is_dir():
        pytest.skip(f"{what} are not at {folder}; set {variable} to their folder")
    return folder


@pytest.fixture(scope="session")
def datasets() -> Path:
    """The folder of the real laser logs; skips without it."""
    return _folder("SEGMAP_DATASETS", "datasets", "the real laser logs")


@pytest.fixture(scope="session")
def benchmarks() -> Path:
    """The folder of the benchmark pairs; skips without it."""
    return _folder("SEGMAP_BENCHMARKS", "benchmarks", "the benchmark pairs")
