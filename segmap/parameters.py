"""Every parameter once: name, unit, default, bounds and a line of help.

The command line, the HTTP API, the sliders of the workbench and the documentation are made from
:class:`Parameters`. Names are the paper's in snake_case; the paper speaks in millimetres and
centimetres, everything here is in metres and radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from segmap.errors import ParameterError

__all__ = ["PRESETS", "Parameters", "describe", "preset"]


def _instead(name: str, known: Iterable[str]) -> str:
    """What could be meant by a name that is none."""
    near = get_close_matches(name, known, cutoff=0.5)
    meant = f"Did you mean {' or '.join(near)}? " if near else ""
    return f"{meant}Parameters are: {', '.join(known)}."


def _parameter(default: Any, unit: str, help: str, **bounds: float) -> Any:
    return Field(default, description=help, json_schema_extra={"unit": unit}, **bounds)  # type: ignore[call-overload]


class Parameters(BaseModel):
    """All parameters of segmap, immutable; change some with :meth:`replace`.

    >>> Parameters().replace(fusion_tolerance=0.02).fusion_tolerance
    0.02
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    # segments (III-D)
    max_range: float | None = _parameter(
        None, "m", "Returns farther than this are no returns; none: the sensor's own limit.", gt=0.0, le=1000.0
    )
    cluster_distance: float = _parameter(
        0.20, "m", "Consecutive returns closer than this belong to one cluster (tau, III-D).", gt=0.0, le=10.0
    )
    split_tolerance: float = _parameter(
        0.03, "m", "Farthest a return may lie from the line that stands for it (kappa, III-D).", gt=0.0, le=1.0
    )
    min_segment_length: float = _parameter(
        0.15, "m", "Shorter segments are not taken from a scan (not in the paper: 0).", ge=0.0, le=10.0
    )

    # candidate transformations (III-A)
    angle_difference_tolerance: float = _parameter(
        0.2, "rad", "Two angles are equal when they differ by less (III).", gt=0.0, le=math.pi
    )
    min_vertex_angle: float = _parameter(
        0.2, "rad", "Lines that meet at this angle or less have no usable vertex.", ge=0.0, lt=math.pi / 2
    )
    segment_length_percentage: float = _parameter(
        20.0,
        "%",
        "consecutive: segments shorter than this share of the longest are dropped (III-A1).",
        ge=0.0,
        le=100.0,
    )
    consecutive_over_short: bool = _parameter(
        True, "", "consecutive: drop short segments first, then take neighbours; off: immediate neighbours only."
    )
    consecutive_strict: bool = _parameter(
        False, "", "consecutive: only segments that share an extreme (always so where segments have no order)."
    )
    segment_division_factor: float = _parameter(
        0.5,
        "",
        "random: round k picks segments longer than this to the power k times the longest (III-A2).",
        gt=0.0,
        lt=1.0,
    )
    random_rounds: int = _parameter(9, "rounds", "random: K of Algorithm 3; round k makes 20 * 2^k draws.", ge=1, le=14)
    seed: int = _parameter(0, "", "random: seed of the draws (numpy PCG64).", ge=0, le=2**63 - 1)
    good_enough: float | None = _parameter(
        None,
        "m",
        "random: stop after the round that reaches this value; none: all rounds (III-A2).",
        gt=0.0,
        le=100000.0,
    )
    histogram_slots: int = _parameter(
        18, "buckets", "histogram: buckets over half a turn, an even number (III-A3).", ge=2, le=360, multiple_of=2
    )

    # value of a transformation (III-B)
    point_distance_tolerance: float = _parameter(
        0.03, "m", "Points closer than this coincide; the unit of the distance penalty (III).", gt=0.0, le=1.0
    )
    segment_distance_threshold: float = _parameter(
        5.0, "tolerances", "Segments farther apart than this do not match (III-B).", gt=0.0, le=1000.0
    )
    segment_length_refuse: float = _parameter(
        1.0,
        "m",
        "Two longer segments that cross contradict each other: the candidate is discarded (III-B).",
        gt=0.0,
        le=100.0,
    )
    refuse_angle: float = _parameter(
        0.2,
        "rad",
        "A crossing contradicts only at a larger angle; 0: at any (the paper's literal rule).",
        ge=0.0,
        le=math.pi / 2,
    )
    distance_penalty: float = _parameter(
        0.95, "", "The matching value is multiplied by this for each tolerance of distance (III-B).", gt=0.0, le=1.0
    )
    value_threshold: float = _parameter(
        4.0, "m", "An integration is valid when its value is above this (IV-B, V-B).", ge=0.0, le=100000.0
    )
    ranked_candidates: int = _parameter(
        50,
        "",
        "How many of the best candidates an integration keeps for inspection; verified: at most 12 distinct ones.",
        ge=1,
        le=10000,
    )

    # evidence (beyond the paper: verified mode); with all of these off it is paper mode, to the last bit
    use_sights: bool = _parameter(
        True, "", "verified: rank candidates by lines of sight; off: by their value, as the paper does."
    )
    use_refinement: bool = _parameter(
        True, "", "verified: refine the best candidates, and say how firmly walls hold them; off: as they are."
    )
    use_rivals: bool = _parameter(
        True, "", "verified: rank distinct poses only, and leave close rivals to a person; off: whatever ranks high."
    )
    use_confidence: bool = _parameter(
        True, "", "verified: accept by the calibrated confidence; off: by the threshold of value alone."
    )
    sight_tolerance: float = _parameter(
        0.2, "m", "A return supports a candidate when the other map sees a surface within this.", gt=0.0, le=2.0
    )
    shadow_depth: float = _parameter(
        0.6, "m", "A return this close behind a surface that the other map sees speaks against it.", ge=0.0, le=10.0
    )
    conflict_weight: float = _parameter(
        2.0, "", "What a metre seen through takes from the score, against a metre supported.", ge=0.0, le=100.0
    )
    shadow_weight: float = _parameter(
        1.0, "", "What a metre close behind a seen surface takes from the score.", ge=0.0, le=100.0
    )
    unseen_weight: float = _parameter(
        0.2, "", "What a metre that the other map cannot judge takes from the score.", ge=0.0, le=100.0
    )
    judged_candidates: int = _parameter(
        20000, "", "How many of the best candidates by value are judged by their lines of sight.", ge=1, le=1000000
    )
    refined_candidates: int = _parameter(
        48, "", "How many distinct ones of these are refined and judged again.", ge=1, le=10000
    )
    refine_gate: float = _parameter(
        0.5, "m", "Refinement begins with returns up to this far from a surface.", gt=0.0, le=5.0
    )
    rival_distance: float = _parameter(
        0.25, "m", "Poses nearer than this, and than the rival angle, are one pose.", gt=0.0, le=10.0
    )
    rival_angle: float = _parameter(
        0.14, "rad", "Poses nearer than this, and than the rival distance, are one pose.", gt=0.0, le=math.pi
    )
    confidence_accept: float = _parameter(0.9, "", "verified: accepted at this confidence and above.", ge=0.0, le=1.0)
    confidence_review: float = _parameter(
        0.1, "", "verified: below this confidence rejected; between the two a person decides.", ge=0.0, le=1.0
    )

    # fusion (III-C)
    fusion_tolerance: float = _parameter(
        0.05, "m", "Farthest a matched segment may lie from the polyline that replaces it (III-C).", gt=0.0, le=1.0
    )
    fusion_variant: Literal["greedy", "plain"] = _parameter(
        "greedy", "", "greedy: each segment enters the polyline at most once; plain: it may enter again (Fig. 5)."
    )
    fusion_bound: int = _parameter(
        10,
        "insertions",
        "plain: most insertions for each segment of a chain before it is reported as unfinished.",
        ge=1,
        le=1000,
    )

    max_connector: float | None = _parameter(
        0.2,
        "m",
        "Longer stretches of a polyline along which no segment lies are left out (none: the paper keeps all).",
        ge=0.0,
        le=100000.0,
    )

    # fusion of a whole (beyond the paper)
    wall_spread: float = _parameter(
        0.05,
        "m",
        "How far the segments of one wall scatter, by the errors of poses (standard deviation).",
        gt=0.0,
        le=1.0,
    )
    wall_witnesses: float = _parameter(
        0.2, "", "A wall stays where this share of the scans that see its place found it (0: all stay).", ge=0.0, le=1.0
    )

    # merging (IV)
    pivot_form: Literal["scan", "pair"] = _parameter(
        "scan", "", "pivot: fuse each new scan (Algorithm 6), or each pair's map moved by its pivot (IV-C)."
    )
    tree_skip: bool = _parameter(
        True, "", "tree: try each map with the next but one first; a valid integration replaces two (IV-B)."
    )
    tree_skip_level: int = _parameter(
        3, "level", "tree: skip from this level on; maps of level k hold k + 1 scans (IV-B).", ge=1, le=1000
    )
    bridging: bool = _parameter(
        True, "", "Where a pair fails, try again through the scans in between that were left out (V-C)."
    )

    def replace(self, **changes: Any) -> Parameters:
        """A copy with some parameters changed.

        Raises:
            ParameterError: a name is unknown, or a value is out of bounds or of the wrong kind.
        """
        unknown = sorted(set(changes) - set(type(self).model_fields))
        if unknown:
            raise ParameterError(
                f"There is no parameter {unknown[0]!r}. {_instead(unknown[0], type(self).model_fields)}"
            )
        try:
            return type(self)(**{**self.model_dump(), **changes})
        except ValidationError as error:
            raise ParameterError(_sentence(error)) from None

    def with_text(self, assignments: Mapping[str, str]) -> Parameters:
        """A copy with parameters given as text, as on a command line; ``none`` stands for none."""
        return self.replace(
            **{name: None if text.strip().lower() == "none" else text for name, text in assignments.items()}
        )


def _sentence(error: ValidationError) -> str:
    first = error.errors()[0]
    name = ".".join(str(part) for part in first["loc"]) or "parameters"
    return f"Parameter {name} cannot be {first.get('input')!r}: {first['msg'].lower()}."


_PAPER_LAB: dict[str, Any] = {
    "max_range": 8.0,
    "split_tolerance": 0.025,
    "min_segment_length": 0.0,
    "point_distance_tolerance": 0.015,
    "refuse_angle": 0.0,
    "fusion_tolerance": 0.015,
    "max_connector": None,
}

PRESETS: dict[str, Parameters] = {
    "default": Parameters(),
    "verified": Parameters(value_threshold=0.5),
    "paper-lab": Parameters(**_PAPER_LAB),
    "paper-gates": Parameters(
        **{**_PAPER_LAB, "max_range": None, "point_distance_tolerance": 0.010, "segment_distance_threshold": 10.0}
    ),
}
"""The shipped default (one set for every sensor), the same for verified mode, where evidence decides and the
value is only a floor, and the paper's two sets (Sections V-A and V-C)."""


def preset(name: str) -> Parameters:
    """The parameters of a preset.

    Raises:
        ParameterError: there is no such preset.
    """
    try:
        return PRESETS[name]
    except KeyError:
        raise ParameterError(f"There is no preset {name!r}. Presets are: {', '.join(PRESETS)}.") from None


def describe() -> list[dict[str, Any]]:
    """Name, kind, unit, default, bounds and help of every parameter, for forms and documentation."""
    properties = Parameters.model_json_schema()["properties"]
    return [_description(name, properties[name]) for name in Parameters.model_fields]


def _description(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    """One parameter's JSON schema, flattened: an optional number becomes a number that may be none."""
    variants = schema.get("anyOf", [schema])
    kind = {**schema, **next(v for v in variants if v.get("type") != "null")}
    bounds = {"minimum": "minimum", "maximum": "maximum", "above": "exclusiveMinimum", "below": "exclusiveMaximum"}
    return {
        "name": name,
        "kind": "choice" if "enum" in kind else kind["type"],
        "unit": kind.get("unit", ""),
        "default": kind.get("default"),
        "optional": len(variants) > 1,
        "choices": kind.get("enum"),
        "help": kind["description"],
        **{ours: kind.get(theirs) for ours, theirs in bounds.items()},
    }
