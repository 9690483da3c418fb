"""``benchmark pairs``: how well pairs of scans with known truth are integrated."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import DEFAULT_MODE, Heuristic, Json, Method, Mode, Preset, Setting, method_of, read
from app.cli.output import print_json, print_table, progress
from segmap.benchmark import LogScore, PairSet, run_pairs, score
from segmap.errors import LogError

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
    as_json: Json = False,
) -> None:
    """Integrate pairs of scans by their ranges alone: right within 0.25 m and 5 degrees of the truth."""
    method = method_of(mode, heuristic, preset, settings)
    scores = [_score(file, logs, method) for file in files]
    if as_json:
        print_json({"logs": [asdict(one) for one in scores]})
    else:
        _print(scores, f"mode {method.mode}, heuristic {method.heuristic}")


def _score(file: Path, logs: Path, method: Method) -> LogScore:
    pair_set = PairSet.from_json(_text(file), file.name)
    log = read(logs / pair_set.log)
    with progress(pair_set.log) as tell:
        outcomes = run_pairs(pair_set, log, method.parameters, method.heuristic, method.mode, progress=tell)
    return score(pair_set.log, outcomes)


def _text(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise LogError(f"{file} cannot be read: {(error.strerror or str(error)).lower()}. Check the path.") from None


def _print(scores: list[LogScore], title: str) -> None:
    rows: list[tuple[object, ...]] = []
    for one in scores:
        for kind, k in one.kinds.items():
            shares = (k.success, k.accepted_right, k.accepted_wrong, k.review, k.rejected)
            rows.append((one.log, kind, k.pairs, *map(_percent, shares), f"{k.median_ms:.1f}", f"{k.p95_ms:.1f}"))
    header = ("log", "kind", "pairs", "success", "right", "wrong", "review", "rejected", "median ms", "95 % ms")
    typer.echo(title)
    print_table(header, rows)
    kinds = list(dict.fromkeys(kind for one in scores for kind in one.kinds))
    for kind in kinds:
        held = [one.kinds[kind].success for one in scores if kind in one.kinds]
        typer.echo(f"mean success, {kind}: {_percent(sum(held) / len(held))}")
    for one in scores:
        typer.echo(f"recall at zero false accepts, {one.log}: {_percent(one.recall_at_zero_false_accepts)}")


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
