"""The library as scripts use it: the page on it, the example, and what ``import segmap`` brings."""

from __future__ import annotations

import doctest
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import segmap
from segmap.logs import read_maps

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "api.md"


def test_the_examples_of_the_page_are_true(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run as they stand, in a folder where the samples are."""
    (tmp_path / "sample_logs").symlink_to(ROOT / "sample_logs")
    monkeypatch.chdir(tmp_path)
    result = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 30
    assert result.failed == 0


def test_every_name_is_on_the_page() -> None:
    """And each is what its module has."""
    table = PAGE.read_text(encoding="utf-8").partition("## Read")[0]
    assert {*re.findall(r"`(\w+)`", table)} >= {*segmap.__all__}
    assert {*segmap.__all__} <= {*dir(segmap)}
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        segmap.nothing  # noqa: B018


def test_importing_it_imports_nothing_else() -> None:
    """Neither numpy nor numba, until something is asked for."""
    code = "import sys, segmap; assert not {'numpy', 'numba', 'shapely', 'pydantic'} & set(sys.modules), sys.modules"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """From a log to files, and it prints what it finds."""
    monkeypatch.setattr(sys, "argv", ["laboratory.py", "--out", os.fspath(tmp_path / "out")])
    runpy.run_path(str(ROOT / "examples" / "laboratory.py"))
    told = capsys.readouterr().out
    assert "accepted" in told
    assert re.search(r"component 1: \d\d scans", told)
    assert read_maps(tmp_path / "out" / "map.geojson").parts
    assert (tmp_path / "out" / "map.pgm").is_file()
