"""The report: what it says of trust, that nothing in it can run, and that what it shows is there."""

from __future__ import annotations

import math
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from segmap.events import Decision, LogInfo
from segmap.export import Content, LogTold, PairTold, Record, export_files
from segmap.export.report import trust
from segmap.graph import Edge, optimise, strength
from segmap.pose import Pose2
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.visibility import Evidence

COVARIANCE = ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4))
EVIL = "<script>alert('x')</script><img src=x onerror=alert(1)>\"'&\x00\ud800"
STEP = Pose2(1.0, 0.0, math.pi / 2)
"""four of them go round a square"""
AGREES, CONTRADICTS = Evidence(9.0, 0.5, 0.5, 1.0), Evidence(3.0, 6.0, 0.0, 1.0)


def pair(number: int, other: int, **more: Any) -> PairTold:
    """An accepted pair of scans of one log, one decision a step."""
    name = f"0.{number}-0.{other}"
    seq = more.pop("seq", 10 * number + other)
    made = Decision(
        integration=name, verdict="accepted", parameters="p", T_1_2=STEP, who=more.pop("who", "Ada"), seq=seq
    )
    return PairTold(name, "neighbour", "accepted", made, **{"confidence": 0.97, "evidence": AGREES, **more})


def record(*told: PairTold, edges: dict[tuple[int, int], Pose2] | None = None, **more: Any) -> Record:
    """A record whose graph has the edges given, or a step for each accepted pair."""
    poses = edges if edges is not None else {_ends(one): STEP for one in told if one.state == "accepted"}
    graph = optimise([Edge(ScanId(0, a), ScanId(0, b), pose, COVARIANCE) for (a, b), pose in poses.items()])
    state = more.pop("state", ProjectState(name="House"))
    return Record(state, told, graph, strength(graph), **more)


def _ends(one: PairTold) -> tuple[int, int]:
    a, b = one.integration.split("-")
    return int(a[2:]), int(b[2:])


def square() -> dict[tuple[int, int], Pose2]:
    """A loop of four scans."""
    return {(0, 1): STEP, (1, 2): STEP, (2, 3): STEP, (0, 3): STEP.inverse()}


def words(found: Any, side: str) -> str:
    return " ".join(one.words for one in found.sentences if one.side == side)


def report(part: Any, told: Record | None = None, **metadata: str) -> str:
    return export_files(Content([part], metadata, ["0.0-0.1"], record=told), "report")["map.html"].decode()


class Page(HTMLParser):
    """The elements of a page, their attributes and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.attributes += attrs
        if tag not in ("meta", "!doctype"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


# --- trust ----------------------------------------------------------------------------------------


def test_nothing_accepted() -> None:
    """Without an accepted integration there is no map to trust, and it says so first."""
    found = trust(record(PairTold("0.0-0.1", "neighbour", "pending", verdict="accepted")), [])
    assert found.level == "none"
    assert found.headline == "There is no map yet: nothing is accepted."
    assert "1 pair is not decided yet; the program would accept it" in words(found, "unknown")


def test_a_chain_is_unchecked(part: Callable[..., Any]) -> None:
    """Integrations without a loop are said to be checked step by step only, each holding two parts alone."""
    found = trust(record(pair(0, 1), pair(1, 2)), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert found.level == "unchecked"
    assert "No loop closes" in words(found, "unknown")
    assert "0.0-0.1, 0.1-0.2" in words(found, "unknown")


def test_a_loop_that_fits_is_checked(part: Callable[..., Any]) -> None:
    """A closed loop without bridges, seen the same by all scans, is called checked, with its worst miss."""
    edges = square()
    found = trust(record(*(pair(a, b) for a, b in edges), edges=edges), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert found.level == "checked"
    assert "1 loop closes" in words(found, "for")
    assert words(found, "against") == ""
    hanging = {**edges, (3, 4): STEP}
    partly = trust(record(*(pair(a, b) for a, b in hanging), edges=hanging), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert partly.level == "partly"
    assert "0.3-0.4 alone holds two parts together" in words(partly, "unknown")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"evidence": CONTRADICTS}, "agree on less than 80%"),
        ({"verdict": "rejected"}, "Accepted though the program would reject the pose"),
    ],
)
def test_one_doubtful_integration_is_told_first(part: Callable[..., Any], changed: Any, said: str) -> None:
    """One accepted integration that its evidence contradicts makes the whole map one to look at again."""
    edges = square()
    told = [pair(a, b, **(changed if a == 1 else {})) for a, b in edges]
    found = trust(record(*told, edges=edges), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert found.level == "doubtful"
    assert "1 accepted integration is in doubt" in found.headline
    assert said in words(found, "against")
    assert "0.1-0.2" in words(found, "against")


def test_what_the_optimiser_leaves_out(part: Callable[..., Any]) -> None:
    """A closure that all others contradict is named."""
    edges = {**square(), (0, 2): Pose2(40.0, 3.0, 1.0)}
    found = trust(record(*(pair(a, b) for a, b in edges), edges=edges), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert found.level == "doubtful"
    assert "leaves out: 0.0-0.2" in words(found, "against")


def test_who_looked(part: Callable[..., Any]) -> None:
    """People are counted, and so is what was accepted in one step with others."""
    told = [pair(0, 1, who="Ada"), pair(1, 2, who="", seq=7), pair(2, 3, who="", seq=7)]
    found = trust(record(*told), [part("one", (0.0, 0.0, 1.0, 0.0))])
    assert "3 integrations accepted, by somebody who gave no name (2), Ada (1)" in words(found, "for")
    assert "2 integrations were accepted together with others in one step" in words(found, "unknown")


def test_parts_and_scans_left_out(part: Callable[..., Any]) -> None:
    """Scans outside the map and parts without relation are not known, and said so."""
    components = [part("one", (0.0, 0.0, 1.0, 0.0)), part("two", (0.0, 0.0, 1.0, 0.0))]
    found = trust(record(pair(0, 1), scans=tuple(ScanId(0, i) for i in range(9))), components)
    assert "The map holds 4 of 9 scans." in words(found, "unknown")
    assert "It is in 2 parts" in words(found, "unknown")


# --- the page -------------------------------------------------------------------------------------


def test_everything_is_in_one_page(part: Callable[..., Any], corner: Any) -> None:
    """Trust comes first; decisions, evidence, graph, logs, parameters and versions follow; nothing is fetched."""
    edges = square()
    walls = SegmentMap(np.array([[0.0, 1.0, 2.0, 1.0]]))
    logs = (
        LogTold(LogInfo(name="robot.log", sha256="ab12", size=5, scans=4, format="CARMEN"), 81.83, ("line 3: torn",)),
    )
    told = record(*(pair(a, b) for a, b in edges), edges=edges, logs=logs, map_of=lambda _: walls)
    page = Page(report(corner, told, title="House", version="9.9", map_hash="5f3a"))
    assert page.open == []
    titles = ("How far can I trust", "The map", "made of", "Loops and strength", "Worth a look", "Decisions", "Logs")
    places = [page.text.index(title) for title in (*titles, "Parameters in force", "Where it comes from")]
    assert places == sorted(places)
    for words in (
        "0.2-0.3",
        "Ada",
        "0.97",
        "90%",
        "9.0",
        "robot.log",
        "ab12",
        "line 3: torn",
        "9.9",
        "5f3a",
        "split_tolerance",
    ):
        assert words in page.text
    assert page.elements.count("svg") == 2 + len(edges)
    assert not {"script", "link", "iframe", "object", "img", "form"} & set(page.elements)
    assert not [name for name, _ in page.attributes if name.startswith("on") or name in ("src", "href")]


def test_no_text_becomes_markup(part: Callable[..., Any]) -> None:
    """Names, reasons and problems with markup in them are shown as they are, wherever they stand."""
    made = Decision(
        integration="0.0-0.1", verdict="accepted", parameters="p", T_1_2=STEP, who=EVIL, reason=EVIL, heuristic=EVIL
    )
    told = PairTold("0.0-0.1", "neighbour", "accepted", made, evidence=AGREES)
    logs = (LogTold(LogInfo(name=EVIL, sha256="0", size=1, scans=1, format=EVIL), None, (EVIL,)),)
    evil = part(EVIL.replace("\ud800", ""), (0.0, 0.0, 1.0, 0.0))
    page = Page(report(evil, record(told, logs=logs, state=ProjectState(name=EVIL)), title=EVIL, **{"<b>": EVIL}))
    assert not {"script", "img", "b"} & set(page.elements)
    assert page.text.count("<script>alert('x')</script>") >= 7
    assert "\x00" not in page.text


def test_a_map_without_a_record(corner: Any) -> None:
    """A map that no project made has a report of the map alone."""
    page = Page(report(corner, title="T"))
    assert "What it is made of" in page.text
    assert "trust" not in page.text
