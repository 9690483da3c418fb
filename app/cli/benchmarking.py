"""``benchmark pairs``: how well pairs of scans with known truth are integrated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from app.cli.options import DEFAULT_MODE, Heuristic, Json, Method, Mode, Preset, Setting, method_of, read
from app.cli.output import print_json, print_table, progress
from segmap import pair_pictures
from segmap.benchmark import RIVALS, LogScore, Outcome, PairSet, run_pairs, score
from segmap.errors import ExportError, LogError
from segmap.export.files import write_whole
from segmap.scans import LaserLog

__all__ = ["benchmark"]

benchmark = typer.Typer(name="benchmark", help="Measure against known truth.", no_args_is_help=True)


@benchmark.callback()
def _about() -> None:
    """Measure against known truth."""


@benchmark.command()
def pairs(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="PAIRS.json...", help="Pairs of scans and their true poses.", show_default=False),
    ],
    logs: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the logs the pairs name.", show_default=False)],
    mode: Mode = DEFAULT_MODE,
    heuristic: Heuristic = None,
    preset: Preset = None,
    settings: Setting = None,
    repeats: Annotated[int, typer.Option(min=1, help="Match each pair so often; the median time counts.")] = 1,
    brute: Annotated[
        int, typer.Option(min=0, help="Run brute force too, on so many pairs of each kind, and print the ratio.")
    ] = 0,
    failures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw every pair that failed into this folder.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Integrate pairs of scans by their ranges alone: right within 0.25 m and 5 degrees of the truth."""
    method = method_of(mode, heuristic, preset, settings)
    ran = [_run(file, logs, method, repeats, brute) for file in files]
    scores = [score(one.name, one.outcomes) for one in ran]
    if failures is not None:
        _draw(failures, ran, method)
    if as_json:
        failed = [_failure(one.name, outcome) for one in ran for outcome in one.failed]
        print_json({"logs": [asdict(one) for one in scores], "failures": failed, "cpu_milliseconds": _times(ran)})
    else:
        _print(scores, f"mode {method.mode}, heuristic {method.heuristic}")
        times = ", ".join(f"{what} {milliseconds:.1f} ms" for what, milliseconds in _times(ran).items())
        typer.echo(f"processor time a pair, all kinds and logs together: {times}")
        for one in ran:
            for outcome in one.failed:
                typer.echo(f"failed: {_told(one.name, outcome)}")


@dataclass(frozen=True, eq=False)
class _Ran:
    """The pairs of one log, matched."""

    name: str
    log: LaserLog
    outcomes: Sequence[Outcome]

    @property
    def failed(self) -> list[Outcome]:
        return [outcome for outcome in self.outcomes if outcome.fault]


def _run(file: Path, logs: Path, method: Method, repeats: int, brute: int) -> _Ran:
    pair_set = PairSet.from_json(_text(file), file.name)
    log = read(logs / pair_set.log)
    with progress(pair_set.log) as tell:
        outcomes = run_pairs(
            pair_set, log, method.parameters, method.heuristic, method.mode, repeats=repeats, brute=brute, progress=tell
        )
    return _Ran(pair_set.log, log, outcomes)


def _times(ran: Sequence[_Ran]) -> dict[str, float]:
    """Processor time a pair in milliseconds, of all pairs there are."""
    spent = np.array([outcome.cpu_milliseconds for one in ran for outcome in one.outcomes])
    return {"median": float(np.median(spent)), "95 %": float(np.percentile(spent, 95.0))} if len(spent) else {}


def _text(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise LogError(f"{file} cannot be read: {(error.strerror or str(error)).lower()}. Check the path.") from None


def _failure(name: str, outcome: Outcome) -> dict[str, object]:
    pair, match = outcome.pair, outcome.match
    told = {"verdict": match.verdict.value, "fault": outcome.fault, "among_first_three": outcome.among_first}
    return {"log": name, "kind": pair.kind, "i": pair.i, "j": pair.j, **told}


def _told(name: str, outcome: Outcome) -> str:
    pair = outcome.pair
    return f"{name}, {pair.kind}, scans {pair.i} and {pair.j}: {pair_pictures.about(outcome)}"


def _draw(folder: Path, ran: Sequence[_Ran], method: Method) -> None:
    """A picture of each pair that failed, and a page with all of them."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ExportError(f"{folder} cannot be made: {reason}. Choose another folder.") from None
    pictures = []
    for one in ran:
        for outcome in one.failed:
            file, told = f"{pair_pictures.name_of(one.name, outcome)}.svg", _told(one.name, outcome)
            title = told.partition(": ")[0]
            subject = pair_pictures.Subject(one.log, outcome, method.parameters)
            write_whole(folder / file, pair_pictures.draw(subject, title).encode())
            pictures.append((file, told))
    write_whole(folder / "index.html", pair_pictures.index_page(pictures).encode())


def _print(scores: list[LogScore], title: str) -> None:
    typer.echo(title)
    _print_kinds(scores)
    kinds = list(dict.fromkeys(kind for one in scores for kind in one.kinds))
    for kind in kinds:
        held = [one.kinds[kind] for one in scores if kind in one.kinds]
        typer.echo(f"mean success, {kind}: {_mean([k.success for k in held])}")
        first = [k.among_first_three for k in held if k.among_first_three is not None]
        if first:
            typer.echo(f"mean with the right one among the first {RIVALS} distinct rivals, {kind}: {_mean(first)}")
    for one in scores:
        typer.echo(f"recall at zero false accepts, {one.log}: {_percent(one.recall_at_zero_false_accepts)}")
    _print_brute(scores)


def _print_kinds(scores: list[LogScore]) -> None:
    rows: list[tuple[object, ...]] = []
    for one in scores:
        for kind, k in one.kinds.items():
            first = "" if k.among_first_three is None else _percent(k.among_first_three)
            shares = map(_percent, (k.accepted_right, k.accepted_wrong, k.review, k.rejected))
            times = (f"{t:.1f}" for t in (k.median_ms, k.p95_ms, k.median_cpu_ms, k.p95_cpu_ms))
            rows.append((one.log, kind, k.pairs, _percent(k.success), first, *shares, *times))
    header = ["log", "kind", "pairs", "success", f"first {RIVALS}", "right", "wrong", "review", "rejected"]
    print_table((*header, "median ms", "95 % ms", "median CPU ms", "95 % CPU ms"), rows)


def _print_brute(scores: list[LogScore]) -> None:
    for one in scores:
        for kind, k in one.kinds.items():
            if k.brute_force_ratio is not None:
                right = "" if k.brute_force_success is None else f", and is right on {_percent(k.brute_force_success)}"
                typer.echo(f"brute force, {one.log}, {kind}: {k.brute_force_ratio:.1f} times our CPU time{right}")


def _mean(shares: Sequence[float]) -> str:
    return _percent(sum(shares) / len(shares))


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
