"""``loops``: the loop closures of a project, found and put into its review queue."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.clusters import cluster
from app.cli.options import Dask, Json, Workers
from app.cli.output import pose_json, print_json, print_table, progress
from app.inputs import Inputs
from app.searching import SEARCH, WORKERS, Closure, Found, find_closures, new_proposals
from segmap.errors import ProjectError
from segmap.events import Propose
from segmap.store import Store

__all__ = ["loops"]

Project = Annotated[Path, typer.Argument(metavar="PROJECT", help="A project file, .segmap.", show_default=False)]
Keep = Annotated[bool, typer.Option("--keep/--no-keep", help="Put what is found into the review queue of the project.")]
Every = Annotated[bool, typer.Option("--all", help="Every closure, not only a few of each revisit.")]


def loops(
    project: Project,
    workers: Workers = WORKERS,
    dask: Dask = None,
    keep: Keep = True,
    every: Every = False,
    as_json: Json = False,
) -> None:
    """Search all logs of a project for loop closures, without odometry; nothing is accepted without a person.

    Of each revisit a few closures are proposed, and what ties what nothing else ties. The residual is how far each is
    from where all links of the search together have it. What is matched is kept in the project: a search that was
    interrupted goes on where it was.
    """
    with cluster(dask) as backend, Store.open(project) as store:
        inputs = Inputs(store, store.state.logs, store.log_bytes)
        if len(inputs.scan_ids) < 2:
            raise ProjectError(f"{project} has fewer than two scans: there is nothing to search.")
        with progress("searching for loops") as tell:
            found = find_closures(
                store.state,
                inputs.scan_ids,
                inputs.segment_map,
                store=store if keep else None,
                workers=workers,
                backend=backend,
                every=every,
                progress=lambda _, done, total: tell(done, total),
            )
        new = new_proposals(found, store.state)
        if keep and new:
            store.append(Propose(proposals=new, who=SEARCH))
        _report(store, found, len(new), as_json)
    if keep and found.closures and not as_json:
        typer.echo(f"None is in the map before a person accepts it: segmap serve {project}")


def _report(store: Store, found: Found, new: int, as_json: bool) -> None:
    parameters = store.state.parameters
    rows = [_closure(closure, str(closure.match.judged(parameters).verdict)) for closure in found.closures]
    if as_json:
        counts = {"revisits": found.revisits, "others": found.others, "silenced": found.silenced}
        print_json({"closures": rows, "new": new, **counts, "revision": store.state.revision})
        return
    if rows:
        header = ("pair", "value [m]", "confidence", "residual", "judged")
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
        "why": closure.why,
    }


def _line(row: dict[str, Any]) -> tuple[object, ...]:
    residual = row["residual"]
    off = f"{residual['translation']:.3f} m {math.degrees(residual['rotation']):5.2f} deg"
    told = f"{off} silenced" if residual["silenced"] else off
    return row["id"], f"{row['value']:.2f}", f"{row['confidence']:.3f}", told, row["verdict"]
