"""The page on formats: its examples are read as it says, and it names every format there is."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from segmap.export import FORMATS
from segmap.logs import read_log, read_maps

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "formats.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```(csv|jsonl|json)\n(.*?)```", PAGE, re.DOTALL)


def test_examples_of_ranges_are_the_same_two_scans() -> None:
    """CSV, JSON and JSON lines of the page hold the same two sweeps."""
    logs = [read_log(text.encode(), f"example.{kind}") for kind, text in EXAMPLES if "ranges" in text]
    assert [log.format for log in logs] == ["CSV", "JSON", "JSON lines"]
    for log in logs:
        assert log.problems == ()
        assert [scan.time for scan in log] == [0.0, 0.1]
        assert np.isfinite(log[0].ranges).tolist() == [True, True, True, False, True, True, True]
        assert np.degrees(log[0].angles).round(6).tolist() == [-90, -60, -30, 0, 30, 60, 90]
        assert all((scan.ranges[:3] == first.ranges[:3]).all() for scan, first in zip(log, logs[0], strict=True))


def test_example_of_maps() -> None:
    """The maps of the page are two partial maps."""
    (maps,) = (read_maps(text.encode()) for kind, text in EXAMPLES if "components" in text)
    assert maps.problems == ()
    assert [(part.name, len(part.map), part.map.directed.all()) for part in maps.parts] == [
        ("hall", 2, True),
        ("office", 1, False),
    ]


def test_every_format_to_export_is_on_the_page() -> None:
    """Names and suffixes of all of them."""
    for format in FORMATS.values():
        assert f"`{format.name}`" in PAGE
        assert f"`{format.suffix}`" in PAGE
