"""Pictures of pairs: a panel for each pose, drawn where it says, on any input."""

import math
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from segmap._sight_kernels import CONTRADICTED
from segmap.benchmark import NEGATIVE, Outcome, Pair, PairSet, run_pairs
from segmap.logs import read_log
from segmap.pair_pictures import AGAINST, Subject, about, draw, index_page, name_of
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import LaserLog, LaserScan
from segmap.visibility import classes

ROOT = Path(__file__).resolve().parents[1]
VERIFIED = preset("verified")
SVG = "{http://www.w3.org/2000/svg}"


def office() -> LaserLog:
    return read_log(ROOT / "sample_logs" / "office.log")


def matched(pair: Pair, log: LaserLog | None = None, mode: str = "verified") -> Subject:
    """A pair of the office, matched."""
    log = log or office()
    (outcome,) = run_pairs(PairSet(log="office", pairs=(pair,)), log, VERIFIED, mode=mode)
    return Subject(log, outcome, VERIFIED)


@pytest.fixture(scope="module")
def subject() -> Subject:
    """Two neighbours, with a truth that is a metre off."""
    return matched(Pair(kind="wide", i=0, j=1, x=1.0, y=0.0, theta=0.1))


def drawn(subject: Subject, title: str = "a pair") -> ElementTree.Element:
    return ElementTree.fromstring(draw(subject, title))


def texts(picture: ElementTree.Element) -> list[str]:
    return [node.text or "" for node in picture.iter(f"{SVG}text")]


def placed(picture: ElementTree.Element) -> list[Pose2]:
    """Where each panel has the second scan."""
    found = []
    for use in picture.iter(f"{SVG}use"):
        if use.get("href") == "#two":
            c, s, *_, x, y = map(float, re.findall(r"-?[\d.]+", use.get("transform", "")))
            found.append(Pose2(x, y, math.atan2(s, c)))
    return found


def test_a_panel_for_the_truth_and_for_each_rival(subject):
    """In this order, the second scan where the pose says, and every return of both in each."""
    picture = drawn(subject)
    wanted = [subject.outcome.pair.truth, *(rival.T_1_2 for rival in subject.outcome.rivals)]
    got = placed(picture)
    assert len(got) == len(wanted) >= 2
    assert all(max(a.distance(b)) < 1e-3 for a, b in zip(got, wanted, strict=True))
    paths = [path.get("d", "") for path in picture.iter(f"{SVG}path")]
    for points in subject.points:
        assert any(path.count("h0") == len(points) for path in paths)


def test_the_picture_says_what_went_wrong(subject):
    """The fault, how far off, the verdict with its reasons, and the scores at the truth and at the best."""
    told = "\n".join(texts(drawn(subject)))
    assert about(subject.outcome) in told
    assert f"Verdict: {subject.outcome.match.verdict.value}." in told
    assert f"truth: score {subject.truth.score:.2f} m" in told
    assert f"best (right): score {subject.outcome.rivals[0].score:.2f} m" in told


def test_returns_that_are_seen_through_are_marked(subject):
    """As many red dots in a panel as returns that lines of sight contradict at its pose."""
    first = next(group for group in drawn(subject).iter(f"{SVG}g") if group.get("class") == "panel")
    (red,) = [path for path in first.iter(f"{SVG}path") if path.get("stroke") == AGAINST]
    found = np.concatenate(classes(*subject.sights, subject.outcome.pair.truth, VERIFIED))
    assert red.get("d", "").count("h0") == np.sum(found == CONTRADICTED) > 0


def test_refinement_of_the_truth_finds_the_scan_in_itself():
    """From 5 cm off the identity back to it, with a better score."""
    truth = matched(Pair(kind="wide", i=3, j=3, x=0.05, y=0.0, theta=0.0)).truth
    assert max(truth.refined.distance(Pose2.identity())) < 0.01
    assert truth.refined_score >= truth.score


def test_the_same_pair_gives_the_same_picture(subject):
    """Byte for byte."""
    assert draw(subject, "a pair") == draw(replace(subject), "a pair")


@pytest.mark.parametrize("mode", ["paper", "verified"])
def test_pairs_without_a_common_wall_have_no_truth_to_draw(mode):
    """Only rivals, in either mode; in paper mode a value and no score."""
    negative = matched(Pair(kind=NEGATIVE, i=0, j=30), mode=mode)
    picture = drawn(negative)
    assert len(placed(picture)) == len(negative.outcome.rivals)
    assert not any(text.startswith("truth") for text in texts(picture))


def test_scans_that_saw_nothing_are_drawn_all_the_same():
    """Two sensors and no pose: a picture with words and no panel."""
    blind = LaserScan(np.full(10, np.nan), 0.0, 0.1)
    picture = drawn(matched(Pair(kind=NEGATIVE, i=0, j=1), LaserLog("dark", (blind, blind))))
    assert placed(picture) == []
    assert any("segments" in text for text in texts(picture))


def test_names_cannot_break_the_markup(subject):
    """What a log is called is text, in the picture and on the page."""
    nasty = '<script>"&'
    assert nasty in texts(drawn(subject, nasty))
    page = index_page([("a&b.svg", nasty)])
    assert "<script>" not in page
    assert "a&amp;b.svg" in page


@pytest.mark.parametrize(
    ("log", "name"),
    [
        ("fr079/fr079-graph.log.gz", "fr079-graph-wide-0-1"),
        ("C:\\logs\\my log.log", "my-log-wide-0-1"),
        ("../..", "-wide-0-1"),
    ],
)
def test_names_of_pictures_are_plain(subject: Subject, log: str, name: str):
    """No folder, no space, no dot of a log's path reaches the file name."""
    assert name_of(log, subject.outcome) == name


def test_the_page_has_every_picture():
    """In order, with what each shows."""
    page = index_page([("one.svg", "first"), ("two.svg", "second")])
    assert re.findall(r'<img src="([^"]+)"', page) == ["one.svg", "two.svg"]
    assert re.findall(r"<figcaption>([^<]+)", page) == ["first", "second"]


def test_a_right_pair_is_called_right():
    """The words do not call a success a failure."""
    outcome: Outcome = matched(Pair(kind="wide", i=3, j=3, x=0.0, y=0.0, theta=0.0)).outcome
    assert about(outcome).startswith("right, 0.00 m")
