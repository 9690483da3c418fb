"""PNG, read back by Pillow."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from segmap.export import export_map


def opened(*parts, metadata=None) -> Image.Image:
    image = Image.open(io.BytesIO(export_map(parts, "png", metadata)))
    image.load()
    return image


def inked(image: Image.Image, colour: tuple[int, int, int]) -> np.ndarray:
    """Pixels of about a colour, as (rows, columns)."""
    away = np.abs(np.asarray(image, dtype=int) - colour).max(axis=2)
    return np.argwhere(away < 40)


def test_the_drawing_has_the_size_it_says(corner):
    """Metres a pixel, as the file tells them, are those of the drawing; y points up."""
    image = opened(corner)
    assert image.format == "PNG"
    assert max(image.size) == 1600
    rows, columns = inked(image, (0x0B, 0x53, 0x94)).T
    metres = float(image.text["Scale"].split()[0])
    assert abs((columns.max() - columns.min()) * metres - 4.0) < 0.05
    assert abs((rows.max() - rows.min()) * metres - 2.0) < 0.05
    foot = columns[rows > rows.max() - 3]
    assert (foot.max() - foot.min()) * metres > 3.9


def test_components_have_colours_of_their_own(corner, part):
    """The second component stands below the first one, in another colour."""
    image = opened(corner, part("other", (0.0, 0.0, 3.0, 3.0)))
    first, second = inked(image, (0x0B, 0x53, 0x94)), inked(image, (0xC2, 0x41, 0x0C))
    assert len(second) > 100
    assert second[:, 0].min() > first[:, 0].max()


def test_origin(corner):
    """Title, program and all metadata are texts of the file."""
    texts = opened(corner, metadata={"title": "B\u00fcro\ud800", "version": "0.1.0", "map_hash": "5f3a"}).text
    assert texts["Title"] == "B\u00fcro?"
    assert texts["Software"] == "segmap 0.1.0"
    assert "map_hash: 5f3a" in texts["Description"]


def test_empty_and_hostile(part):
    """No segments, and names of any characters, are a picture too."""
    assert opened().size[0] == 1600
    assert opened(part("\ud800\n\x00\u202e", (0.0, 0.0, 1e6, 1.0)), part("", (0.0, 0.0, 1e-3, 0.0))).size[0] == 1600
