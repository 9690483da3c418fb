"""What a picture shows follows from what is known, for every stage and for maps with nothing in them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app import grid
from app.content import Content, Pair, place
from app.drawables import Drawable, Pick, lines, points
from app.drawing import LAYERS, STAGES, Picture, draw
from app.pair_layers import rivals
from app.palette import PALETTES, Palette
from app.picking import explain, nearest
from segmap.candidates import angles
from segmap.chains import matching_chains
from segmap.fusion import fuse
from segmap.integration import match_maps
from segmap.merging import merge_accepted
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import Order, SegmentMap

PARAMETERS = Parameters()
SCANS = (ScanId(0, 4), ScanId(0, 5))
T_1_2 = Pose2(0.6, -0.3, 0.4)
ROOM = [(-3, -2, 3, -2), (3, -2, 3, 1), (3, 1, 1, 1), (1, 1, 1, 2.5), (1, 2.5, -3, 2.5), (-3, 2.5, -3, -1)]


def room() -> SegmentMap:
    """An L of a room, in beam order."""
    return SegmentMap(np.array(ROOM, float), Order.BEAMS)


def pair_of(map_1: SegmentMap, map_2: SegmentMap, rank: int = 0) -> Pair:
    """A pair, matched; its returns are the extremes of its segments."""
    match = match_maps(map_1, map_2, PARAMETERS)
    pair = Pair(
        integration="0.4-0.5",
        scans=SCANS,
        names=("scan 4", "scan 5"),
        maps=(map_1, map_2),
        returns=(map_1.coordinates[:, :2], map_2.coordinates[:, :2]),
        parameters=PARAMETERS,
        ranked=match.ranked,
    )
    if not match.ranked:
        return pair
    candidate = match.ranked[rank]
    chains = matching_chains(map_1, map_2, candidate.T_1_2, PARAMETERS)
    fusion = fuse(map_1, map_2, candidate.T_1_2, chains, PARAMETERS)
    return replace(pair, candidate=candidate, chains=chains, fusion=fusion)


@pytest.fixture(scope="module")
def moved_room() -> Pair:
    """A room, and the same room seen from another place."""
    return pair_of(room(), room().moved(T_1_2.inverse()))


def components(pair: Pair) -> Any:
    assert pair.candidate is not None
    return merge_accepted(
        dict(zip(pair.scans, pair.maps, strict=True)), [(*pair.scans, pair.candidate.T_1_2)], PARAMETERS
    )


def by_path(picture: Picture) -> dict[str, Drawable]:
    return {drawable.path: drawable for drawable in picture.drawables}


def scanned(count: int, seed: int) -> SegmentMap:
    """Some segments in beam order, none without length."""
    generator = np.random.default_rng(seed)
    start = generator.uniform(-5.0, 5.0, (count, 2))
    along = generator.uniform(0.2, 3.0, (count, 2))
    return SegmentMap(np.concatenate((start, start + along), axis=1), Order.BEAMS)


# --- every picture --------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.integers(0, 6), st.integers(0, 6), st.integers(0, 3))
def test_every_stage_can_be_drawn(count_1: int, count_2: int, seed: int) -> None:
    """Whatever the maps: arrays of the right shape, finite, under names of their own, each in a layer of the legend."""
    pair = pair_of(scanned(count_1, seed), scanned(count_2, seed + 1))
    for stage, dimension, theme in itertools.product(STAGES, (2, 3), PALETTES):
        picture = draw(Content(stage, pair, dimension=dimension, theme=theme, shown=dict.fromkeys(LAYERS, True)))
        paths = [drawable.path for drawable in picture.drawables]
        assert len(set(paths)) == len(paths)
        assert {d.layer for d in picture.drawables} <= {layer.name for layer in picture.layers} | {"message"}
        assert all(d.points.dtype == np.float32 and len(d) for d in picture.drawables)
        assert np.isfinite(picture.bounds).all()


@pytest.mark.parametrize("stage", STAGES)
def test_every_layer_says_what_it_shows(moved_room: Pair, stage: str) -> None:
    """Each layer has a title, a caption, a unit and its colours."""
    picture = draw(Content(stage, moved_room, components(moved_room)))
    assert all(layer.title and layer.caption and layer.unit and layer.colours for layer in picture.layers)


def test_a_project_without_pairs_has_a_picture_that_says_so() -> None:
    """Nothing selected: one sentence, and a view of some size."""
    picture = draw(Content("chains", message="There is no pair."))
    assert [d.text for d in picture.drawables if d.kind == "label"] == ["There is no pair."]
    assert picture.bounds[2] > picture.bounds[0]


def test_scans_without_returns_leave_a_sentence() -> None:
    """Two empty scans: their sensors, and what is the matter."""
    empty = SegmentMap(np.empty((0, 4)), Order.BEAMS)
    picture = draw(Content("chains", pair_of(empty, empty), message="The first map has no segments."))
    assert "The first map has no segments." in [d.text for d in picture.drawables]


def test_a_wrong_array_is_refused() -> None:
    """viser would draw it as nothing at all."""
    with pytest.raises(ValueError, match="shape"):
        Drawable("bad", "first", "lines", points([[0.0, 1.0]]), (0, 0, 0))
    with pytest.raises(ValueError, match="shape"):
        Drawable("bad", "first", "lines", lines([[0.0, 0.0, np.nan, 1.0]]), (0, 0, 0))


# --- a pair ---------------------------------------------------------------------------------------


def test_another_candidate_moves_the_frame_and_no_segment(moved_room: Pair) -> None:
    """The second map's own arrays stay as they are; only where their frame stands changes."""
    best = draw(Content("candidate", moved_room))
    other = draw(Content("candidate", pair_of(*moved_room.maps, rank=1)))
    assert best.T_1_2 != other.T_1_2
    for path in ("/first/segments", "/second/segments", "/second/returns", "/second/sensor"):
        assert np.array_equal(by_path(best)[path].points, by_path(other)[path].points)


def test_before_there_is_a_relation_the_scans_stand_side_by_side(moved_room: Pair) -> None:
    """In the first stages, and where nothing was found, no two segments overlap."""
    for content in (Content("scans", moved_room), Content("chains", replace(moved_room, candidate=None, ranked=()))):
        shifted = moved_room.maps[1].moved(content.T_1_2)
        assert shifted.coordinates[:, ::2].min() > moved_room.maps[0].coordinates[:, ::2].max()


def test_the_marked_angles_lie_on_each_other(moved_room: Pair) -> None:
    """The candidate takes vertex to vertex."""
    assert moved_room.candidate is not None
    rows = (moved_room.candidate.angle_1, moved_room.candidate.angle_2)
    first, second = (
        angles(m, np.array([row]), PARAMETERS).vertices[0] for m, row in zip(moved_room.maps, rows, strict=True)
    )
    assert moved_room.candidate.T_1_2 @ second == pytest.approx(first)
    drawn = by_path(draw(Content("candidate", moved_room)))
    for frame, vertex in (("first", first), ("second", second)):
        ends = drawn[f"/{frame}/angle/vertex"].points[:, :, :2].reshape(-1, 2)
        assert np.hypot(*(ends - vertex).T).min() < 0.1


def test_every_matched_segment_has_the_colour_of_its_chain(moved_room: Pair) -> None:
    """The chain that adds most has the first colour; every member is drawn once, and nothing else is."""
    palette = PALETTES["light"]
    picture = draw(Content("chains", moved_room))
    for side, frame in enumerate(("first", "second")):
        drawn = [d for d in picture.drawables if d.frame == frame and d.layer == "chains"]
        members = [int(i) for d in drawn for i in d.segments]
        expected = [i for chain in moved_room.chains for i in (chain.first, chain.second)[side]]
        assert sorted(members) == sorted(expected)
    best = moved_room.chains[moved_room.by_value[0]]
    drawn_first = next(d for d in picture.drawables if d.path == "/first/chains/1")
    assert set(best.first) <= set(drawn_first.segments)
    assert drawn_first.colour == palette.chains[0]


def test_the_chains_add_up_to_the_value(moved_room: Pair) -> None:
    """What the legend says is the candidate's value."""
    assert moved_room.candidate is not None
    told = next(layer.caption for layer in draw(Content("chains", moved_room)).layers if layer.name == "chains")
    assert f"{moved_room.candidate.value:.2f} m together" in told


def test_the_fused_stage_draws_the_fused_map(moved_room: Pair) -> None:
    """Polylines and kept segments are exactly the segments of the fused map."""
    assert moved_room.fusion is not None
    drawn = [d for d in draw(Content("fused", moved_room)).drawables if d.layer == "fused" and d.kind == "lines"]
    held = np.concatenate([d.points[:, :, :2].reshape(-1, 4) for d in drawn])
    fused = moved_room.fusion.map.coordinates.astype(np.float32)
    assert sorted(map(tuple, held)) == sorted(map(tuple, fused))


def test_rivals_say_something_else() -> None:
    """No ghost is the candidate shown, or another ghost, moved a little."""
    square = SegmentMap(np.array([(-2, -2, 2, -2), (2, -2, 2, 2), (2, 2, -2, 2), (-2, 2, -2, -2)], float), Order.BEAMS)
    pair = pair_of(square, square)
    assert pair.candidate is not None
    shown = [pair.candidate, *(rival for _, rival in rivals(pair.ranked, pair.candidate))]
    assert len(shown) > 1
    for a, b in itertools.combinations(shown, 2):
        distance, turn = a.T_1_2.distance(b.T_1_2)
        assert distance > 0.5 or turn > 0.2


def test_a_layer_switched_off_is_gone_and_the_others_stay(moved_room: Pair) -> None:
    """Switching concerns one layer only."""
    before = draw(Content("chains", moved_room))
    after = draw(Content("chains", moved_room, shown={"chains": False}))
    assert {d.path for d in before.drawables if d.layer != "chains"} == {d.path for d in after.drawables}


def test_candidates_stand_in_the_space_of_poses(moved_room: Pair) -> None:
    """In 3D a candidate is higher the larger its theta, and its bar the higher its value."""
    drawn = by_path(draw(Content("candidate", moved_room, dimension=3)))
    poses = np.array([tuple(c.T_1_2) for c in moved_room.ranked])
    places, bars = drawn["/first/candidates/points"].points, drawn["/first/candidates/bars"].points
    assert np.allclose(places[:, :2], poses[:, :2], atol=1e-5)
    assert (np.diff(places[np.argsort(poses[:, 2]), 2]) >= -1e-5).all()
    heights = bars[:, 1, 2] - bars[:, 0, 2]
    values = np.array([c.value for c in moved_room.ranked])
    assert heights / heights.max() == pytest.approx(values / values.max(), abs=1e-4)


# --- the merged map -------------------------------------------------------------------------------


def test_the_pair_is_highlighted_in_the_map(moved_room: Pair) -> None:
    """Both scans lie where the component has them, and the trajectory goes from sensor to sensor."""
    drawn = by_path(draw(Content("map", moved_room, components(moved_room))))
    assert moved_room.candidate is not None
    first, second = drawn["/map/pair/first"].points, drawn["/map/pair/second"].points
    assert np.allclose(first[:, :, :2].reshape(-1, 4), moved_room.maps[0].coordinates, atol=1e-5)
    moved = moved_room.maps[1].moved(moved_room.candidate.T_1_2).coordinates
    assert np.allclose(second[:, :, :2].reshape(-1, 4), moved, atol=1e-5)
    stops = next(d for path, d in drawn.items() if path.endswith("/stops"))
    assert stops.points[1, :2] == pytest.approx([moved_room.candidate.T_1_2.x, moved_room.candidate.T_1_2.y], abs=1e-5)


def test_components_lie_apart(moved_room: Pair) -> None:
    """Nothing is known of how components lie to each other: they are drawn beside each other, each in its colour."""
    scans = [ScanId(0, i) for i in range(6)]
    maps = dict(zip(scans, moved_room.maps * 3, strict=True))
    assert moved_room.candidate is not None
    pose = moved_room.candidate.T_1_2
    held = merge_accepted(maps, [(scans[0], scans[1], pose), (scans[2], scans[3], pose)], PARAMETERS)
    picture = draw(Content("map", replace(moved_room, scans=(scans[2], scans[3])), held, scans=6))
    drawn = [d for d in picture.drawables if d.layer == "map" and d.kind == "lines"]
    assert len(drawn) == 2
    first, second = (one.points[:, :, :2].reshape(-1, 2) for one in drawn)
    assert (first.max(axis=0) < second.min(axis=0)).any() or (second.max(axis=0) < first.min(axis=0)).any()
    assert drawn[0].colour != drawn[1].colour
    caption = next(layer.caption for layer in picture.layers if layer.name == "map")
    assert "2 components of 4 scans" in caption
    assert "2 scans not placed" in caption
    assert place(held, (scans[2],))[0].component.scans == (scans[2], scans[3])


# --- clicking -------------------------------------------------------------------------------------


@pytest.mark.parametrize("stage", ["segments", "candidate", "chains", "fused"])
def test_a_click_finds_the_segment_under_it(moved_room: Pair, stage: str) -> None:
    """In the middle of a segment: that one, of the map whose segment lies on top; far from everything: none."""
    content = Content(stage, moved_room)
    picture = draw(content)
    moved = moved_room.maps[1].moved(picture.T_1_2)
    for row, (x1, y1, x2, y2) in enumerate(moved.coordinates):
        pick = nearest(picture, (x1 + x2) / 2.0, (y1 + y2) / 2.0, 0.05)
        assert pick is not None
        assert pick == Pick("second", row) or (pick.source == "first" and content.superimposed)
    assert nearest(picture, 1e3, 1e3, 0.05) is None
    assert nearest(draw(Content(stage)), 0.0, 0.0, 1.0) is None


def test_what_the_segments_add_is_the_value(moved_room: Pair) -> None:
    """Over all segments of one map the explanations add up to the candidate's value."""
    assert moved_room.candidate is not None
    for source, segment_map in zip(("first", "second"), moved_room.maps, strict=True):
        told = [explain(Content("chains", moved_room, picked=Pick(source, i))) for i in range(len(segment_map))]
        assert sum(one["adds"] for one in told if one) == pytest.approx(moved_room.candidate.value)


def test_a_clicked_segment_of_the_map_knows_its_scans(moved_room: Pair) -> None:
    """The explanation names where it was seen; a segment that is not there is not explained."""
    held = components(moved_room)
    told = explain(Content("map", moved_room, held, picked=Pick(held[0].name, 0)))
    assert told is not None
    assert "scans" in told
    assert explain(Content("map", moved_room, held, picked=Pick(held[0].name, 10_000))) is None
    assert explain(Content("map", moved_room, held, picked=Pick("first", 0))) is None


def test_the_clicked_segment_is_marked(moved_room: Pair) -> None:
    """One thick line, in the frame of its map."""
    drawn = by_path(draw(Content("chains", moved_room, picked=Pick("second", 2))))["/second/picked"]
    assert np.allclose(drawn.points[0, :, :2].ravel(), moved_room.maps[1].coordinates[2], atol=1e-5)


# --- grid and colours -----------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1.0, 8.0, 70.0, 900.0])
def test_the_grid_stays_readable(size: float) -> None:
    """Round spacing, told in the legend; neither three lines nor three hundred."""
    wall = SegmentMap(np.array([[0.0, 0.0, size, 0.0]]), Order.BEAMS)
    content = Content("segments", pair_of(wall, wall))
    step = grid.spacing(content)
    assert f"squares of {step:g} m" in grid.caption(content)
    assert math.log10(step) % 1.0 == pytest.approx(0.0) or str(step)[0] in "25"
    fine = next(iter(grid.draw(content)))
    assert 4 <= len(fine) <= 400


def _linear(colour: tuple[int, int, int]) -> Any:
    share = np.array(colour) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def _lab(light: Any) -> Any:
    """CIELAB of linear light, D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(
        light, 0, 1
    )
    f = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-6))
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


EYES = {
    "usual": np.eye(3),
    "without red": np.array([[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]),
    "without green": np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]),
}
"""Machado, Oliveira and Fernandes (2009): how colours look to colour-blind eyes, in linear light"""


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("palette", PALETTES.values(), ids=list(PALETTES))
def test_chains_can_be_told_apart(palette: Palette, eyes: str) -> None:
    """By all eyes: no two colours are near each other (a difference of 2.3 is just seen)."""
    seen = [_lab(EYES[eyes] @ _linear(colour)) for colour in palette.chains]
    assert min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2)) > 18.0
    first, second = (_lab(EYES[eyes] @ _linear(colour)) for colour in (palette.first, palette.second))
    assert np.linalg.norm(first - second) > 18.0


def _contrast(a: tuple[int, int, int], b: tuple[int, int, int]) -> float:
    low, high = sorted(float(np.array([0.2126, 0.7152, 0.0722]) @ _linear(colour)) for colour in (a, b))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("palette", PALETTES.values(), ids=list(PALETTES))
def test_words_can_be_read_and_lines_seen(palette: Palette) -> None:
    """Text has the contrast of WCAG AA on its background, lines enough to be seen."""
    for colour in (palette.text, palette.first, palette.good, palette.bad, palette.neutral, palette.accent):
        assert _contrast(colour, palette.background) >= 4.4
    for colour in (palette.second, *palette.chains):
        assert _contrast(colour, palette.background) >= 2.1
