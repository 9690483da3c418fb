"""``loops``: the loop closures of a project, found and put into its review queue."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.options import Json
from app.cli.output import pose_json, print_json, print_table, progress
from app.inputs import Inputs
from app.pairs import integrations_of
from app.searching import SEARCH, WORKERS, Closure, Found, find_closures
from segmap.errors import ProjectError
from segmap.events import Propose
from segmap.store import Store

__all__ = ["loops"]

Project = Annotated[Path, typer.Argument(metavar="PROJECT", help="A project file, .segmap.", show_default=False)]
Workers = Annotated[int, typer.Option(min=1, help="Processes that match.")]
Keep = Annotated[bool, typer.Option("--keep/--no-keep", help="Put what is found into the review queue of the project.")]


def loops(project: Project, workers: Workers = WORKERS, keep: Keep = True, as_json: Json = False) -> None:
    """Search all logs of a project for loop closures, without odometry; nothing is accepted without a person.

    The residual is how far each is from where all links of the search together have it.
    """
    with Store.open(project) as store:
        inputs = Inputs(store, store.state.logs, store.log_bytes)
        if len(inputs.scan_ids) < 2:
            raise ProjectError(f"{project} has fewer than two scans: there is nothing to search.")
        with progress("searching for loops") as tell:
            found = find_closures(
                store.state,
                inputs.scan_ids,
                inputs.segment_map,
                workers=workers,
                progress=lambda _, done, total: tell(done, total),
            )
        new = _new(store, inputs, found)
        if keep and new:
            event = Propose(proposals=tuple(closure.proposal for closure in new), who=SEARCH)
            store.append(event)
        _report(store, found, len(new), as_json)


def _new(store: Store, inputs: Inputs, found: Found) -> list[Closure]:
    """Those the queue of the project has not yet."""
    known = set(integrations_of(store.state, inputs.scan_ids))
    return [closure for closure in found.closures if closure.integration not in known]


def _report(store: Store, found: Found, new: int, as_json: bool) -> None:
    parameters = store.state.parameters
    rows = [_closure(closure, str(closure.match.judged(parameters).verdict)) for closure in found.closures]
    if as_json:
        print_json({"closures": rows, "new": new, "revision": store.state.revision})
        return
    if rows:
        header = ("pair", "value [m]", "confidence", "residual", "verdict")
        print_table(header, [_line(row) for row in rows])
    typer.echo(found.in_words(new))


def _closure(closure: Closure, verdict: str) -> dict[str, Any]:
    return {
        "id": closure.integration,
        "pose": pose_json(closure.link.T_1_2),
        "value": closure.value,
        "confidence": closure.link.confidence,
        "residual": {
            "translation": closure.residual.translation,
            "rotation": closure.residual.rotation,
            "chi": closure.residual.chi,
            "silenced": closure.residual.silenced,
        },
        "verdict": verdict,
    }


def _line(row: dict[str, Any]) -> tuple[object, ...]:
    residual = row["residual"]
    off = f"{residual['translation']:.3f} m {math.degrees(residual['rotation']):5.2f} deg"
    told = f"{off} silenced" if residual["silenced"] else off
    return row["id"], f"{row['value']:.2f}", f"{row['confidence']:.3f}", told, row["verdict"]
