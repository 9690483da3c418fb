"""The parts of the panel that viser has no widget for, as HTML made from a view's snapshot.

viser does not sanitise: everything that came from a file or a person is escaped here, in
:func:`_text`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from app.palette import PALETTES, hexadecimal

__all__ = ["candidate", "exports", "heuristics", "legend", "messages", "picked", "step", "value"]

Snapshot = Mapping[str, Any]

FAINT = "color:var(--mantine-color-dimmed)"
NUMBERS = "font-variant-numeric:tabular-nums"
STATES = {
    "pending": ("waits for a decision", "first"),
    "accepted": ("accepted", "good"),
    "rejected": ("rejected", "bad"),
    "matching": ("being matched", "neutral"),
    "none": ("no transformation found", "bad"),
    "failed": ("matching failed", "bad"),
}
"""words for the states of a pair, and their colours in the palette"""
ROOM = 1.6
"""length of the value's bar, in values or thresholds, whichever is larger"""


def step(snapshot: Snapshot) -> str:
    """Which pair this is, and what its state is."""
    row = snapshot["row"]
    if row is None:
        return _block("<b>No pair</b>")
    names = " → ".join(_text(name) for name in snapshot["names"] or (row["first"], row["second"]))
    word, name = STATES.get(row["state"], (row["state"], "neutral"))
    who = f" by {_text(row['who'])}" if row["who"] else ""
    colour = _colour(snapshot, name)
    badge = (
        f'<span style="border:1px solid {colour};color:{colour};border-radius:9px;padding:0 8px;'
        f'font-size:0.85em;font-weight:600;white-space:nowrap">{_text(word)}{who}</span>'
    )
    return _block(
        f'<div style="display:flex;flex-wrap:wrap;gap:4px 8px;align-items:center"><b>{names}</b>{badge}</div>'
    )


def value(snapshot: Snapshot) -> str:
    """The value against the threshold, as words and as a bar."""
    held, threshold = snapshot["value"], snapshot["threshold"]
    if held is None:
        return _block(f'<span style="{FAINT}">No value yet. Threshold {threshold:.2f} m</span>')
    colour = _colour(snapshot, "good" if snapshot["above"] else "bad")
    side = "above" if snapshot["above"] else "not above"
    words = (
        f'<div style="{NUMBERS}"><span style="font-size:1.5em;font-weight:650">{held:.2f} m</span> '
        f'<span style="color:{colour};font-weight:600">{side} the threshold</span> '
        f'<span style="{FAINT}">of {threshold:.2f} m</span></div>'
    )
    return _block(words + _bar(held, threshold, colour))


def _bar(held: float, threshold: float, colour: str) -> str:
    full = ROOM * max(held, threshold) or 1.0
    return (
        '<div style="position:relative;height:8px;border-radius:4px;margin:4px 0 2px;'
        'background:var(--mantine-color-default-border)">'
        f'<div style="width:{100.0 * held / full:.1f}%;height:8px;border-radius:4px;background:{colour}"></div>'
        f'<div style="position:absolute;left:{100.0 * threshold / full:.1f}%;top:-3px;width:2px;height:14px;'
        'background:var(--mantine-color-text)"></div></div>'
    )


def candidate(snapshot: Snapshot) -> str:
    """Rank and pose of the candidate that is shown."""
    if snapshot["candidate"] is None:
        return _block(f'<span style="{FAINT}">No candidate</span>')
    rank = f"<b>Candidate {snapshot['candidate'] + 1}</b> of {snapshot['candidates']}"
    (a, b), (c, d) = snapshot["angles"]
    angles = f'<div style="{FAINT}">angle of segments {a}, {b} on that of {c}, {d}</div>'
    return _block(f'{rank}<div style="{NUMBERS}">{_pose(snapshot["pose"])}</div>{angles}')


def _pose(pose: Mapping[str, float] | None) -> str:
    if pose is None:
        return "–"
    x, y = _number(pose["x"], 2), _number(pose["y"], 2)
    return f"x {x} m, y {y} m, θ {_number(math.degrees(pose['theta']), 1)}°"


def _number(number: float, digits: int) -> str:
    """With a minus sign, which zero has not."""
    return f"{round(number, digits) + 0.0:.{digits}f}".replace("-", "−")


def heuristics(snapshot: Snapshot) -> str:
    """What each heuristic did on this pair: poses tried, time, best value."""
    cells = "".join(_heuristic(told) for told in snapshot["heuristics"])
    head = "".join(
        f'<th style="text-align:{side};font-weight:500">{word}</th>'
        for word, side in (("Heuristic", "left"), ("Tried", "right"), ("ms", "right"), ("Best, m", "right"))
    )
    table = (
        f'<table style="width:100%;border-collapse:collapse;{NUMBERS}"><tr style="{FAINT}">{head}</tr>{cells}</table>'
    )
    shown = next((told for told in snapshot["heuristics"] if told["selected"]), None)
    pose = (
        "" if shown is None or shown["pose"] is None else f'<div style="{FAINT}">best at {_pose(shown["pose"])}</div>'
    )
    return _block(table + pose)


def _heuristic(told: Mapping[str, Any]) -> str:
    look = "font-weight:700;background:var(--mantine-color-default-hover)" if told["selected"] else ""
    tried = "–" if told["tried"] is None else f"{told['tried']:,}".replace(",", " ")
    if told["draws"] is not None:
        tried += f"<br><span style='{FAINT};font-weight:400'>of {told['draws']:,} draws</span>".replace(",", " ")
    spent = "–" if told["milliseconds"] is None else f"{told['milliseconds']:.0f}"
    best = "–" if told["value"] is None else f"{told['value']:.2f}"
    numbers = "".join(f'<td style="text-align:right;padding:1px 0">{cell}</td>' for cell in (tried, spent, best))
    mark = "▸ " if told["selected"] else ""
    return f'<tr style="{look}"><td style="padding:1px 4px 1px 0">{mark}{_text(told["heuristic"])}</td>{numbers}</tr>'


def legend(snapshot: Snapshot) -> str:
    """What the visible layers show, in which colours and units."""
    rows = "".join(_layer(layer) for layer in snapshot["layers"] if layer["visible"])
    return _block(rows or f'<span style="{FAINT}">All layers are switched off.</span>')


def _layer(layer: Mapping[str, Any]) -> str:
    swatches = "".join(
        f'<span style="display:inline-block;width:{max(3, 18 // len(layer["colours"]))}px;height:10px;'
        f'background:{_text(colour)}"></span>'
        for colour in layer["colours"][:6]
    )
    return (
        '<div style="display:flex;gap:6px;margin-bottom:3px;line-height:1.3">'
        f'<span style="flex:0 0 20px;white-space:nowrap;line-height:1">{swatches}</span>'
        f'<span><b style="font-weight:600">{_text(layer["title"])}</b> [{_text(layer["unit"])}]: '
        f'<span style="{FAINT}">{_text(layer["caption"])}</span></span></div>'
    )


def messages(snapshot: Snapshot) -> str:
    """What there is to say about the pair and the last action."""
    said = "".join(f"<div>{_text(message)}</div>" for message in snapshot["messages"])
    if not said:
        return ""
    style = "border-left:3px solid var(--mantine-color-blue-6);padding:2px 8px"
    return _block(f'<div role="status" style="{style}">{said}</div>')


def picked(snapshot: Snapshot) -> str:
    """What the clicked segment is, and what it adds to the value."""
    told = snapshot["picked"]
    if told is None:
        return _block(f'<span style="{FAINT}">Click a segment to see what it adds to the value.</span>')
    size = f"{told['length']:.2f} m long, heading {_number(told['heading'], 1)}°"
    if "adds" not in told:
        scans = ", ".join(_text(scan) for scan in told["scans"])
        return _block(f"<b>Segment {told['segment']}</b> of the map, {size}; seen by {_scans(scans)}")
    head = f"<b>Segment {told['segment']}</b> of {_text(told['name'])}, {size}"
    if told["chain"] is None:
        return _block(f"{head}<div>matches nothing: it adds 0 m</div>")
    chain = told["chain"]
    swatch = f'<span style="display:inline-block;width:10px;height:10px;background:{_text(chain["colour"])}"></span>'
    adds = f"<div>adds <b>{told['adds']:.2f} m</b> of {snapshot['value']:.2f} m</div>"
    partners = ", ".join(f"{match['segment']} ({match['value']:.2f} m)" for match in told["matches"])
    whole = f"{swatch} chain {chain['number']}: {_count(chain['segments'], 'segment')}, {chain['value']:.2f} m"
    return _block(f"{head}{adds}<div>matches {partners}</div><div>{whole}</div>")


def _scans(scans: str) -> str:
    return f"scan {scans}" if scans else "no scan: it connects others"


def exports(project: str) -> str:
    """Links to the merged map as files."""
    place = f"/api/projects/{_text(project)}/export"
    links = " · ".join(
        f'<a href="{place}/{kind}" download style="color:var(--mantine-color-anchor)">{name}</a>'
        for kind, name in (("geojson", "GeoJSON"), ("svg", "SVG"))
    )
    return _block(f"Merged map as {links}")


def _block(content: str) -> str:
    return f'<div style="padding:0 0.75em 0.5em;font-size:0.875em;overflow-wrap:anywhere">{content}</div>'


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _colour(snapshot: Snapshot, name: str) -> str:
    return hexadecimal(getattr(PALETTES[snapshot["theme"]], name))


def _text(text: object) -> str:
    return escape(str(text), quote=True)
