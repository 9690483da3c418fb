"""Components as a PNG picture: the sheet of :mod:`segmap.export.sheet` in pixels, its origin told in texts."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from segmap.export.components import Content, ExportFormat, told_of
from segmap.export.sheet import BAR, COLOURS, LABEL, MARGIN, STROKE, TITLE, Place, Sheet, round_length, title_of

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.PngImagePlugin import PngInfo

__all__ = ["PNG", "write_png"]

LONGER_SIDE = 1600
"""pixels"""
SMOOTHING = 3
"""everything is drawn this many times as large, then made small"""
PAPER, INK = "#ffffff", "#111827"


def write_png(content: Content) -> bytes:
    """The whole drawing: title, scale bar, a label each where there are several components.

    The texts ``Title``, ``Software`` and ``Description`` say what it is; ``Scale`` is metres a pixel.

    Raises:
        ExportError: the map is too large for a sheet.
    """
    from PIL import Image, ImageDraw

    sheet = Sheet.of([component for component in content.components if len(component.map)])
    scale = LONGER_SIDE / max(sheet.width, sheet.height)
    size = max(round(sheet.width * scale), 1), max(round(sheet.height * scale), 1)
    picture = Image.new("RGB", (size[0] * SMOOTHING, size[1] * SMOOTHING), PAPER)
    _Pen(ImageDraw.Draw(picture), scale * SMOOTHING, sheet).draw(content)
    small = picture.resize(size, Image.Resampling.BOX)
    file = io.BytesIO()
    small.save(file, "PNG", pnginfo=_texts(content, 1.0 / scale))
    return file.getvalue()


class _Pen:
    """Draws in metres of the sheet."""

    def __init__(self, draw: ImageDraw, scale: float, sheet: Sheet) -> None:
        self._draw, self._scale, self._sheet = draw, scale, sheet

    def draw(self, content: Content) -> None:
        """All of the sheet."""
        unit, places = self._sheet.unit, self._sheet.places
        for index, place in enumerate(places):
            self._component(place, COLOURS[index % len(COLOURS)])
        self._text(title_of(content.metadata), MARGIN * unit, (MARGIN + TITLE) * unit, TITLE)
        if len(places) > 1:
            for place in places:
                self._text(place.component.name, place.left, place.top - 0.7 * unit, LABEL)
        if places:
            self._scale_bar()
        else:
            self._text("no segments", 30 * unit, self._sheet.height / 2, 6)

    def _component(self, place: Place, colour: str) -> None:
        x, y = place.origin
        width = max(round(STROKE * self._sheet.unit * self._scale), 1)
        for x1, y1, x2, y2 in place.component.map.coordinates.tolist():
            self._draw.line((*self._at(x + x1, y - y1), *self._at(x + x2, y - y2)), colour, width)

    def _scale_bar(self) -> None:
        unit, length = self._sheet.unit, round_length(self._sheet.width / 5.0)
        x, y = MARGIN * unit, self._sheet.height - MARGIN * unit
        self._draw.rectangle((*self._at(x, y), *self._at(x + length, y + BAR * unit)), INK)
        self._text(f"{length:g} m", x + length + unit, y + BAR * unit, LABEL)

    def _text(self, text: str, x: float, y: float, units: float) -> None:
        """A line of text from x on, standing on y."""
        from PIL import ImageFont

        font = ImageFont.load_default(max(units * self._sheet.unit * self._scale, 1.0))
        shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
        self._draw.text(self._at(x, y), shown, INK, font, anchor="ls")

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return x * self._scale, y * self._scale


def _texts(content: Content, metres: float) -> PngInfo:
    from PIL.PngImagePlugin import PngInfo

    texts = PngInfo()
    told = {
        "Title": title_of(content.metadata),
        "Software": f"segmap {content.metadata.get('version', '')}".strip(),
        "Description": "\n".join(told_of(content.metadata)),
        "Scale": f"{metres!r} metres a pixel",
    }
    for name, text in told.items():
        texts.add_itxt(name, text.encode("utf-8", "replace").decode())
    return texts


PNG = ExportFormat(
    name="png",
    suffix=".png",
    media_type="image/png",
    title="PNG",
    use="a picture, for documents and slides",
    write=write_png,
)
