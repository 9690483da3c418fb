"""What holds for every format."""

from __future__ import annotations

import io
import zipfile

import pytest

from segmap.errors import ExportError
from segmap.export import FORMATS, Content, export_files, export_map, write_map


@pytest.mark.parametrize("format", FORMATS)
def test_same_bytes(corner, format):
    """The same map gives the same bytes, whatever the order of the metadata."""
    one = export_map([corner], format, {"title": "T", "version": "1"}, ["0.0-0.1"])
    assert one == export_map([corner], format, {"version": "1", "title": "T"}, ["0.0-0.1"])


@pytest.mark.parametrize("format", FORMATS)
def test_provenance(corner, format):
    """Version and hash of the map are in the file people open."""
    content = Content([corner], {"version": "0.1.0", "map_hash": "5f3a"})
    main = next(iter(export_files(content, format).values()))
    assert b"0.1.0" in main
    assert b"5f3a" in main


@pytest.mark.parametrize("format", FORMATS)
def test_nothing(format):
    """A map of no components is a valid file."""
    assert export_map([], format)


def test_several_files_travel_as_one_archive(corner):
    """The archive of a format of several files holds them all, byte for byte, whenever it is made."""
    archive = zipfile.ZipFile(io.BytesIO(export_map([corner], "ros")))
    assert archive.testzip() is None
    held = {name: archive.read(name) for name in archive.namelist()}
    assert held == export_files(Content([corner]), "ros")


def test_unknown_format(corner):
    """A format that is not written is refused with those that are."""
    with pytest.raises(ExportError, match=r"no export format 'dwg'\. Formats are: ros, dxf, svg,"):
        export_map([corner], "dwg")


def test_write(corner, tmp_path):
    """A file's suffix says its format; what was there before is replaced; several files lie beside each other."""
    for name, format in FORMATS.items():
        path = tmp_path / f"map{format.suffix.upper()}"
        path.write_text("old")
        write_map([corner], path, metadata={"title": "T"})
        assert path.read_bytes() == next(iter(export_files(Content([corner], {"title": "T"}), name).values()))
    write_map([corner], tmp_path / "map.txt", "svg")
    names = {f"map{format.suffix.upper()}" for format in FORMATS.values()}
    assert {path.name for path in tmp_path.iterdir()} == {*names, "map.pgm", "map.times.csv", "map.txt"}


def test_write_refused(corner, tmp_path):
    """A suffix nobody knows, and a place where nothing can be written, are one sentence each."""
    with pytest.raises(ExportError, match=r"map\.txt does not say its format: let the name end in one of \.yaml, "):
        write_map([corner], tmp_path / "map.txt")
    with pytest.raises(ExportError, match=r"cannot be written: there is no folder .*missing\."):
        write_map([corner], tmp_path / "missing" / "map.svg")
    (tmp_path / "folder.svg").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match=r"cannot be written: .*file is no folder\."):
        write_map([corner], tmp_path / "file" / "map.svg")
    for folder in (tmp_path / "folder.svg", ".", "/"):
        with pytest.raises(ExportError, match="is a folder: name the file"):
            write_map([corner], folder, "svg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.svg"]
