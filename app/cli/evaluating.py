"""``evaluate``: a trajectory against relations that people checked."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import Json
from app.cli.output import print_facts, print_json
from segmap.logs.tables import RelationsFile, Trajectory, read_relations, read_trajectory
from segmap.pose import Pose2
from segmap.relations import against_relations

__all__ = ["evaluate"]


def evaluate(
    trajectory: Annotated[
        Path,
        typer.Argument(
            metavar="TRAJECTORY", help="A TUM trajectory, or a log whose scans have poses.", show_default=False
        ),
    ],
    relations: Annotated[
        Path, typer.Argument(metavar="RELATIONS", help="Lines t1 t2 x y z roll pitch yaw.", show_default=False)
    ],
    mount: Annotated[
        tuple[float, float, float],
        typer.Option(
            metavar="X Y DEGREES",
            help="Pose of the laser in the frame of the robot, where the relations are the robot's.",
        ),
    ] = (0.0, 0.0, 0.0),
    as_json: Json = False,
) -> None:
    """Compare a trajectory with relations (Kuemmerle et al. 2009): mean and standard deviation of the errors."""
    poses, checked = read_trajectory(trajectory), read_relations(relations)
    for file in (poses, checked):
        _tell(file)
    x, y, turn = mount
    agreement = against_relations(poses, checked, Pose2(x, y, math.radians(turn)))
    found = {name: value for name, value in asdict(agreement).items() if name != "errors"}
    if as_json:
        print_json(found)
        return
    translation, rotation = (
        f"{mean:.{digits}f} +- {std:.{digits}f} {unit}"
        for mean, std, digits, unit in (
            (agreement.translation_mean_m, agreement.translation_std_m, 4, "m"),
            (agreement.rotation_mean_deg, agreement.rotation_std_deg, 3, "degrees"),
        )
    )
    matched = f"{agreement.matched} of {agreement.relations}"
    print_facts({"relations matched": matched, "translation": translation, "rotation": rotation})


def _tell(file: Trajectory | RelationsFile) -> None:
    for problem in file.problems:
        typer.echo(f"segmap: {file.name}: {problem}", err=True)
