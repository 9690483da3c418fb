"""Colours of the scene: told apart by colour-blind eyes, readable on a light and on a dark background."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["PALETTES", "RGB", "THEMES", "Palette", "hexadecimal"]

RGB: TypeAlias = tuple[int, int, int]
"""sRGB, 0 to 255"""


@dataclass(frozen=True)
class Palette:
    """The colours of one theme."""

    background: RGB
    text: RGB
    first: RGB
    """the first map of a pair"""
    second: RGB
    """the second one"""
    neutral: RGB
    """what belongs to neither"""
    accent: RGB
    """what one should look at: the superimposed angle, what was clicked"""
    good: RGB
    bad: RGB
    doubtful: RGB
    """for words; in drawings ``sights`` has a stronger one"""
    sights: tuple[RGB, ...]
    """of returns that are supported, contradicted, shadowed and unseen"""
    chains: tuple[RGB, ...]
    """matching chains, and components of the map, in turn"""
    values: tuple[RGB, ...]
    """from a low to a high value"""
    grid: tuple[float, float]
    """strength of fine and of bold lines"""

    def faint(self, colour: RGB, strength: float = 0.35) -> RGB:
        """A colour mixed into the background; strength 1 leaves it as it is."""
        mixed = (round(strength * c + (1.0 - strength) * b) for c, b in zip(colour, self.background, strict=True))
        r, g, b = mixed
        return r, g, b

    def chain(self, index: int) -> RGB:
        """The colour of a chain or a component by its place; colours come again when they run out."""
        return self.chains[index % len(self.chains)]

    @property
    def heat(self) -> tuple[RGB, ...]:
        """From as it should be to bad."""
        return self.good, self.sights[2], self.bad

    def by_heat(self, shares: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Colours, shape (n, 3), of badness between 0 and 1, shape (n,); what is not known is neutral."""
        stops = np.linspace(0.0, 1.0, len(self.heat))
        known = np.nan_to_num(shares.clip(0.0, 1.0))
        channels = [np.interp(known, stops, channel) for channel in np.array(self.heat, float).T]
        mixed = np.round(np.stack(channels, axis=-1)).astype(np.uint8)
        mixed[np.isnan(shares)] = self.neutral
        return mixed

    def by_value(self, shares: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Colours, shape (n, 3), of values between 0 and 1, shape (n,)."""
        stops = np.linspace(0.0, 1.0, len(self.values))
        channels = [np.interp(shares, stops, channel) for channel in np.array(self.values, float).T]
        return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


def _rgb(text: str) -> RGB:
    r, g, b = bytes.fromhex(text)
    return r, g, b


def _several(text: str) -> tuple[RGB, ...]:
    return tuple(_rgb(one) for one in text.split())


def hexadecimal(colour: RGB) -> str:
    """The colour as pages write it.

    >>> hexadecimal((0, 103, 190))
    '#0067be'
    """
    return "#" + bytes(colour).hex()


PALETTES = {
    "light": Palette(
        background=_rgb("ffffff"),
        text=_rgb("1f2933"),
        first=_rgb("0067be"),
        second=_rgb("e06000"),
        neutral=_rgb("6b7785"),
        accent=_rgb("c3225b"),
        good=_rgb("12805c"),
        bad=_rgb("c22f2f"),
        doubtful=_rgb("8a5a00"),
        sights=_several("12805c c22f2f f08c00 a3adb8"),
        chains=_several("0067be e83c28 1d978f c3225b 52b4ff 662512 5834ed ff9400"),
        values=_several("c9d3de 7fb2d6 2f86c1 1b5a97 0b2f5c"),
        grid=(0.17, 0.45),
    ),
    "dark": Palette(
        background=_rgb("141414"),
        text=_rgb("e6e9ed"),
        first=_rgb("4dabf7"),
        second=_rgb("ff9a3c"),
        neutral=_rgb("9aa5b1"),
        accent=_rgb("ff63bd"),
        good=_rgb("3ccf91"),
        bad=_rgb("ff7b72"),
        doubtful=_rgb("e9b64c"),
        sights=_several("3ccf91 ff5a50 ffa94d 6b7785"),
        chains=_several("249cff ff8a1f 12b886 ff63bd bde3ff a67c3a b745ca ffe066"),
        values=_several("3c4754 2f6690 3a9bc9 84d2dc f4f1a6"),
        grid=(0.27, 0.5),
    ),
}
THEMES = tuple(PALETTES)
