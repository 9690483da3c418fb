"""A merged map as a report for people: one HTML file that needs nothing else and runs nothing.

First how far the map can be trusted, in plain words; then what that rests on. Without a record (a map
that was not made in a project) it tells of the map alone.
"""

from __future__ import annotations

from collections.abc import Iterator

from segmap.export.components import Content, ExportFormat
from segmap.export.report import sections
from segmap.export.report.markup import Html, joined, tag
from segmap.export.report.style import STYLE
from segmap.export.report.trust import LOW_AGREEMENT, Sentence, Trust, trust
from segmap.export.sheet import title_of

__all__ = ["LOW_AGREEMENT", "REPORT", "Sentence", "Trust", "trust", "write_report"]

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


def write_report(content: Content) -> bytes:
    """The report of a map; the same input gives the same bytes."""
    title = f"{title_of(content.metadata)}: report"
    head = tag(
        "head",
        Html('<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'),
        Html(f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'),
        tag("title", title),
        tag("style", Html(STYLE)),
    )
    body = tag("body", tag("main", tag("h1", title), _about(content), _sections(content)))
    return joined(Html("<!doctype html>\n"), tag("html", head, body, lang="en"), "\n").encode("utf-8")


def _about(content: Content) -> Html:
    told = content.metadata
    words = f"segmap {told.get('version', 'of unknown version')}, map {told.get('map_hash', 'unnamed')[:12]}"
    record = content.record
    when = (
        ""
        if record is None
        else f", revision {told.get('revision', '')} of {record.state.modified[:16].replace('T', ' ')} UTC"
    )
    return tag("p", words + when + ".", class_="about")


def _sections(content: Content) -> Iterator[Html | None]:
    record = content.record
    if record is not None:
        yield sections.answer(record, content.components)
    yield sections.maps(content)
    yield sections.parts(content)
    if record is not None:
        yield sections.graph(record, content.components)
        yield sections.looks(record)
        yield sections.decisions(record)
        yield sections.logs(record)
        yield sections.settings(record)
    yield sections.provenance(content)


REPORT = ExportFormat(
    name="report",
    suffix=".html",
    media_type="text/html",
    title="HTML",
    use="how far to trust the map, decisions, evidence; one file, opens offline",
    write=write_report,
    holds="Report",
    needs_record=True,
)
