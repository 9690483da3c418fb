"""How far a map can be trusted, in plain words: what speaks for it, what against it, what nobody knows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from segmap.events import Decision
from segmap.export.components import MapComponent
from segmap.export.record import PairTold, Record

__all__ = ["LOW_AGREEMENT", "Sentence", "Trust", "count", "trust"]

LOW_AGREEMENT = 0.8
"""of what both scans could judge, the share that must agree before an accepted integration raises no question"""
NAMED = 8
"""integrations or scans named in a sentence"""


@dataclass(frozen=True)
class Sentence:
    """A thing one should know."""

    side: str
    """``for``, ``against`` or ``unknown``"""
    words: str


@dataclass(frozen=True)
class Trust:
    """The answer, in one line and in full."""

    level: str
    """``none``, ``doubtful``, ``unchecked``, ``partly`` or ``checked``"""
    headline: str
    sentences: tuple[Sentence, ...]


def trust(record: Record, components: Sequence[MapComponent]) -> Trust:
    """What there is to say, from the record alone."""
    facts = _Facts(record, components)
    if not facts.accepted:
        return Trust("none", "There is no map yet: nothing is accepted.", tuple(_open(facts)))
    level, headline = _level(facts)
    said = (*_coverage(facts), *_people(facts), *_geometry(facts), *_loops(facts), *_held(facts), *_open(facts))
    order = ("against", "unknown", "for")
    return Trust(level, headline, tuple(sorted(said, key=lambda one: order.index(one.side))))


@dataclass(frozen=True, eq=False)
class _Facts:
    record: Record
    components: Sequence[MapComponent]

    @cached_property
    def accepted(self) -> tuple[PairTold, ...]:
        return tuple(pair for pair in self.record.pairs if pair.state == "accepted")

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        return tuple(pair.decision for pair in self.accepted if pair.decision is not None)

    @cached_property
    def silenced(self) -> tuple[str, ...]:
        return tuple(residual.edge.name for residual in self.record.optimised.silenced)

    @cached_property
    def contradicted(self) -> tuple[str, ...]:
        told = [(p.evidence.agreement, p.integration) for p in self.accepted if p.evidence is not None]
        return tuple(name for agreement, name in sorted(told) if agreement < LOW_AGREEMENT)

    @cached_property
    def against_advice(self) -> tuple[str, ...]:
        return tuple(pair.integration for pair in self.accepted if pair.verdict == "rejected")

    @cached_property
    def doubtful(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.silenced, *self.contradicted, *self.against_advice)))

    @cached_property
    def loops(self) -> int:
        return sum(one.edges - len(one.scans) + 1 for one in self.record.strengths)

    @cached_property
    def bridges(self) -> tuple[str, ...]:
        return tuple(edge.name for one in self.record.strengths for edge in one.bridges)


def _level(facts: _Facts) -> tuple[str, str]:
    doubtful, bridges = len(facts.doubtful), len(facts.bridges)
    if doubtful:
        are = "is" if doubtful == 1 else "are"
        return (
            "doubtful",
            f"Look again before you rely on it: {count(doubtful, 'accepted integration')} {are} in doubt.",
        )
    if not facts.loops:
        return (
            "unchecked",
            "Each step was checked, the whole was not: no loop closes, so small errors add up along the way.",
        )
    if bridges:
        what = "holds a part by itself" if bridges == 1 else "each hold a part by themselves"
        return "partly", f"Checked where loops close; {count(bridges, 'integration')} {what}."
    return "checked", "The map agrees with itself: every part of it is held in at least two ways."


def _coverage(facts: _Facts) -> Iterator[Sentence]:
    placed = sum(len(part.scans) for part in facts.components)
    total, parts = len(facts.record.scans), len(facts.components)
    left = total - placed
    yield Sentence("unknown" if left else "for", f"The map holds {placed} of {count(total, 'scan')}.")
    if parts > 1:
        yield Sentence(
            "unknown",
            f"It is in {parts} parts, and nothing is known of how they lie to each other: distances between two parts"
            " mean nothing.",
        )


def _people(facts: _Facts) -> Iterator[Sentence]:
    decided = Counter(decision.who or "somebody who gave no name" for decision in facts.decisions)
    who = ", ".join(f"{name} ({number})" for name, number in decided.most_common())
    yield Sentence("for", f"{count(len(facts.decisions), 'integration')} accepted, by {who}.")
    steps = Counter(decision.seq for decision in facts.decisions)
    bulk = sum(number for number in steps.values() if number > 1)
    if bulk:
        words = f"{count(bulk, 'integration')} were accepted together with others in one step"
        yield Sentence("unknown", f"{words}: nobody need have looked at each.")
    if facts.against_advice:
        named = _named(facts.against_advice)
        yield Sentence("against", f"Accepted though the program would reject the pose: {named}.")


def _geometry(facts: _Facts) -> Iterator[Sentence]:
    told = [p.evidence.agreement for p in facts.accepted if p.evidence is not None]
    unseen = len(facts.accepted) - len(told)
    if facts.contradicted:
        yield Sentence(
            "against",
            f"In {count(len(facts.contradicted), 'accepted integration')} the two scans agree on less than"
            f" {LOW_AGREEMENT:.0%} of what both could see: {_named(facts.contradicted)}.",
        )
    elif told:
        yield Sentence(
            "for", f"In every accepted integration the two scans agree on at least {min(told):.0%} of what both see."
        )
    if unseen:
        yield Sentence("unknown", f"Of {count(unseen, 'accepted integration')} it is not known what the beams say.")
    sure = [p.confidence for p in facts.accepted if p.confidence is not None]
    if sure:
        yield Sentence(
            "for" if min(sure) >= 0.5 else "against", f"The least sure of them has confidence {min(sure):.2f}."
        )


def _loops(facts: _Facts) -> Iterator[Sentence]:
    optimised = facts.record.optimised
    if facts.silenced:
        yield Sentence(
            "against", f"The rest of the map contradicts, so the optimiser leaves out: {_named(facts.silenced)}."
        )
    if not facts.loops:
        yield Sentence("unknown", "No loop closes: nothing would show an error that grew along the way.")
        return
    kept = [residual for residual in optimised.residuals if not residual.silenced]
    worst = max(kept, key=lambda residual: residual.chi)
    yield Sentence(
        "for",
        f"{count(facts.loops, 'loop')} {'closes' if facts.loops == 1 else 'close'}. The integration that fits worst,"
        f" {worst.edge.name}, is {worst.translation:.2f} m and {math.degrees(worst.rotation):.1f} degrees off.",
    )
    factor = optimised.variance_factor
    if factor is not None and factor > 4.0:
        yield Sentence(
            "against", f"Residuals are {math.sqrt(factor):.1f} times larger than the scans' noise explains on average."
        )


def _held(facts: _Facts) -> Iterator[Sentence]:
    if facts.bridges:
        yield Sentence(
            "unknown",
            f"{count(len(facts.bridges), 'integration')} alone hold two parts together, and nothing checks them:"
            f" {_named(facts.bridges)}."
            if len(facts.bridges) > 1
            else f"{facts.bridges[0]} alone holds two parts together, and nothing checks it.",
        )
    for number, one in enumerate(facts.record.strengths, 1):
        part = f"In component {number}, " if len(facts.record.strengths) > 1 else ""
        sure = f"± {one.deviation:.2f} m (standard deviation) as seen from scan {one.scans[0]}"
        words = f"{part}scan {one.softest} is placed least surely: {sure}."
        yield Sentence("for" if one.deviation < 0.5 else "unknown", words[0].upper() + words[1:])


def _open(facts: _Facts) -> Iterator[Sentence]:
    pending = [pair for pair in facts.record.pairs if pair.state == "pending"]
    if pending:
        yield Sentence("unknown", _undecided(len(pending), sum(pair.verdict == "accepted" for pair in pending)))
    failed = sum(pair.state in ("none", "failed", "matching") for pair in facts.record.pairs)
    if failed:
        yield Sentence("unknown", f"For {count(failed, 'pair')} no transformation is known.")


def _undecided(pending: int, would: int) -> str:
    if pending == 1:
        return f"1 pair is not decided yet; the program would {'' if would else 'not '}accept it."
    return f"{pending} pairs are not decided yet; the program would accept {would} of them."


def _named(names: Sequence[str]) -> str:
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


def count(number: int, noun: str) -> str:
    """``1 scan``, ``2 scans``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
