"""The sections of a report, each from the record to markup."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from segmap.events import IntegrationId
from segmap.export.components import Content, MapComponent
from segmap.export.record import PairTold, Record
from segmap.export.report.markup import Child, Html, joined, table, tag
from segmap.export.report.pictures import CLASSES, graph_picture, map_picture, pair_picture
from segmap.export.report.trust import LOW_AGREEMENT, Trust, count, trust
from segmap.graph import Residual, explain
from segmap.parameters import describe
from segmap.segments import SegmentMap

__all__ = ["answer", "decisions", "graph", "logs", "looks", "maps", "parts", "provenance", "settings"]

PICTURED = 24
"""pairs that are shown in pictures, the most doubtful ones"""
EXPLAINED = 20
"""integrations the graph is asked about in words, those that fit worst"""
LISTED = 400
"""scans that are listed one by one"""
SIDES = {"against": "Speaks against it", "unknown": "Not known", "for": "Speaks for it"}
KINDS = {"neighbour": "neighbours", "closure": "loop search", "imported": "imported", "manual": "by hand"}


def answer(record: Record, components: Sequence[MapComponent]) -> Html:
    """How far one can trust the map, before everything else."""
    told = trust(record, components)
    return tag("section", tag("h2", "How far can I trust this map?"), _headline(told), _sides(told), class_="answer")


def _headline(told: Trust) -> Html:
    return tag("p", told.headline, class_=f"headline {told.level}")


def _sides(told: Trust) -> Iterator[Html]:
    for side, title in SIDES.items():
        words = [one.words for one in told.sentences if one.side == side]
        if words:
            yield joined(tag("h3", title, class_=side), tag("ul", [tag("li", sentence) for sentence in words]))


def maps(content: Content) -> Html:
    """The merged map in pictures."""
    title = tag("h2", "The map")
    if not any(len(part.map) for part in content.components):
        return tag("section", title, tag("p", "The map has no segments."))
    words = "Blue: walls that several scans saw. Orange: seen by a single scan. Grey: put in between to connect walls."
    if content.record is None:
        words = "Blue: several scans. Orange: one scan. Grey: none, or unknown."
    return tag("section", title, _figure(map_picture(content.components), words))


def _figure(picture: Html, words: Child) -> Html:
    return tag("figure", picture, tag("figcaption", words))


def parts(content: Content) -> Html:
    """The components, with their scans, and the scans that are in none."""
    head = ("Component", "Scans", "Segments", "Length, m", "Integrations", "Which scans")
    rows = [_part(part, content) for part in content.components]
    record, held = content.record, {scan for part in content.components for scan in part.scans}
    left = [str(scan) for scan in record.scans if scan not in held] if record is not None else []
    alone = tag("p", f"Not placed: {_ids(left)}") if left else None
    return tag("section", tag("h2", "What it is made of"), table("Components of the map", head, rows), alone)


def _part(part: MapComponent, content: Content) -> Iterator[Child]:
    yield part.name
    yield str(len(part.scans))
    yield str(len(part.map))
    yield f"{float(part.map.lengths.sum()):.1f}"
    yield str(len(content.integrations_of(part.scans)))
    yield tag("details", tag("summary", "List"), _ids([str(scan) for scan in part.scans]))


def _ids(names: Sequence[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


# --- the graph ------------------------------------------------------------------------------------


def graph(record: Record, components: Sequence[MapComponent]) -> Html:
    """How firmly the map holds together, and what its loops miss."""
    title = tag("h2", "Loops and strength")
    if not record.optimised.residuals:
        return tag("section", title, tag("p", "Nothing is accepted, so nothing holds together yet."))
    limits = ", ".join(f"{limit:g}" for limit, _ in CLASSES)
    words = (
        f"Each line is an accepted integration: green fits the others, orange fits badly (up to {limits} standard"
        " deviations), red and dashed is left out because the rest contradicts it."
    )
    picture = _figure(graph_picture(components, record), words) if any(len(part.map) for part in components) else None
    return tag("section", title, picture, _strengths(record), _residuals(record))


def _strengths(record: Record) -> Html:
    head = (
        "Component",
        "Scans",
        "Integrations",
        "Loops",
        "Alone hold two parts",
        "Scans on one only",
        "Least sure scan",
    )
    rows = [
        (
            str(number),
            str(len(one.scans)),
            str(one.edges),
            str(one.edges - len(one.scans) + 1),
            ", ".join(edge.name for edge in one.bridges[:PICTURED]) or "none",
            str(len(one.hanging)),
            f"{one.softest}: ± {one.deviation:.2f} m",
        )
        for number, one in enumerate(record.strengths, 1)
    ]
    return table("How firmly each component holds", head, rows)


def _residuals(record: Record) -> Html:
    optimised = record.optimised
    ways, worst = optimised.ways(), sorted(optimised.residuals, key=lambda one: -one.chi)[:EXPLAINED]
    told = [
        tag("li", " ".join(explain(optimised, one, ways)), class_="against" if one.silenced else None) for one in worst
    ]
    summary = tag("summary", f"The {count(len(worst), 'integration')} that fit worst, in words")
    return tag("details", summary, tag("ul", told))


# --- decisions and evidence -----------------------------------------------------------------------


def decisions(record: Record) -> Html:
    """Every pair: what was decided, by whom, on what evidence."""
    fits = {residual.edge.name: residual for residual in record.optimised.residuals}
    head = (
        *("Scans", "Asked because", "Decision", "By", "When (UTC)", "Reason", "Confidence", "Value, m", "Agrees"),
        *(
            "Supported, m",
            "Contradicted, m",
            "Overlap",
            "Weakest, ± cm",
            "Off the graph",
            "Heuristic",
            "Parameters",
            "Version",
        ),
    )
    rows = [_pair(pair, fits.get(pair.integration)) for pair in record.pairs]
    note = (
        "Confidence is the program's, that the pose is right. Agrees: of what both scans could see, the share that is"
        f" the same; below {LOW_AGREEMENT:.0%} it deserves a look. Weakest: how well the walls hold the pose in the"
        " direction in which they hold it least. Parameters are named below."
    )
    title, words = tag("h2", "Decisions, and the evidence for each"), tag("p", note)
    return tag("section", title, words, table(f"All {count(len(rows), 'pair')} of scans", head, rows, "tight"))


def _pair(pair: PairTold, residual: Residual | None) -> Iterator[Child]:
    decision, evidence = pair.decision, pair.evidence
    yield pair.integration
    yield KINDS.get(pair.kind, pair.kind)
    yield tag("span", _state(pair), class_=pair.state)
    yield (decision.who or "no name") if decision else ""
    yield decision.at[:16].replace("T", " ") if decision else ""
    yield tag("span", decision.reason, class_="words") if decision and decision.reason else ""
    yield _number(pair.confidence)
    yield _number(pair.value)
    yield f"{evidence.agreement:.0%}" if evidence else ""
    yield _number(evidence.supported if evidence else None, 1)
    yield _number(evidence.contradicted if evidence else None, 1)
    yield f"{evidence.overlap:.0%}" if evidence else ""
    yield _number(None if pair.weakest is None else 100.0 * pair.weakest, 1)
    yield _fit(residual)
    yield decision.heuristic if decision else ""
    yield decision.parameters[:8] if decision else ""
    yield decision.version if decision else ""


def _state(pair: PairTold) -> str:
    words = {
        "pending": "not decided",
        "none": "no transformation",
        "failed": "matching failed",
        "matching": "not matched",
    }
    return words.get(pair.state, pair.state)


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _fit(residual: Residual | None) -> str:
    if residual is None:
        return ""
    off = f"{residual.translation:.2f} m, {math.degrees(residual.rotation):.1f}°"
    return f"{off} (left out)" if residual.silenced else off


def looks(record: Record) -> Html | None:
    """The pairs that most deserve a look, in pictures."""
    map_of = record.map_of
    if map_of is None:
        return None
    chosen = [(pair, decision) for pair in _doubtful(record) if (decision := pair.decision) and decision.T_1_2]
    figures = []
    for pair, decision in chosen[:PICTURED]:
        (first, second), pose = pair.integration.split("-"), decision.T_1_2
        assert pose is not None
        picture = pair_picture(*_both(record, pair), pose, f"Scans {first} and {second}")
        figures.append(_figure(picture, _look(pair)))
    if not figures:
        return None
    words = (
        f"Of all pairs that were decided, {count(len(figures), 'pair')} with the weakest evidence."
        " Blue: the first scan; orange: the second."
    )
    return tag("section", tag("h2", "Worth a look"), tag("p", words), tag("div", figures, class_="pairs"))


def _both(record: Record, pair: PairTold) -> tuple[SegmentMap, SegmentMap]:
    first, second = IntegrationId.parse(pair.integration)
    assert record.map_of is not None
    return record.map_of(first), record.map_of(second)


def _doubtful(record: Record) -> list[PairTold]:
    """Decided pairs, the one with most to be said against its decision first."""
    silenced = {residual.edge.name for residual in record.optimised.silenced}

    def doubt(pair: PairTold) -> tuple[bool, bool, float, float, str]:
        agreement = pair.evidence.agreement if pair.evidence else 0.0
        confidence = 0.0 if pair.confidence is None else pair.confidence
        against = pair.verdict is not None and pair.verdict != pair.state
        rejected = pair.state == "rejected"
        return (
            pair.integration not in silenced,
            not against,
            -agreement if rejected else agreement,
            -confidence if rejected else confidence,
            pair.integration,
        )

    return sorted((pair for pair in record.pairs if pair.decision is not None), key=doubt)


def _look(pair: PairTold) -> Html:
    told = [f"{pair.state} by {pair.decision.who or 'no name'}" if pair.decision else pair.state]
    if pair.confidence is not None:
        told.append(f"confidence {pair.confidence:.2f}")
    if pair.evidence is not None:
        told.append(f"{pair.evidence.supported:.1f} m agree, {pair.evidence.contradicted:.1f} m contradict")
    return joined(tag("b", pair.integration), ": ", ", ".join(told))


# --- where it comes from --------------------------------------------------------------------------


def logs(record: Record) -> Html:
    """The logs, and what was left out of them."""
    head = ("Log", "Format", "Scans", "Size, bytes", "SHA-256", "No return", "Left out")
    rows = [
        (
            f"{one.info.index}: {one.info.name}" + (f", {one.info.topic}" if one.info.topic else ""),
            one.info.format,
            str(one.info.scans),
            str(one.info.size),
            tag("code", one.info.sha256),
            "" if one.no_return is None else f"{one.no_return:g} m",
            _left_out(one.problems),
        )
        for one in record.logs
    ]
    return tag("section", tag("h2", "Logs"), table("The logs it was made from", head, rows))


def _left_out(problems: Sequence[str]) -> Child:
    if not problems:
        return "nothing"
    shown = [tag("li", problem) for problem in problems[:LISTED]]
    return tag("details", tag("summary", count(len(problems), "line")), tag("ul", shown))


def settings(record: Record) -> Html:
    """Every parameter in force, and the sets that decisions were made under."""
    state = record.state
    held = state.parameters.model_dump(mode="json")
    rows = [
        (one["name"], _value(held[one["name"]]), one["unit"], _value(one["default"]), one["help"])
        for one in sorted(describe(), key=lambda one: held[one["name"]] == one["default"])
    ]
    words = (
        f"Mode {state.mode}, heuristic {state.heuristic}; this set is called {state.fingerprint}. Those changed first."
    )
    used = sorted(
        {p.decision.parameters for p in record.pairs if p.decision and p.decision.parameters} - {state.fingerprint}
    )
    others = [tag("p", _difference(record, name)) for name in used]
    head = ("Parameter", "Value", "Unit", "Default", "What it does")
    return tag("section", tag("h2", "Parameters"), tag("p", words), others, table("Parameters in force", head, rows))


def _value(value: object) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _difference(record: Record, name: str) -> str:
    known = record.state.parameter_sets.get(name)
    if known is None:
        return f"Some decisions were made under the set {name}, which is not known here."
    ours, theirs = (one.model_dump(mode="json") for one in (record.state.parameters, known))
    told = [f"{key} {_value(value)}" for key, value in theirs.items() if ours[key] != value]
    return f"Some decisions were made under the set {name}, with {', '.join(told) or 'the same values'}."


def provenance(content: Content) -> Html:
    """Which program made it, of which revision, and what was done."""
    told = [joined(tag("dt", name), tag("dd", value)) for name, value in sorted(content.metadata.items())]
    words = "The map is made from the logs and the decisions alone: segmap replay PROJECT prints the same map_hash."
    return tag("section", tag("h2", "Where it comes from"), tag("p", words), tag("dl", told), _steps(content.record))


def _steps(record: Record | None) -> Html | None:
    if record is None or not record.state.done:
        return None
    told = [tag("li", f"{step.seq}: {step.who or 'no name'} {step.description}") for step in record.state.done]
    return tag("details", tag("summary", f"What was done, {count(len(told), 'step')}"), tag("ul", told))
