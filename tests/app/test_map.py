"""The merged map as a view shows it: colours, components, where a wall comes from, other maps, measuring, movement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.content import Content, alongside, place
from app.drawing import draw
from app.errors import RequestError, UnknownError
from app.map_layers import WORST
from app.map_looks import COLOURINGS, MapContent, MapLooks, Motion, Other
from app.motion import FRAMES, on_the_way
from app.palette import PALETTES
from app.session import Session
from app.workbench import View
from segmap.merging import Component, misfit, witnesses
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

PATIENCE = 120.0
IDS = ("0.0-0.1", "0.1-0.2", "0.3-0.4")
"""accepted by the fixture: two components"""


@pytest.fixture
def view(session: Session) -> Iterator[View]:
    """A view of a map of two components."""
    for integration, who in zip(IDS, ("Ada", "Bob", "Ada"), strict=True):
        session.decide([integration], "accepted", who=who)
    assert session.settle(PATIENCE)
    view = View(session)
    view.select(IDS[0])
    view.set_stage("map")
    yield view
    view.close()


def layer(view: View, name: str) -> Any:
    return next(one for one in view.snapshot()["layers"] if one["name"] == name)


def walls(view: View) -> list[Any]:
    return [d for d in view.picture().drawables if d.layer == "map" and d.kind == "lines"]


def middle(view: View, part: int = 0, row: int = 0) -> tuple[float, float]:
    """The middle of a wall of a component, where it is drawn."""
    x1, y1, x2, y2 = view.content().placed[part].map.coordinates[row]
    return (x1 + x2) / 2.0, (y1 + y2) / 2.0


# --- colours --------------------------------------------------------------------------------------


def test_colour_by_misfit(view: View) -> None:
    """Each wall has the colour of how far single scans lie from it; the legend says the scale and the spread."""
    view.set_colouring("misfit")
    part, session = view.session.components()[0], view.session
    off = misfit(part, {scan: session.segment_map(scan) for scan in part.scans})
    drawn = walls(view)[0]
    assert drawn.colours.shape == (len(part.map), 3)
    assert np.array_equal(drawn.colours, PALETTES["light"].by_heat(off / WORST))
    assert "95 % within" in layer(view, "map")["caption"]
    view.pick(*middle(view, row=int(np.nanargmax(off))), 0.02)
    assert view.snapshot()["picked"]["misfit"] == pytest.approx(np.nanmax(off))


def test_colour_by_witnesses(view: View) -> None:
    """Walls that as many scans saw have the same colour, and no two classes share one."""
    view.set_colouring("witnesses")
    part = view.session.components()[0]
    by_count: dict[int, set[tuple[int, ...]]] = {}
    for count, colour in zip(witnesses(part.map), walls(view)[0].colours, strict=True):
        by_count.setdefault(int(count), set()).add(tuple(colour))
    assert all(len(colours) == 1 for colours in by_count.values())
    assert len({next(iter(colours)) for colours in by_count.values()}) == len(by_count)
    assert "seen by no scan" in layer(view, "map")["caption"]


@pytest.mark.parametrize("theme", PALETTES)
def test_heat(theme: str) -> None:
    """From good to bad, and neutral where nothing is known; beyond the ends as at the ends."""
    palette = PALETTES[theme]
    colours = palette.by_heat(np.array([-1.0, 0.0, 1.0, 9.0, math.nan]))
    assert [tuple(one) for one in colours] == [palette.good, palette.good, palette.bad, palette.bad, palette.neutral]


def test_unknown_choices_are_refused(view: View) -> None:
    """With what there is to choose from, and nothing changes."""
    before = view.looks
    with pytest.raises(RequestError, match=", ".join(COLOURINGS)):
        view.set_colouring("rainbow")
    with pytest.raises(RequestError, match="beside, over"):
        view.set_side("left")
    for action in (view.toggle_component, view.isolate):
        with pytest.raises(UnknownError, match="no component"):
            action("7.7")
    with pytest.raises(UnknownError, match="to compare with"):
        view.set_compare("../before:1")
    assert view.looks == before


# --- components -----------------------------------------------------------------------------------


def test_show_hide_isolate(view: View) -> None:
    """A hidden component is not drawn, nor its trajectory and edges; alone means that all others are hidden."""
    assert [d.source for d in walls(view)] == ["component 1", "component 2"]
    view.toggle_component("0.0")
    drawn = [d.name for d in view.picture().drawables]
    assert [d.source for d in walls(view)] == ["component 2"]
    assert not [name for name in drawn if "component 1" in name]
    ties = view.content().ties
    shown = [ties[i].integration for d in view.picture().drawables if d.source == "ties" for i in d.segments]
    assert set(shown) == {"0.3-0.4"}
    view.toggle_component("0.0")
    assert len(walls(view)) == 2
    fits = view.looks.fits
    view.isolate("0.3")
    assert [d.source for d in walls(view)] == ["component 2"]
    assert view.looks.fits > fits
    assert view.picture().bounds[0] > view.content().placed[0].map.bounds[2]  # type: ignore[index]
    view.isolate("0.3")
    assert len(walls(view)) == 2
    assert set(view.snapshot()["map"]["colours"]) == {"0.0", "0.3"}


# --- where a wall comes from ----------------------------------------------------------------------


def test_a_clicked_wall_says_where_it_comes_from(view: View) -> None:
    """Its scans, the accepted integrations between them, and who accepted each; a line leads to each sensor."""
    part = view.session.components()[0]
    row = int(np.argmax(witnesses(part.map)))
    view.pick(*middle(view, row=row), 0.02)
    told = view.snapshot()["picked"]
    scans = {f"{s.log}.{s.scan}" for s in part.map.sources[row]}
    assert set(told["scans"]) == scans
    between = {id for id in IDS if set(id.split("-")) <= scans}
    assert {one["id"] for one in told["integrations"]} == between
    assert told["between"]
    decided = view.session.state.decisions
    assert all(one["who"] == decided[one["id"]].who for one in told["integrations"])
    (lines,) = (d for d in view.picture().drawables if d.name == "picked/sights")
    assert len(lines) == len(scans)
    assert lines.points[:, 1, :2] == pytest.approx(np.repeat([middle(view, row=row)], len(scans), axis=0), abs=1e-5)


def test_a_wall_seen_once(view: View) -> None:
    """Of a wall that a single scan saw the integrations are told that hold the scan."""
    part = view.session.components()[0]
    row = int(np.flatnonzero(witnesses(part.map) == 1)[0])
    view.set_picked(part.name, row)
    told = view.snapshot()["picked"]
    assert not told["between"]
    assert {one["id"] for one in told["integrations"]} == {id for id in IDS if told["scans"][0] in id.split("-")}


# --- measuring ------------------------------------------------------------------------------------


def test_measuring(view: View) -> None:
    """Two clicks give a length; ends of walls nearby are meant; the third begins again; nothing is picked meanwhile."""
    view.toggle_measuring()
    x1, y1, x2, y2 = view.content().placed[0].map.coordinates[0]
    view.pick(x1 + 0.01, y1 - 0.01, 0.05)
    assert view.snapshot()["measured"] is None
    view.pick(x2, y2 + 0.01, 0.05)
    told = view.snapshot()
    assert told["measured"]["length"] == pytest.approx(math.hypot(x2 - x1, y2 - y1), abs=1e-5)
    assert told["measured"]["heading"] == pytest.approx(math.atan2(y2 - y1, x2 - x1), abs=1e-4)
    assert told["picked"] is None
    (label,) = (d for d in view.picture().drawables if d.name == "measure/label")
    assert label.text.startswith(f"{told['measured']['length']:.2f} m")
    view.pick(500.0, 500.0, 0.05)
    assert view.looks.measured == ((500.0, 500.0),)
    view.toggle_measuring()
    assert view.looks.measured == ()
    view.pick(*middle(view), 0.05)
    assert view.snapshot()["picked"] is not None


def test_what_was_measured_elsewhere_is_gone(view: View) -> None:
    """Another stage, and another pair, have other places."""
    for leave in (
        lambda: view.set_stage("chains"),
        lambda: view.select("0.1-0.2"),
        lambda: view.set_colouring("misfit"),
    ):
        view.set_stage("segments")
        if not view.looks.measuring:
            view.toggle_measuring()
        view.pick(0.0, 0.0, 0.01)
        assert view.looks.measured
        leave()
        assert view.looks.measured == ()


# --- other maps -----------------------------------------------------------------------------------


def compare(view: View, name: str) -> Any:
    view.set_compare(name)
    assert view.session.settle(PATIENCE)
    return view.snapshot()["map"]["other"]


def test_an_earlier_state(view: View) -> None:
    """The map as it was before a step lies beside today's, with the same frame, and names the step."""
    options = {one["title"]: one["name"] for one in view.session.others.options()}
    (name,) = (name for title, name in options.items() if title == "Before: accepted 0.1-0.2")
    other = compare(view, name)
    assert other["title"] == "Before: accepted 0.1-0.2"
    assert other["problem"] == ""
    content = view.content()
    assert [part.component.scans for part in content.beside] == [(ScanId(0, 0), ScanId(0, 1))]
    assert apart(content.beside[0], *content.placed)
    view.set_side("over")
    over = view.content().beside[0]
    assert over.pose(ScanId(0, 1)).distance(view.content().placed[0].pose(ScanId(0, 1)))[0] < 0.2
    assert layer(view, "other")["visible"]
    view.set_compare("")
    assert view.content().beside == ()
    assert not layer(view, "other")["visible"]


@pytest.mark.parametrize("name", ["given", "sequential", "tree"])
def test_another_method(view: View, name: str) -> None:
    """The same scans by another method; where no loop closes, poses as accepted make the same map."""
    assert name in {one["name"] for one in view.session.others.options()}
    assert compare(view, name)["problem"] == ""
    held = view.session.others.get(name)
    assert {scan for part in held.components for scan in part.scans} >= {ScanId(0, 0), ScanId(0, 1)}
    if name == "given":
        ours = view.session.components()
        for mine, other in zip(ours, held.components, strict=True):
            assert np.allclose(mine.map.coordinates, other.map.coordinates)


def test_a_step_that_is_not_there(view: View) -> None:
    """A state before the first step is a map of nothing, not an error."""
    assert compare(view, "before:1")["problem"] != "" or view.content().beside == ()


def apart(one: Any, *others: Any) -> bool:
    """Whether the box of a component meets none of the others'."""
    left, bottom, right, top = one.map.bounds
    boxes = [other.map.bounds for other in others]
    return all(right < b[0] or left > b[2] or top < b[1] or bottom > b[3] for b in boxes)


def part_of(*scans: int, shift: float = 0.0) -> Component:
    poses = {ScanId(0, s): Pose2(float(i) + shift * (i > 0), 0.0, 0.0) for i, s in enumerate(scans)}
    return Component("c", tuple(poses), poses, SegmentMap(np.array([[0.0, 0.0, 3.0, 1.0]])))


def test_alongside() -> None:
    """Another map is laid on the scan both hold; one that shares none stands beyond."""
    ours = Content("map", components=(part_of(0, 1, 2),)).placed
    (over,) = alongside(ours, [part_of(1, 2, shift=0.5)], over=True)
    assert over.pose(ScanId(0, 1)) == ours[0].pose(ScanId(0, 1))
    (beside,) = alongside(ours, [part_of(1, 2)], over=False)
    assert apart(beside, *ours)
    (foreign,) = alongside(ours, [part_of(7, 8)], over=True)
    assert foreign.map.bounds[0] > ours[0].map.bounds[2]  # type: ignore[index]
    assert alongside(ours, [part_of(0)], over=True) == ()


def sized(place: int, width: float, height: float) -> Component:
    poses = {ScanId(0, 2 * place + k): Pose2.identity() for k in range(2)}
    return Component(
        f"component {place}", tuple(poses), poses, SegmentMap(np.array([[-1.0, 2.0, width - 1.0, height + 2.0]]))
    )


def test_many_components_stand_in_rows() -> None:
    """Parts of all sizes: none on another, the first where its frame has it, all of them about as wide as a window."""
    rng = np.random.default_rng(7)
    parts = [sized(k, *rng.uniform(2.0, 60.0, 2)) for k in range(20)]
    placed = place(parts)
    assert placed[0].T_map_component == Pose2.identity()
    for k, one in enumerate(placed[1:], 1):
        assert apart(one, *placed[:k])
    bounds = np.array([one.map.bounds for one in placed])
    width, height = (bounds[:, 2:].max(axis=0) - bounds[:, :2].min(axis=0)).tolist()
    assert 0.8 < width / height < 2.5


# --- movement -------------------------------------------------------------------------------------


def moving(shift: float) -> tuple[Content, Content]:
    return Content("map", components=(part_of(0, 1, 2),)), Content("map", components=(part_of(0, 1, 2, shift=shift),))


def test_a_map_moves_from_before_to_after() -> None:
    """Scans go from where they were to where they are, those that stay stay, and the walls of scans go with them."""
    before, after = moving(0.6)
    frames = list(on_the_way(before, after, lambda _: np.array([[0.0, 0.0, 0.0, 1.0]])))
    assert len(frames) == FRAMES - 1
    places = [frame.places[ScanId(0, 2)].x for frame in frames]
    assert places == sorted(places)
    assert 2.0 < places[0] < places[-1] < 2.6
    assert {frame.places[ScanId(0, 0)].x for frame in frames} == {0.0}
    (walls,) = (d for d in draw(frames[5]).drawables if d.layer == "map" and d.kind == "lines")
    assert walls.points[2, 0, 0] == pytest.approx(places[5], abs=1e-5)


def test_what_does_not_move() -> None:
    """Nothing moves where the poses are the same, where the map is not looked at, or one of them was moving already."""
    before, after = moving(0.0)
    assert list(on_the_way(before, after, lambda _: np.empty((0, 4)))) == []
    before, after = moving(0.6)
    assert list(on_the_way(replace(before, stage="chains"), after, lambda _: np.empty((0, 4)))) == []
    on_its_way = replace(after, map=MapContent(motion=Motion({})))
    assert list(on_the_way(before, on_its_way, lambda _: np.empty((0, 4)))) == []


def test_a_large_map_moves_its_trajectory_only() -> None:
    """Too many walls are not sent again and again."""
    before, after = moving(0.6)
    frames = list(on_the_way(before, after, lambda _: np.tile([0.0, 0.0, 1.0, 0.0], (3000, 1))))
    assert frames[0].map.motion is not None
    assert frames[0].map.motion.walls == {}
    assert len(draw(frames[0]).drawables) > 0


def test_other_that_is_not_there_yet() -> None:
    """While it is computed the legend says so, and nothing is drawn of it."""
    other = Other("tree", "The tree method", problem="being computed")
    content = Content("map", components=(part_of(0, 1),), map=MapContent(MapLooks(compare="tree"), other=other))
    picture = draw(content)
    assert "being computed" in next(one.caption for one in picture.layers if one.name == "other")
    assert not [d for d in picture.drawables if d.layer == "other"]
