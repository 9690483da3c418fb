"""Components as SVG: metres, y up; one group each, side by side, as nothing is known between them.

Inside a group the coordinates are the map's own, metres in the component's frame: the group's
transform turns y up and moves it to its place on the sheet.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from segmap.errors import ExportError
from segmap.export.components import Content, MapComponent
from segmap.segments import SegmentMap

__all__ = ["draw_svg", "thumbnail", "write_svg"]

COLOURS = ("#0b5394", "#c2410c", "#15803d", "#9d174d", "#a16207", "#0e7490", "#6d28d9", "#4b5563")
SHEET, THUMBNAIL = 1000, 320
"""pixels of the longer side where the viewer does not say"""
WIDEST = 1e7
"""metres"""
MARGIN, TITLE, LABEL, BAR, STROKE = 3.0, 2.6, 1.8, 0.5, 0.16
"""units, hundredths of the drawing's longer side"""
LETTER = 0.6
"""width of a letter, sizes of the font"""
EMPTY = 10.0
"""metres, the side of a sheet without segments"""
BACKGROUND = '<rect width="100%" height="100%" fill="#ffffff"/>'
NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_svg(content: Content) -> bytes:
    """The whole drawing: title, scale bar, a label each where there are several components."""
    return draw_svg(content).encode("utf-8")


def thumbnail(components: Sequence[MapComponent]) -> str:
    """A small drawing of the same, lines only, as text."""
    return draw_svg(Content(components), small=True)


def draw_svg(content: Content, *, small: bool = False) -> str:
    """The drawing as text; the same input gives the same text.

    Raises:
        ExportError: the map is too large for a sheet.
    """
    sheet = _Sheet.of([component for component in content.components if len(component.map)], small)
    body = [_group(place, index, sheet.unit, small) for index, place in enumerate(sheet.places)]
    words = [] if small else [*_about(content), BACKGROUND, *_captions(sheet, content.metadata)]
    if not sheet.places:
        words.append(_label("no segments", sheet.width / 2, sheet.height / 2, 6 * sheet.unit, "middle"))
    return "\n".join((_opening(sheet, small), *words, *body, "</svg>\n"))


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a component's box lies on the sheet: its upper left corner, metres from the sheet's."""

    component: MapComponent
    left: float
    top: float

    @property
    def transform(self) -> str:
        x1, _, _, y2 = _box(self.component.map)
        return f"translate({_metres(self.left - x1)} {_metres(self.top + y2)}) scale(1 -1)"


@dataclass(frozen=True, slots=True)
class _Sheet:
    """Components in rows, and the size that takes, metres."""

    places: tuple[_Place, ...]
    width: float
    height: float
    unit: float
    """a hundredth of the widest row or tallest component: margins and letters are some of it"""

    @classmethod
    def of(cls, components: Sequence[MapComponent], small: bool) -> _Sheet:
        sizes = [_size(component.map) for component in components]
        if not sizes:
            return cls((), EMPTY, EMPTY / 2, EMPTY / 100)
        widest = max(*(width for width, _ in sizes), 1.4 * math.sqrt(sum(w * h for w, h in sizes)), 0.1)
        longest = max(widest, *(height for _, height in sizes))
        if not longest < WIDEST:
            raise ExportError(f"The map is {longest:.3g} m wide, too large for a drawing: export it as geojson.")
        return cls._laid_out(components, widest, longest / 100.0, small)

    @classmethod
    def _laid_out(cls, components: Sequence[MapComponent], widest: float, unit: float, small: bool) -> _Sheet:
        gap, head, foot = MARGIN * unit, 0.0 if small else (LABEL + 1.0) * unit, 0.0 if small else 3 * MARGIN * unit
        slots = [_slot(component, unit, small) for component in components]
        places: list[_Place] = []
        top, right = gap if small else gap + 2 * TITLE * unit, 50.0 * unit
        for row in _rows(slots, widest + gap, gap):
            left = gap
            for i in row:
                places.append(_Place(components[i], left, top + head))
                left += slots[i] + gap
            right, top = max(right, left), top + head + max(_size(components[i].map)[1] for i in row) + gap
        return cls(tuple(places), right, max(top + foot, 10.0 * unit), unit)


def _slot(component: MapComponent, unit: float, small: bool) -> float:
    """The width a component and its label take, metres."""
    width, _ = _size(component.map)
    return width if small else max(width, LETTER * LABEL * unit * len(component.name))


def _rows(slots: Sequence[float], widest: float, gap: float) -> list[list[int]]:
    """Which components stand in one row, in order."""
    rows: list[list[int]] = []
    taken = math.inf
    for i, slot in enumerate(slots):
        if taken + slot > widest:
            rows.append([])
            taken = 0.0
        rows[-1].append(i)
        taken += slot + gap
    return rows


def _box(map: SegmentMap) -> tuple[float, float, float, float]:
    return map.bounds or (0.0, 0.0, 0.0, 0.0)


def _size(map: SegmentMap) -> tuple[float, float]:
    x1, y1, x2, y2 = _box(map)
    return x2 - x1, y2 - y1


def _opening(sheet: _Sheet, small: bool) -> str:
    pixels = (THUMBNAIL if small else SHEET) / max(sheet.width, sheet.height)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg"'
        f' width="{sheet.width * pixels:.0f}" height="{sheet.height * pixels:.0f}"'
        f' viewBox="0 0 {_metres(sheet.width)} {_metres(sheet.height)}" font-family="sans-serif">'
    )


def _about(content: Content) -> Iterator[str]:
    yield f"<title>{_text(_title(content.metadata))}</title>"
    told = [f"{name}: {value}" for name, value in sorted(content.metadata.items())]
    told += [f"{component.name}: no segments" for component in content.components if not len(component.map)]
    frame = "Metres, y up; inside each group the component's own local frame."
    yield f"<desc>{_text(chr(10).join((frame, *told)))}</desc>"


def _title(metadata: Mapping[str, str]) -> str:
    return metadata.get("title", "Segment map")


def _captions(sheet: _Sheet, metadata: Mapping[str, str]) -> Iterator[str]:
    unit = sheet.unit
    yield _label(_title(metadata), MARGIN * unit, (MARGIN + TITLE) * unit, TITLE * unit)
    if len(sheet.places) > 1:
        for place in sheet.places:
            yield _label(place.component.name, place.left, place.top - 0.7 * unit, LABEL * unit)
    if sheet.places:
        yield from _scale_bar(sheet)


def _scale_bar(sheet: _Sheet) -> Iterator[str]:
    unit, length = sheet.unit, _round_length(sheet.width / 5.0)
    x, y = MARGIN * unit, sheet.height - MARGIN * unit
    size = f'width="{_metres(length)}" height="{_metres(BAR * unit)}"'
    yield f'<rect id="scale-bar" x="{_metres(x)}" y="{_metres(y)}" {size} fill="#111827"/>'
    yield _label(f"{length:g} m", x + length + unit, y + BAR * unit, LABEL * unit)


def _round_length(most: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is at most this.

    >>> _round_length(7.3), _round_length(0.25)
    (5.0, 0.2)
    """
    power = 10.0 ** math.floor(math.log10(most))
    return float(f"{next(step for step in (5, 2, 1) if step * power <= most * (1 + 1e-9)) * power:.3g}")


def _label(text: str, x: float, y: float, size: float, anchor: str = "start") -> str:
    where = f'x="{_metres(x)}" y="{_metres(y)}" font-size="{_metres(size)}" text-anchor="{anchor}"'
    return f'<text {where} fill="#111827">{_text(text)}</text>'


def _group(place: _Place, index: int, unit: float, small: bool) -> str:
    pen = f'fill="none" stroke="{COLOURS[index % len(COLOURS)]}" stroke-linecap="round"'
    width = _metres((STROKE * 3 if small else STROKE) * unit)
    start = f'<g id="component-{index}" transform="{place.transform}" {pen} stroke-width="{width}">'
    lines = [_path(place.component.map)] if small else _lines(place.component)
    return "\n".join((start, *lines, "</g>"))


def _lines(component: MapComponent) -> Iterator[str]:
    yield f"<title>{_text(component.name)}</title>"
    for row, sources in zip(component.map.coordinates.tolist(), component.map.sources, strict=True):
        x1, y1, x2, y2 = map(_metres, row)
        origin = " ".join(f"{source.log}.{source.scan}.{source.segment}" for source in sources)
        yield f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" data-sources="{origin}"/>'


def _path(map: SegmentMap) -> str:
    moves = (f"M{x1:.2f} {y1:.2f}L{x2:.2f} {y2:.2f}" for x1, y1, x2, y2 in map.coordinates.tolist())
    return f'<path d="{"".join(moves)}"/>'


def _metres(value: float) -> str:
    """A length to a tenth of a millimetre, without needless zeros."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _text(text: str) -> str:
    return escape(NOT_XML.sub("\N{REPLACEMENT CHARACTER}", text), quote=True)
