"""Pages and samples, in a checkout and installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from app import resources


def test_both_places_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Installed they lie inside the package, which goes before whatever lies beside it; in a checkout beside it."""
    assert (resources.static_folder() / "index.html").is_file()
    assert (resources.samples_folder() / "samples.json").is_file()
    monkeypatch.setattr(resources, "PACKAGE", tmp_path / "app")
    for folder in ("app", "static"):
        (tmp_path / folder).mkdir()
    assert resources.static_folder() == tmp_path / "static"
    (tmp_path / "app" / "static").mkdir()
    assert resources.static_folder() == tmp_path / "app" / "static"
