"""``datasets list`` and ``datasets get``: public logs of real robots."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from app.cli.options import Json, one_of
from app.cli.output import print_json
from segmap import datasets as public

__all__ = ["datasets"]

datasets = typer.Typer(name="datasets", help="Public logs of real robots.", no_args_is_help=True)


@datasets.callback()
def _about() -> None:
    """Public logs of real robots."""


@datasets.command(name="list")
def list_them(as_json: Json = False) -> None:
    """List the public logs that are known, and which of them are on this computer."""
    if as_json:
        print_json({"folder": str(public.folder()), "datasets": [_document(held) for held in public.DATASETS.values()]})
        return
    typer.echo(_row("name", "scans", "beams", "here", "what"))
    for held in public.DATASETS.values():
        typer.echo(_row(held.name, held.scans, held.beams, _here(held), held.title))


@datasets.command()
def get(
    names: Annotated[
        list[str], typer.Argument(metavar=f"{one_of(public.DATASETS)}...", help="Which ones.", show_default=False)
    ],
) -> None:
    """Fetch public logs, check them, and print where they are, one file a line; the log comes first."""
    for wanted in [public.dataset(name) for name in names]:
        for path in public.fetch(wanted, _told):
            typer.echo(path)


def _told(file: public.RemoteFile) -> None:
    typer.echo(f"segmap: fetching {file.url}", err=True)


def _row(name: str, scans: object, beams: object, here: str, title: str) -> str:
    return f"{name:<12} {scans:>5} {beams:>5} {here:>4}  {title}"


def _here(held: public.Dataset) -> str:
    return "yes" if all(map(public.cached, held.files)) else "no"


def _document(held: public.Dataset) -> dict[str, Any]:
    files = [
        {"name": file.name, "url": file.url, "sha256": file.sha256, "here": public.cached(file)} for file in held.files
    ]
    return {"name": held.name, "title": held.title, "scans": held.scans, "beams": held.beams, "files": files}
