"""Failures, drawn and argued: every failing pair is on the page once, with its cause, its picture and fair figures."""

import importlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from segmap.benchmark import Pair, run_pairs
from segmap.integration import Verdict
from segmap.logs import read_log
from segmap.parameters import preset
from segmap.pose import Pose2

ROOT = Path(__file__).resolve().parents[1]
VERIFIED = preset("verified")


@pytest.fixture(scope="module")
def script():
    """The scripts by name, with their folder on the path as when they are run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module


@pytest.fixture(scope="module")
def failed(script):
    """Two pairs of a sample log whose truth is three metres off."""
    log = read_log(ROOT / "sample_logs" / "office.log")
    pairs = tuple(Pair(kind=kind, i=0, j=j, x=3.0, y=0.0, theta=0.0) for kind, j in (("consecutive", 1), ("wide", 2)))
    held = script("common").LogPairs("office", log, pairs)
    outcomes = run_pairs(held.pair_set(), log, VERIFIED, mode="verified")
    return [script("failures").Failed(held, outcome, VERIFIED) for outcome in outcomes]


def test_every_argument_names_a_cause_and_says_something(script):
    """The arguments that come with the benchmark are well formed, one for each pair."""
    failures = script("failures")
    said = failures.argued()
    assert len(said) == len(json.loads(failures.ARGUMENTS.read_text()))
    assert all(len(argument.text) > 50 for argument in said.values())


def test_an_unknown_cause_is_told_of(script, tmp_path):
    """The message names the pair and the causes there are."""
    file = tmp_path / "arguments.json"
    file.write_text(json.dumps([{"log": "a", "i": 0, "j": 1, "cause": "weather", "text": "rain"}]))
    with pytest.raises(SystemExit, match="weather"):
        script("failures").argued(file)


def test_the_page_has_each_pair_once_under_its_cause(script, failed):
    """A pair without an argument says so; counts by cause and the picture of each are there."""
    failures = script("failures")
    said = {("office", 0, 1): failures.Argument("truth", "The truth is three metres off.")}
    text = failures.page(failed, {"office": [one.outcome for one in failed]}, said)
    assert text.count("### office 0-1: consecutive") == text.count("### office 0-2: wide") == 1
    assert "1: the logged pose is wrong; 1: the method failed" in text
    assert text.index("three metres off") < text.index("## The method failed") < text.index("Not argued yet.")
    assert all(f"(failures/{one.picture})" in text for one in failed)


def test_only_argued_pairs_are_left_out_of_the_figure(script, failed):
    """The raw share stands beside it, and how many were left out."""
    failures = script("failures")
    by_log = {"office": [one.outcome for one in failed] + [replace(failed[0].outcome, rivals=())]}
    by_log["office"].append(replace(failed[1].outcome, pair=Pair(kind="wide", i=0, j=2, **still())))
    lines = failures.figures(by_log, {("office", 0, 1): failures.Argument("truth", "")})
    assert lines[1].startswith("- wide: 50.0 % raw, 50.0 %")
    assert failures.figures(by_log, {("office", 0, 2): failures.Argument("method", "")})[2].startswith(
        "- left out: 0 of 4"
    )


def still() -> dict[str, float]:
    """A truth that whatever was found for office 0-2 is near to."""
    log = read_log(ROOT / "sample_logs" / "office.log")
    poses = json.loads((ROOT / "sample_logs" / "office.truth.json").read_text())["sessions"][0]["poses"]
    assert len(poses) == len(log)
    T = Pose2(*poses[0]).inverse() @ Pose2(*poses[2])
    return {"x": T.x, "y": T.y, "theta": T.theta}


def test_detours_lead_over_accepted_matches_only(script, failed):
    """Between neighbours of a sample log there are some, none over either scan, and all agree with the truth."""
    failures = script("failures")
    found = failures.detours(failed[1].held, 0, 2, VERIFIED)
    assert found
    assert all(k not in (0, 2) for k, _ in found)
    truth = Pose2(**still())
    assert all(T.distance(truth)[0] < 0.3 for _, T in found)
    assert f"agree with the truth ({len(found)})" in failures.told_of_detours(found, truth, None)
    assert failures.told_of_detours([], truth, None).startswith("No third scan")
    assert "neither" in failures.told_of_detours(found, None, None)


def test_pictures_of_pairs_that_no_longer_fail_go(script, failed, tmp_path):
    """The folder holds the pictures of the page, no others."""
    failures = script("failures")
    (tmp_path / "failures").mkdir()
    (tmp_path / "failures" / "old.svg").write_text("<svg/>")
    failures.write(tmp_path, failed, "the page")
    assert {path.name for path in (tmp_path / "failures").iterdir()} == {one.picture for one in failed}
    assert (tmp_path / "failures.md").read_text() == "the page"


def test_the_page_of_the_repository_is_complete(script):
    """Every picture it shows is there, and no pair is left without an argument."""
    text = (ROOT / "docs" / "failures.md").read_text()
    shown = {line.partition("(failures/")[2].rstrip(")") for line in text.splitlines() if line.startswith("![")}
    assert shown == {path.name for path in (ROOT / "docs" / "failures").glob("*.svg")}
    assert "Not argued yet." not in text


def test_a_pair_that_did_not_fail_is_not_listed(failed):
    """The sample pairs fail for their truth, whatever the verdict."""
    assert all(one.outcome.fault for one in failed)
    assert failed[0].outcome.match.verdict in Verdict
