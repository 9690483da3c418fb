"""Every pair of the benchmark that fails, drawn and argued: writes docs/failures.md and docs/failures/.

    python benchmarks/failures.py [--out docs]

The arguments, one for each pair that has failed at some time, are in benchmarks/arguments.json; a pair that fails
and has none is listed as not argued, and one that no longer fails is left out. Beside each: the picture, the scores
at the truth and at what was found, and detours: where scan i and scan j are both matched with a third scan nearby
and both matches are accepted, their composition is an independent opinion on the pair.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from textwrap import fill

from common import POSITIVE, LogPairs, arguments, load, percent, provenance

from segmap.benchmark import RIVALS, Outcome, is_right, run_pairs
from segmap.integration import Verdict, match_maps
from segmap.pair_pictures import Subject, about, draw, name_of
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import SegmentMap, extract

ARGUMENTS = Path(__file__).with_name("arguments.json")
REACH = 12
"""scans before and after either one that a detour may lead over"""
CAUSES = {
    "truth": "the logged pose is wrong",
    "ambiguous": "a person could not have told",
    "method": "the method failed",
}
EXCLUDED = ("truth", "ambiguous")
"""causes for which a pair may be left out of a figure, beside the raw one"""


@dataclass(frozen=True)
class Argument:
    """Why a pair fails."""

    cause: str
    """one of CAUSES"""
    text: str


HEAD = """# Where matching fails
The {failed} of {total} pairs of the benchmark that fail in verified mode at its shipped defaults, each drawn and
argued. Written by `python benchmarks/failures.py`; the arguments are in `benchmarks/arguments.json`.
{provenance}.

A pair fails when the best pose is wrong (off by more than 0.25 m or 5 degrees), when a right one is rejected, or
when two scans without a common wall are accepted. Causes: {counts}.

Pairs whose right pose is among the first {rivals} distinct rivals, mean of the logs:"""
LEGEND = """In the pictures scan 1 is blue and scan 2 orange, arrows are the sensors; red returns are seen through by
the other scan, violet ones lie close behind a surface it sees. A *detour* over a third scan is the composition of two
accepted matches, an opinion on the pair that its own match had no part in."""
COLUMNS = 120
NOT_ARGUED = Argument("method", "Not argued yet.")

Key = tuple[str, int, int]


@dataclass(frozen=True, eq=False)
class Failed:
    """A pair that failed, with its log."""

    held: LogPairs
    outcome: Outcome
    parameters: Parameters

    @property
    def key(self) -> Key:
        """Log, and the numbers of both scans."""
        return self.held.name, self.outcome.pair.i, self.outcome.pair.j

    @property
    def picture(self) -> str:
        """Name of the file with its picture."""
        return f"{name_of(self.held.name, self.outcome)}.svg"

    @property
    def subject(self) -> Subject:
        """What is drawn."""
        return Subject(self.held.log, self.outcome, self.parameters)


def argued(path: Path = ARGUMENTS) -> dict[Key, Argument]:
    """The arguments, by pair.

    Raises:
        SystemExit: a cause is not one of CAUSES.
    """
    held = {
        (one["log"], one["i"], one["j"]): Argument(one["cause"], one["text"]) for one in json.loads(path.read_text())
    }
    for key, argument in held.items():
        if argument.cause not in CAUSES:
            raise SystemExit(f"{path.name}: {key} has the cause {argument.cause!r}; causes are {', '.join(CAUSES)}.")
    return held


def outcomes(logs: Sequence[LogPairs], parameters: Parameters) -> dict[str, list[Outcome]]:
    """Every pair of every log in verified mode, by log."""
    return {one.name: run_pairs(one.pair_set(), one.log, parameters, mode="verified") for one in logs}


# --- a second opinion -----------------------------------------------------------------------------


def detours(held: LogPairs, i: int, j: int, parameters: Parameters) -> list[tuple[int, Pose2]]:
    """``T_i_j`` over a third scan, where both matches are accepted: (third scan, pose)."""

    @cache
    def scan_map(index: int) -> SegmentMap:
        return extract(held.log.scan(index), parameters)

    def accepted(first: int, second: int) -> Pose2 | None:
        match = match_maps(scan_map(first), scan_map(second), parameters, mode="verified")
        return match.T_1_2 if match.verdict is Verdict.ACCEPTED else None

    near = {k for middle in (i, j) for k in range(middle - REACH, middle + REACH + 1)} - {i, j}
    found = []
    for k in sorted(near & set(range(len(held.log)))):
        T_i_k = accepted(i, k)
        T_k_j = None if T_i_k is None else accepted(k, j)
        if T_i_k is not None and T_k_j is not None:
            found.append((k, T_i_k @ T_k_j))
    return found


def told_of_detours(found: Sequence[tuple[int, Pose2]], truth: Pose2 | None, best: Pose2 | None) -> str:
    """Whom the detours agree with, in words."""
    if not found:
        return "No third scan nearby is matched with both and accepted."
    with_truth = [k for k, T in found if is_right(T, truth)]
    with_best = [k for k, T in found if is_right(T, best)]
    scans = ", ".join(str(k) for k, _ in found)
    said = [
        f"the truth ({len(with_truth)})" if with_truth else "",
        f"what was found ({len(with_best)})" if with_best else "",
    ]
    agree = " and ".join(one for one in said if one) or "neither"
    return f"Detours over scan{'s' * (len(found) > 1)} {scans} agree with {agree}."


# --- figures --------------------------------------------------------------------------------------


def figures(by_log: Mapping[str, Sequence[Outcome]], said: Mapping[Key, Argument]) -> list[str]:
    """The share with the right pose among the first rivals: raw, and without the pairs that may be left out."""
    lines = []
    everything = excluded = 0
    for kind in POSITIVE:
        held = {name: [one for one in outcomes if one.pair.kind == kind] for name, outcomes in by_log.items()}
        kept = {name: [one for one in ones if _counts(name, one, said)] for name, ones in held.items()}
        lines.append(f"- {kind}: {_mean(held)} % raw, {_mean(kept)} % without those left out")
        everything += sum(map(len, held.values()))
        excluded += sum(map(len, held.values())) - sum(map(len, kept.values()))
    share = percent(excluded / max(everything, 1))
    return [*lines, f"- left out: {excluded} of {everything} pairs ({share} %)"]


def _counts(name: str, outcome: Outcome, said: Mapping[Key, Argument]) -> bool:
    """Whether a pair counts: it does, unless the right pose is missing for a cause that excuses it."""
    argument = said.get((name, outcome.pair.i, outcome.pair.j), NOT_ARGUED)
    return outcome.among_first or argument.cause not in EXCLUDED


def _mean(by_log: Mapping[str, Sequence[Outcome]]) -> str:
    """Percent with the right pose among the first rivals: the mean of the logs that have any."""
    shares = [fmean(one.among_first for one in held) for held in by_log.values() if held]
    return percent(fmean(shares)) if shares else "-"


# --- the page -------------------------------------------------------------------------------------


def page(failed: Sequence[Failed], by_log: Mapping[str, Sequence[Outcome]], said: Mapping[Key, Argument]) -> str:
    """docs/failures.md."""
    kinds = [(cause, [one for one in failed if said.get(one.key, NOT_ARGUED).cause == cause]) for cause in CAUSES]
    counts = "; ".join(f"{len(held)}: {CAUSES[cause]}" for cause, held in kinds if held)
    total = sum(len(held) for held in by_log.values())
    head = HEAD.format(failed=len(failed), total=total, counts=counts, provenance=provenance(), rivals=RIVALS)
    shown = [head, "\n".join(figures(by_log, said)), LEGEND]
    body = [part for cause, held in kinds if held for part in _section(cause, held, said)]
    return "\n\n".join((*shown, *body)) + "\n"


def _section(cause: str, held: Sequence[Failed], said: Mapping[Key, Argument]) -> Iterator[str]:
    yield f"## {CAUSES[cause].capitalize()}"
    for one in held:
        name, i, j = one.key
        pair = one.outcome.pair
        overlap = "" if pair.overlap is None else f", {pair.overlap:.0%} overlap"
        yield f"### {name} {i}-{j}: {pair.kind}{overlap}"
        yield fill(f"{about(one.outcome).capitalize()}. {_scores(one)}{_second_opinion(one)}", COLUMNS)
        yield fill(said.get(one.key, NOT_ARGUED).text, COLUMNS)
        yield f"![{name} {i}-{j}](failures/{one.picture})"


def _scores(one: Failed) -> str:
    truth, best = one.subject.truth, one.outcome.match.best
    if truth is None or best is None or best.score is None:
        return ""
    place = next((k for k, rival in enumerate(one.outcome.rivals, 1) if is_right(rival.T_1_2, truth.T_1_2)), None)
    ranked = f"; the right one is number {place}" if place else ""
    return f"Score {best.score:.2f} m, at the refined truth {truth.refined_score:.2f} m{ranked}. "


def _second_opinion(one: Failed) -> str:
    _, i, j = one.key
    found = detours(one.held, i, j, one.parameters)
    return told_of_detours(found, one.outcome.pair.truth, one.outcome.match.T_1_2)


def write(folder: Path, failed: Sequence[Failed], text: str) -> None:
    """The page and its pictures; pictures of pairs that no longer fail go."""
    pictures = folder / "failures"
    pictures.mkdir(parents=True, exist_ok=True)
    for old in set(pictures.glob("*.svg")) - {pictures / one.picture for one in failed}:
        old.unlink()
    for one in failed:
        name, i, j = one.key
        title = f"{name}, {one.outcome.pair.kind}, scans {i} and {j}"
        (pictures / one.picture).write_text(draw(one.subject, title), encoding="utf-8")
    (folder / "failures.md").write_text(text, encoding="utf-8")


def main() -> None:
    """Match, draw, write."""
    parser = arguments(__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[1] / "docs")
    options = parser.parse_args()
    parameters, said = preset("verified"), argued()
    logs = load(options.logs, options.pairs)
    by_log = outcomes(logs, parameters)
    failed = [Failed(held, one, parameters) for held in logs for one in by_log[held.name] if one.fault]
    write(options.out, failed, page(failed, by_log, said))
    for one in failed:
        state = said.get(one.key, NOT_ARGUED)
        off = math.nan if one.outcome.match.T_1_2 is None else one.outcome.match.score
        print(*one.key, about(one.outcome), f"confidence {off:.3f}", state.cause, sep=", ")
    print(*figures(by_log, said), sep="\n")


if __name__ == "__main__":
    main()
