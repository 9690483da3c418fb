"""What all tests of pages in a browser do."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def photograph(page: Any, path: Path) -> None:
    """Keep what a page looks like; without a graphics card a browser may fail once and be able to a moment later."""
    from playwright.sync_api import Error  # only where there is a page is there a playwright

    try:
        page.screenshot(path=path)
    except Error:
        page.wait_for_timeout(1000)
        page.screenshot(path=path)
