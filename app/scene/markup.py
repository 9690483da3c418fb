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
from app.sights import CLASSES
from segmap.export import FORMATS
from segmap.verdict import told as rounded

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
        + _reviewer(snapshot)
    )


def _reviewer(snapshot: Snapshot) -> str:
    """Whose decision the next one is, and the reason that goes with it."""
    said = [f"You decide as {_text(snapshot['who'])}."] if snapshot["who"] else []
    said += [f"Reason: {_text(snapshot['reason'])}"] if snapshot["reason"] else []
    return f'<div style="{FAINT}">{" ".join(said)}</div>' if said else ""


def value(snapshot: Snapshot) -> str:
    """What the threshold is about against it, as words and as a bar; and the evidence, where there is any."""
    return _block(_judged(snapshot) + _evidence(snapshot))


def _judged(snapshot: Snapshot) -> str:
    criterion, threshold = snapshot["criterion"], snapshot["threshold"]
    if snapshot["held"] or snapshot["origin"] == "nudged":
        return _by_hand(snapshot)
    held = snapshot[criterion["quantity"]]
    if snapshot["behind"] is not None and snapshot["above"] is None:
        return (
            f'<div style="{NUMBERS}"><b>Rival</b> <span style="{FAINT}">scores {snapshot["behind"]:.2f} m less than '
            "the best; the confidence is about the best</span></div>"
        )
    if snapshot["candidate"] is None or held is None:
        return f'<span style="{FAINT}">No {criterion["quantity"]} yet. Threshold {_amount(threshold, criterion)}</span>'
    words, colour = _side(snapshot, held)
    amount = _told(held, threshold, criterion)
    told = (
        f'<div style="{NUMBERS}"><span style="font-size:1.5em;font-weight:650">{amount}</span> '
        f'<span style="color:{colour};font-weight:600">{words} the threshold</span> '
        f'<span style="{FAINT}">of {_amount(threshold, criterion)}</span></div>'
    )
    return told + _bar(held, threshold, colour, criterion["maximum"]) + _doubts(snapshot, colour)


def _by_hand(snapshot: Snapshot) -> str:
    """What the place is worth where the second scan is held, or was laid by hand."""
    what = "value" if snapshot["score"] is None else "score"
    behind = snapshot["behind"]
    compared = (
        "" if behind is None else f"{abs(behind):.2f} m {'less' if behind >= 0.0 else 'more'} than the best found"
    )
    where = "held by hand" if snapshot["held"] else "laid by hand"
    return (
        f'<div style="{NUMBERS}"><span style="font-size:1.5em;font-weight:650">{_number(snapshot[what], 2)} m</span> '
        f'<b>{what}</b>, {where}</div><div style="{FAINT};{NUMBERS}">{compared}</div>'
    )


def _side(snapshot: Snapshot, held: float) -> tuple[str, str]:
    """On which side of the threshold the candidate is, in words and in a colour."""
    enough, short = ("at or above", "below") if snapshot["criterion"]["inclusive"] else ("above", "not above")
    if snapshot["above"]:
        return enough, _colour(snapshot, "good")
    if snapshot["verdict"] == "review":
        doubtful = _colour(snapshot, "doubtful")
        return (f"in doubt, though {enough}" if held >= snapshot["threshold"] else short), doubtful
    return short, _colour(snapshot, "bad")


def _doubts(snapshot: Snapshot, colour: str) -> str:
    """Why the program leaves the pair to a person."""
    if snapshot["verdict"] != "review" or snapshot["candidate"] != 0:
        return ""
    reasons = "".join(f"<div>{_text(reason)}</div>" for reason in snapshot["reasons"])
    return f'<div style="border-left:3px solid {colour};padding:0 8px;margin:4px 0">{reasons}</div>'


def _told(held: float, threshold: float, criterion: Snapshot) -> str:
    """As ``_amount``, but never rounded across the threshold."""
    said = rounded(held, threshold, 2, inclusive=criterion["inclusive"])
    return f"{said} {_text(criterion['unit'] or criterion['quantity'])}"


def _amount(number: float, criterion: Snapshot) -> str:
    return f"{number:.2f} {_text(criterion['unit'] or criterion['quantity'])}"


def _bar(held: float, threshold: float, colour: str, maximum: float | None) -> str:
    full = maximum or ROOM * max(held, threshold) or 1.0
    return (
        '<div style="position:relative;height:8px;border-radius:4px;margin:4px 0 2px;'
        'background:var(--mantine-color-default-border)">'
        f'<div style="width:{100.0 * held / full:.1f}%;height:8px;border-radius:4px;background:{colour}"></div>'
        f'<div style="position:absolute;left:{100.0 * threshold / full:.1f}%;top:-3px;width:2px;height:14px;'
        'background:var(--mantine-color-text)"></div></div>'
    )


def _evidence(snapshot: Snapshot) -> str:
    """What lines of sight say of the candidate shown, and how well its pose is held."""
    found, held = snapshot["evidence"], snapshot["uncertainty"]
    if found is None:
        return ""
    colours = map(hexadecimal, PALETTES[snapshot["theme"]].sights)
    told = "".join(
        f'<div style="white-space:nowrap"><span style="display:inline-block;width:8px;height:8px;border-radius:4px;'
        f'background:{colour}"></span> {found[name]:.1f} m {name}</div>'
        for name, colour in zip(CLASSES, colours, strict=True)
    )
    lines = [
        f'<div style="display:grid;grid-template-columns:1fr 1fr;gap:0 8px;{NUMBERS}">{told}</div>',
        f'<div style="{FAINT};{NUMBERS}">score {_number(snapshot["score"], 2)} m, '
        f"value {snapshot['value']:.2f} m</div>",
    ]
    if held is not None:
        heading = _number(math.degrees(held["weak_heading"]), 0)
        lines.append(
            f'<div style="{FAINT};{NUMBERS}">weakest direction {heading}°: ± {100.0 * held["weakest"]:.1f} cm</div>'
        )
    return "".join(lines)


def candidate(snapshot: Snapshot) -> str:
    """Rank and pose of the candidate that is shown."""
    if snapshot["held"]:
        return _block(f'<b>Held by hand</b><div style="{NUMBERS}">{_pose(snapshot["pose"])}</div>')
    if snapshot["candidate"] is None:
        return _block(f'<span style="{FAINT}">No candidate</span>')
    rank = f"<b>Candidate {snapshot['candidate'] + 1}</b> of {snapshot['candidates']}"
    (a, b), (c, d) = snapshot["angles"]
    if snapshot["origin"] != "found":
        said = "laid by hand" if snapshot["origin"] == "nudged" else "claimed"
        return _block(f'{rank}<div style="{NUMBERS}">{_pose(snapshot["pose"])}</div><div style="{FAINT}">{said}</div>')
    said = f"segment {a} laid on segment {c}" if a == b else f"angle of segments {a}, {b} on that of {c}, {d}"
    angles = f'<div style="{FAINT}">{said}</div>'
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
    """What each heuristic did on this pair: poses tried, time, and how good its best is."""
    quantity = snapshot["criterion"]["quantity"]
    cells = "".join(_heuristic(told, quantity) for told in snapshot["heuristics"])
    best = "Best, m" if quantity == "value" else "Confidence"
    head = "".join(
        f'<th style="text-align:{side};font-weight:500">{word}</th>'
        for word, side in (("Heuristic", "left"), ("Tried", "right"), ("ms", "right"), (best, "right"))
    )
    table = (
        f'<table style="width:100%;border-collapse:collapse;{NUMBERS}"><tr style="{FAINT}">{head}</tr>{cells}</table>'
    )
    shown = next((told for told in snapshot["heuristics"] if told["selected"]), None)
    pose = (
        "" if shown is None or shown["pose"] is None else f'<div style="{FAINT}">best at {_pose(shown["pose"])}</div>'
    )
    return _block(table + pose)


def _heuristic(told: Mapping[str, Any], quantity: str) -> str:
    look = "font-weight:700;background:var(--mantine-color-default-hover)" if told["selected"] else ""
    tried = "–" if told["tried"] is None else f"{told['tried']:,}".replace(",", " ")
    if told["draws"] is not None:
        tried += f"<br><span style='{FAINT};font-weight:400'>of {told['draws']:,} draws</span>".replace(",", " ")
    spent = "–" if told["milliseconds"] is None else f"{told['milliseconds']:.0f}"
    best = "–" if told[quantity] is None else f"{told[quantity]:.2f}"
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
    if told["source"] == "chain":
        return _block(f"<b>The segments of a chain</b><div>{_chain(told['chain'])}</div>")
    size = f"{told['length']:.2f} m long, heading {_number(told['heading'], 1)}°"
    if "adds" not in told:
        return _block(_wall(told, size))
    head = f"<b>Segment {told['segment']}</b> of {_text(told['name'])}, {size}"
    if told["chain"] is None:
        return _block(f"{head}<div>matches nothing: it adds 0 m</div>")
    adds = f"<div>adds <b>{told['adds']:.2f} m</b> of {snapshot['value']:.2f} m</div>"
    partners = ", ".join(f"{match['segment']} ({match['value']:.2f} m)" for match in told["matches"])
    return _block(f"{head}{adds}<div>matches {partners}</div><div>{_chain(told['chain'])}</div>")


def _chain(chain: Mapping[str, Any]) -> str:
    swatch = f'<span style="display:inline-block;width:10px;height:10px;background:{_text(chain["colour"])}"></span>'
    return f"{swatch} chain {chain['number']}: {_count(chain['segments'], 'segment')}, {chain['value']:.2f} m"


def _wall(told: Mapping[str, Any], size: str) -> str:
    """A wall of the merged map: which scans saw it, and which decisions put it there."""
    scans = ", ".join(_text(scan) for scan in told["scans"])
    off = f", {100.0 * told['misfit']:.1f} cm misfit" if told["misfit"] is not None else ""
    head = f"<b>Segment {told['segment']}</b> of the map, {size}{off}; seen by {_scans(scans)}"
    decided = "".join(
        f"<div>{_text(one['id'])}, accepted{' by ' + _text(one['who']) if one['who'] else ''}</div>"
        for one in told["integrations"]
    )
    more = f"<div>and {told['more']} more</div>" if told["more"] else ""
    return f'{head}<div style="{FAINT}">{decided}{more}</div>'


def _scans(scans: str) -> str:
    return f"scan {scans}" if scans else "no scan: it connects others"


def exports(project: str) -> str:
    """Links to the merged map as files."""
    place = f"/api/projects/{_text(project)}/export"
    links = " · ".join(
        f'<a href="{place}/{kind}" download style="color:var(--mantine-color-anchor)">{name}</a>'
        for kind, name in ((format.name, format.title) for format in FORMATS.values())
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
