"""Parameters are defined once and checked everywhere."""

import pytest

from segmap.errors import ParameterError
from segmap.parameters import PRESETS, Parameters, describe, preset


def test_every_parameter_says_what_it_is():
    """Each has a sentence of help, and its default lies within its bounds."""
    assert [row["name"] for row in describe()] == list(Parameters.model_fields)
    for row in describe():
        assert row["help"].endswith("."), row
        assert row["optional"] or row["default"] is not None
        if row["kind"] in {"number", "integer"}:
            assert row["minimum"] is not None or row["above"] is not None, row
            assert row["maximum"] is not None or row["below"] is not None, row


def test_presets_hold_the_papers_values():
    """paper-lab and paper-gates are Sections III, V-A and V-C."""
    lab, gates = preset("paper-lab"), preset("paper-gates")
    assert (lab.max_range, lab.split_tolerance, lab.cluster_distance) == (8.0, 0.025, 0.20)
    assert (lab.point_distance_tolerance, lab.segment_distance_threshold, lab.fusion_tolerance) == (0.015, 5.0, 0.015)
    assert (lab.segment_length_percentage, lab.segment_division_factor, lab.histogram_slots) == (20.0, 0.5, 18)
    assert (gates.point_distance_tolerance, gates.segment_distance_threshold) == (0.010, 10.0)
    assert lab.refuse_angle == gates.refuse_angle == lab.min_segment_length == 0.0
    assert PRESETS["default"] == Parameters()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"no_such": 1}, "no parameter 'no_such'"),
        ({"fusion_tolerance": -1.0}, "fusion_tolerance cannot be -1.0"),
        ({"fusion_tolerance": float("nan")}, "fusion_tolerance"),
        ({"histogram_slots": 17}, "histogram_slots cannot be 17"),
        ({"fusion_variant": "greedier"}, "fusion_variant cannot be 'greedier'"),
        ({"seed": "x"}, "seed cannot be 'x'"),
    ],
)
def test_wrong_values_are_told_by_name(changes, told):
    """An error names the parameter and the value."""
    with pytest.raises(ParameterError, match=told):
        Parameters().replace(**changes)


def test_text_becomes_values():
    """Text from a command line is read by kind; none is none."""
    read = Parameters().with_text({"max_range": "8", "random_rounds": "3", "consecutive_strict": "true"})
    assert (read.max_range, read.random_rounds, read.consecutive_strict) == (8.0, 3, True)
    assert read.with_text({"max_range": "none"}).max_range is None


def test_unknown_preset_is_told():
    """The error lists the presets there are."""
    with pytest.raises(ParameterError, match="paper-lab"):
        preset("paper")
