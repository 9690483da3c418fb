"""Fixtures every test may ask for."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# A test asserts what comes out, not how fast; the same examples every time, so that a failure comes back.
settings.register_profile("segmap", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("segmap")

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


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium, driven by playwright: the system's, or playwright's own; skips without either."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        if not (found or Path(playwright.chromium.executable_path).exists()):
            pytest.skip("there is no chromium; run: playwright install chromium")
        chromium = playwright.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-dev-shm-usage"])
        yield chromium
        chromium.close()
