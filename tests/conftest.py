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

CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
)
SHARED = Path(__file__).resolve().parents[2] / "shared"


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--all``: also what takes longer than a moment."""
    parser.addoption("--all", action="store_true", help="run the slow tests too, and all that drive the real page")


@pytest.hookimpl(tryfirst=True)  # -m selects by the marks that are set here
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without ``--all`` one walk through the real page is enough, and what is slow waits."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)
    if config.getoption("--all"):
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="slow: pytest --all runs it"))
        elif item.get_closest_marker("browser") and not item.get_closest_marker("quick"):
            item.add_marker(pytest.mark.skip(reason="one browser test is enough for now: pytest --all runs the others"))


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
def chromium() -> Iterator[Any]:
    """The one chromium of all tests: SEGMAP_CHROMIUM, the system's, or playwright's own; skips without any."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install playwright")
    with sync_api.sync_playwright() as playwright:
        named = [os.environ.get("SEGMAP_CHROMIUM"), *map(shutil.which, CHROMIUMS), playwright.chromium.executable_path]
        path = next((name for name in named if name and Path(name).is_file()), None)
        if path is None:
            pytest.skip("there is no chromium: install it, or set SEGMAP_CHROMIUM to where it is")
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()
