"""Walkthroughs as files: one HTML file that plays without a network, a series of PNGs, an animated GIF."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from app.errors import RequestError, UnknownError
from app.resources import program_version, static_folder
from app.walk_pictures import picture
from app.walks import document, stage_document
from segmap.walkthrough import Stage, Step, Walkthrough

__all__ = ["KINDS", "MOST_FRAMES", "WalkFile", "frames", "offline", "walk_file"]

SCRIPTS = ("dom.js", "walk/figure.js", "walk/chart.js", "walk/player.js", "walk/offline.js")
STYLES = ("base.css", "figures.css", "walk.css")
IMPORT = re.compile(r"^import .*?;$\n?", re.MULTILINE)
EXPORT = re.compile(r"^export ", re.MULTILINE)
WHOLE = 400
"""steps of a stage up to which all are in a file"""
CHOSEN = 240
"""and about how many are, where there are more"""
MOST_FRAMES = 120
"""pictures of a series"""
SECONDS = 1.6
"""of each picture of an animation"""
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


@dataclass(frozen=True)
class WalkFile:
    """A file to save."""

    suffix: str
    media_type: str
    content: bytes


# --- which steps ------------------------------------------------------------------------------------


def chosen(stage: Stage, most: int = CHOSEN, whole: int = WHOLE) -> list[int]:
    """The steps of a stage that go into a file: all of few; of many the first, the last, and those worth a stop."""
    if stage.count <= whole:
        return list(range(stage.count))
    marked = {mark.index for mark in stage.marks} | {0, stage.count - 1}
    stops = stage.stops or range(0, stage.count, max(1, stage.count // most))
    return sorted(marked | set(_thinned(stops, most)))


def _thinned(steps: Sequence[int], most: int) -> list[int]:
    stride = max(1, -(-len(steps) // most))
    return list(steps[::stride])


def _stages(walk: Walkthrough) -> Iterator[Stage]:
    """Every stage, and after the values of the candidates some of them pair by pair."""
    known = {stage.id for stage in walk.stages}
    for stage in walk.stages:
        yield stage
        if stage.id == "evaluation":
            discarded = [mark.index for mark in stage.marks if "discarded" in mark.label]
            for index in discarded[:1]:
                entered = (stage.step(index).enter or {}).get("stage")
                more = walk.stage(entered) if entered and entered not in known else None
                if more is not None:
                    yield more


# --- one HTML file ----------------------------------------------------------------------------------


def offline(walk: Walkthrough) -> str:
    """A page that holds everything: it plays from disk, without a network.

    Of stages with very many steps only some are in it; their titles say how many.
    """
    stages = [(stage, chosen(stage)) for stage in _stages(walk)]
    ids = {stage.id for stage, _ in stages}
    held = document(walk)
    held["stages"] = [_shortened(stage, rows) for stage, rows in stages]
    steps = {stage.id: [_without_ways_out(stage.step(k), ids) for k in rows] for stage, rows in stages}
    about = f"Made by segmap {program_version()}. Space plays, the arrows go step by step."
    data = json.dumps({"walk": held, "steps": steps, "about": about}, allow_nan=False, separators=(",", ":"))
    return _page(walk.title, data.replace("<", "\\u003c"))


def _shortened(stage: Stage, rows: list[int]) -> dict[str, Any]:
    """A stage of which only some steps are in the file."""
    held, place = stage_document(stage), {row: number for number, row in enumerate(rows)}
    if len(rows) < stage.count:
        held["about"] += f" This file holds {len(rows)} of its {stage.count} steps."
    held["count"] = len(rows)
    held["marks"] = [[place[index], label] for index, label in held["marks"] if index in place]
    held["stops"] = [place[stop] for stop in held["stops"] if stop in place] if len(rows) == stage.count else []
    return held


def _without_ways_out(step: Step, ids: set[str]) -> dict[str, Any]:
    told = step.to_json()
    if "enter" in told and told["enter"].get("stage") not in ids:
        del told["enter"]
    return told


def _page(title: str, data: str) -> str:
    static = static_folder()
    styles = "\n".join((static / "css" / name).read_text("utf-8") for name in STYLES)
    scripts = "\n".join(_plain((static / "js" / name).read_text("utf-8")) for name in SCRIPTS)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{escape(POLICY)}">
<title>{escape(title)}</title>
<style>
{styles}
</style>
</head>
<body class="walk">
<header class="walk-bar"><h1>{escape(title)}</h1><p id="about"></p></header>
<main id="player" class="player"></main>
<script type="application/json" id="walk">{data}</script>
<script type="module">
{scripts}
</script>
</body>
</html>
"""


def _plain(script: str) -> str:
    """A module as part of one script: the modules it imports come before it."""
    return EXPORT.sub("", IMPORT.sub("", script))


# --- pictures ---------------------------------------------------------------------------------------


def frames(walk: Walkthrough, stage: str = "", most: int = MOST_FRAMES) -> list[tuple[Stage, int]]:
    """The steps that are drawn, as stage and number: those worth a stop, of one stage or of all.

    Raises:
        UnknownError: there is no such stage.
    """
    found = walk.stage(stage) if stage else None
    if stage and found is None:
        raise UnknownError(f"This walkthrough has no stage {stage[:80]!r}.")
    stages = [found] if found else list(walk.stages)
    share = max(1, most // len(stages))
    return [(one, k) for one in stages for k in _thinned(chosen(one, share, share), share)][:most]


def _series(walk: Walkthrough, shown: Iterable[tuple[Stage, int]]) -> bytes:
    """Numbered PNGs in a zip archive."""
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_STORED) as archive:
        for number, (stage, k) in enumerate(shown, start=1):
            image = io.BytesIO()
            picture(walk, stage, k).save(image, "PNG", optimize=True)
            name = f"{number:03d}-{stage.id.replace(':', '-')}-{k + 1}.png"
            archive.writestr(zipfile.ZipInfo(name), image.getvalue())
    return written.getvalue()


def _animation(walk: Walkthrough, shown: Sequence[tuple[Stage, int]]) -> bytes:
    images = [picture(walk, stage, k).quantize(128) for stage, k in shown]
    written = io.BytesIO()
    images[0].save(
        written, "GIF", save_all=True, append_images=images[1:], duration=int(1000 * SECONDS), loop=0, disposal=1
    )
    return written.getvalue()


KINDS = ("html", "zip", "gif")
"""one page, a series of PNGs, an animation"""


def walk_file(walk: Walkthrough, kind: str, stage: str = "", most: int = MOST_FRAMES) -> WalkFile:
    """A walkthrough as a file; pictures of one stage, or of all.

    Raises:
        RequestError: there is no such kind.
        UnknownError: there is no such stage.
    """
    if kind == "html":
        return WalkFile(".html", "text/html", offline(walk).encode())
    if kind == "zip":
        return WalkFile(".zip", "application/zip", _series(walk, frames(walk, stage, most)))
    if kind == "gif":
        return WalkFile(".gif", "image/gif", _animation(walk, frames(walk, stage, most)))
    raise RequestError(f"There is no walkthrough as {kind[:20]!r}. Kinds are: {', '.join(KINDS)}.")
