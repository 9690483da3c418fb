"""Components as SVG: metres, y up; one group each, side by side, as nothing is known between them.

Inside a group the coordinates are the map's own, metres in the component's frame: the group's
transform turns y up and moves it to its place on the sheet.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from segmap.export.components import Content, ExportFormat, MapComponent, origin_of
from segmap.export.sheet import BAR, COLOURS, LABEL, MARGIN, STROKE, TITLE, Place, Sheet, round_length, title_of
from segmap.segments import SegmentMap

__all__ = ["SVG", "draw_svg", "thumbnail", "write_svg"]

SHEET, THUMBNAIL = 1000, 320
"""pixels of the longer side where the viewer does not say"""
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
    sheet = Sheet.of([component for component in content.components if len(component.map)], small)
    body = [_group(place, index, sheet.unit, small) for index, place in enumerate(sheet.places)]
    words = [] if small else [*_about(content), BACKGROUND, *_captions(sheet, content.metadata)]
    if not sheet.places:
        words.append(_label("no segments", sheet.width / 2, sheet.height / 2, 6 * sheet.unit, "middle"))
    return "\n".join((_opening(sheet, small), *words, *body, "</svg>\n"))


def _opening(sheet: Sheet, small: bool) -> str:
    pixels = (THUMBNAIL if small else SHEET) / max(sheet.width, sheet.height)
    return (
        '<svg xmlns="http://www.w3.org/2000/svg"'
        f' width="{sheet.width * pixels:.0f}" height="{sheet.height * pixels:.0f}"'
        f' viewBox="0 0 {_metres(sheet.width)} {_metres(sheet.height)}" font-family="sans-serif">'
    )


def _about(content: Content) -> Iterator[str]:
    yield f"<title>{_text(title_of(content.metadata))}</title>"
    told = [f"{name}: {value}" for name, value in sorted(content.metadata.items())]
    told += [f"{component.name}: no segments" for component in content.components if not len(component.map)]
    frame = "Metres, y up; inside each group the component's own local frame."
    yield f"<desc>{_text(chr(10).join((frame, *told)))}</desc>"


def _captions(sheet: Sheet, metadata: Mapping[str, str]) -> Iterator[str]:
    unit = sheet.unit
    yield _label(title_of(metadata), MARGIN * unit, (MARGIN + TITLE) * unit, TITLE * unit)
    if len(sheet.places) > 1:
        for place in sheet.places:
            yield _label(place.component.name, place.left, place.top - 0.7 * unit, LABEL * unit)
    if sheet.places:
        yield from _scale_bar(sheet)


def _scale_bar(sheet: Sheet) -> Iterator[str]:
    unit, length = sheet.unit, round_length(sheet.width / 5.0)
    x, y = MARGIN * unit, sheet.height - MARGIN * unit
    size = f'width="{_metres(length)}" height="{_metres(BAR * unit)}"'
    yield f'<rect id="scale-bar" x="{_metres(x)}" y="{_metres(y)}" {size} fill="#111827"/>'
    yield _label(f"{length:g} m", x + length + unit, y + BAR * unit, LABEL * unit)


def _label(text: str, x: float, y: float, size: float, anchor: str = "start") -> str:
    where = f'x="{_metres(x)}" y="{_metres(y)}" font-size="{_metres(size)}" text-anchor="{anchor}"'
    return f'<text {where} fill="#111827">{_text(text)}</text>'


def _group(place: Place, index: int, unit: float, small: bool) -> str:
    pen = f'fill="none" stroke="{COLOURS[index % len(COLOURS)]}" stroke-linecap="round"'
    width = _metres((STROKE * 3 if small else STROKE) * unit)
    start = f'<g id="component-{index}" transform="{_transform(place)}" {pen} stroke-width="{width}">'
    lines = [_path(place.component.map)] if small else _lines(place.component)
    return "\n".join((start, *lines, "</g>"))


def _transform(place: Place) -> str:
    x, y = place.origin
    return f"translate({_metres(x)} {_metres(y)}) scale(1 -1)"


def _lines(component: MapComponent) -> Iterator[str]:
    yield f"<title>{_text(component.name)}</title>"
    for row, sources in zip(component.map.coordinates.tolist(), component.map.sources, strict=True):
        x1, y1, x2, y2 = map(_metres, row)
        yield f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" data-sources="{origin_of(sources)}"/>'


def _path(map: SegmentMap) -> str:
    moves = (f"M{x1:.2f} {y1:.2f}L{x2:.2f} {y2:.2f}" for x1, y1, x2, y2 in map.coordinates.tolist())
    return f'<path d="{"".join(moves)}"/>'


def _metres(value: float) -> str:
    """A length to a tenth of a millimetre, without needless zeros."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _text(text: str) -> str:
    return escape(NOT_XML.sub("\N{REPLACEMENT CHARACTER}", text), quote=True)


SVG = ExportFormat(
    name="svg",
    suffix=".svg",
    media_type="image/svg+xml",
    title="SVG",
    use="for drawing programs and print",
    write=write_svg,
)
