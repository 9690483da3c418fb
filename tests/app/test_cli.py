"""The ``segmap`` command: what it prints, what it writes, and how it says no."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numba
import numpy as np
import pytest
from map_server import FREE, load_map

import app.server
from app.cli.compiling import compiling
from app.resources import program_version, samples_folder
from segmap.benchmark import is_right
from segmap.export import FORMATS
from segmap.integration import DEFAULT_HEURISTIC, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import extract
from segmap.store import Store

OFFICE, HALL = (str(samples_folder() / name) for name in ("office.log", "hall.log"))
FIRST, SECOND = (str(samples_folder() / f"two-robots-{letter}.log") for letter in "ab")
COMMANDS = ("serve", "info", "segments", "integrate", "merge", "export", "report", "replay", "benchmark", "sample")
SCANS = [len(read_log(log)) for log in (FIRST, SECOND)]
RANGES = " ".join(["2.50"] * 90 + ["81.83"] * 90)
RECORD = f"FLASER 180 {RANGES} 0 0 0 0 0 0 1.0 host 1.0\n"

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def document(run: Run) -> Callable[..., Any]:
    """Run the command with ``--json``: the one document on standard output."""

    def document(*arguments: object) -> Any:
        status, out, err = run(*arguments, "--json")
        assert (status, err) == (0, "")
        assert out.count("\n") == 1
        return json.loads(out)

    return document


def truth_of(name: str, session: int = 0) -> list[Pose2]:
    truth = json.loads((samples_folder() / f"{name}.truth.json").read_text())
    return [Pose2(*row) for row in truth["sessions"][session]["poses"]]


# --- help and bad usage ---------------------------------------------------------------------------


def test_version(run: Run) -> None:
    """``--version`` says the version and nothing else."""
    assert run("--version") == (0, f"segmap {program_version()}\n", "")


def test_help_names_every_command_and_every_command_has_help(run: Run) -> None:
    """Each command of the documented command line is there and explains itself."""
    status, out, _ = run("--help")
    assert status == 0
    for command in COMMANDS:
        assert re.search(rf"\b{command}\b", out)
        status, told, _ = run(command, "--help")
        assert status == 0
        assert f"segmap {command}" in told


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("info", "nowhere.log"), "There is no file nowhere.log"),
        (("info", __file__), "is no laser log"),
        (("segments", HALL, "--scan", "300"), "hall.log has no scan 300: it holds scans 0 to"),
        (("integrate", HALL, "0", "99"), "hall.log has no scan 99"),
        (
            ("integrate", HALL, "0", "1", "--heuristic", "best"),
            "no heuristic 'best' in verified mode. Heuristics are: automatic",
        ),
        (
            ("integrate", HALL, "0", "1", "--mode", "paper", "--heuristic", "automatic"),
            "in paper mode. Heuristics are: all",
        ),
        (
            ("integrate", HALL, "0", "1", "--mode", "paper", "--heuristic", "extremes"),
            "no heuristic 'extremes' in paper mode. Heuristics are: all, consecutive, random, histogram.",
        ),
        (("integrate", HALL, "0", "1", "--mode", "guess"), "There is no mode 'guess'. Modes are: paper"),
        (("integrate", HALL, "0", "1", "--preset", "mine"), "There is no preset 'mine'. Presets are: default"),
        (("integrate", HALL, "0", "1", "--set", "taus=1"), "There is no parameter 'taus'"),
        (("integrate", HALL, "0", "1", "--set", "max_range"), "write --set NAME=VALUE"),
        (("integrate", HALL, "0", "1", "--set", "max_range=-1"), "Parameter max_range cannot be '-1'"),
        (("merge", HALL, "--method", "luck"), "no merging method 'luck'. Methods are: sequential, tree, pivot"),
        (("merge", HALL, "--out", "map.pdf"), "map.pdf does not say its format"),
        (("merge", HALL, "--project", HALL), "is there already"),
        (("export", HALL, "--to", "svg", "--out", "map.svg"), "hall.log"),
        (("replay", "nowhere.segmap"), "nowhere.segmap"),
        (("benchmark", "pairs", HALL, "--logs", "."), "hall.log is not a set of pairs"),
        (("benchmark", "pairs", "nowhere.json", "--logs", "."), "nowhere.json cannot be read"),
        (("sample", f"{HALL}/folder"), "not a directory"),
        (("serve", "nowhere.log", "--no-browser"), "nowhere.log"),
    ],
)
def test_bad_input_is_one_line_and_status_2(run: Run, arguments: tuple[str, ...], expected: str) -> None:
    """What segmap raises on purpose is one line on standard error, never a traceback."""
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("segmap: ")
    assert err.count("\n") == 1
    assert expected in err


@pytest.mark.parametrize("arguments", [("dance",), ("segments", HALL), ("integrate", HALL, "one", "2"), ("--fast",)])
def test_bad_usage_is_status_2(run: Run, arguments: tuple[str, ...]) -> None:
    """An unknown command or option, a missing or an impossible argument: usage on standard error."""
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert "Usage: segmap" in err


def test_interruption_is_no_traceback(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl+C ends a command with the usual status."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(app.server, "serve", interrupted)
    assert run("serve")[0] == 130


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error() -> None:
    """``segmap segments ... | head`` ends quietly."""
    command = [sys.executable, "-c", "from app.cli import main; main()", "segments", OFFICE, "--scan", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == b""
        assert process.wait() in (0, 1)


# --- looking into logs ----------------------------------------------------------------------------


def test_info_says_what_is_in_a_log(run: Run, document: Callable[..., Any]) -> None:
    """Format, scans, laser and the no-return reading, for people and for programs."""
    status, out, _ = run("info", OFFICE)
    assert status == 0
    for expected in ("CARMEN", "76 scans of 180 beams, -90 to 89 deg", "81.83 m", "never used for matching"):
        assert expected in out
    facts = document("info", OFFICE)
    assert (facts["scans"], facts["no_return"], facts["problems"]) == (76, 81.83, [])
    assert facts["lasers"][0]["beams"] == 180
    assert 0.98 < facts["returns"] < 1.0


def test_info_names_the_lines_that_could_not_be_read(run: Run, tmp_path: Path) -> None:
    """One bad line is told of, and the scans around it are kept."""
    path = tmp_path / "dented.log"
    path.write_text(RECORD + "FLASER 180 1.0 oops\n" + RECORD)
    status, out, _ = run("info", path)
    assert status == 0
    assert "line 2: " in out
    status, out, err = run("segments", path, "--scan", "1", "--json")
    assert status == 0
    assert "line 2: " in err
    assert json.loads(out)["segments"]


def test_info_of_an_empty_log(run: Run, tmp_path: Path) -> None:
    """A log without anything in it is told of plainly."""
    path = tmp_path / "empty.log"
    path.touch()
    status, out, _ = run("info", path)
    assert status == 0
    assert "is empty" in out


def test_segments_are_those_of_the_library(run: Run, document: Callable[..., Any]) -> None:
    """Every digit, in beam order; presets and single parameters apply."""
    scan = read_log(OFFICE).scan(7)
    assert document("segments", OFFICE, "--scan", 7)["segments"] == extract(scan, Parameters()).coordinates.tolist()
    changed = preset("paper-lab").replace(min_segment_length=0.5, max_range=None)
    options = ("--preset", "paper-lab", "--set", "min_segment_length=0.5", "--set", "max_range=none")
    assert (
        document("segments", OFFICE, "--scan", 7, *options)["segments"] == extract(scan, changed).coordinates.tolist()
    )
    status, out, _ = run("segments", OFFICE, "--scan", 7)
    assert status == 0
    assert len(out.splitlines()) == 2 + len(extract(scan, Parameters()))


# --- integrating ----------------------------------------------------------------------------------


@pytest.mark.parametrize("heuristic", ["all", "consecutive", "random", "histogram"])
def test_integrate_says_what_the_library_found(document: Callable[..., Any], heuristic: str) -> None:
    """Pose, value, counts, chains and verdict; ``random`` adds its draws."""
    told = document("integrate", OFFICE, 20, 21, "--mode", "paper", "--heuristic", heuristic)
    maps = [extract(read_log(OFFICE).scan(i), Parameters(), index=i) for i in (20, 21)]
    match = match_maps(maps[0], maps[1], Parameters(), heuristic, "paper")
    assert match.T_1_2 is not None
    assert told["pose"] == dict(zip(("x", "y", "theta"), match.T_1_2, strict=True))
    assert (told["value"], told["candidates"], told["heuristic"]) == (match.value, match.candidates, heuristic)
    assert told["segments"] == [len(maps[0]), len(maps[1])]
    assert told["chains"] == [[[a, b] for a, b, _ in chain.pairs] for chain in match.chains]
    assert (told["verdict"], told["reasons"]) == (match.verdict, list(match.reasons))
    assert told["milliseconds"] > 0.0
    assert told.get("draws") == match.draws


def test_each_mode_has_its_own_defaults(document: Callable[..., Any]) -> None:
    """Verified mode is the default; heuristic and preset are the mode's own unless others are asked for."""
    maps = [extract(read_log(OFFICE).scan(i), Parameters(), index=i) for i in (20, 21)]
    for mode, options in (("verified", ()), ("paper", ("--mode", "paper"))):
        told = document("integrate", OFFICE, 20, 21, *options)
        match = match_maps(maps[0], maps[1], preset("verified" if mode == "verified" else "default"), None, mode)
        assert (told["mode"], told["heuristic"]) == (mode, DEFAULT_HEURISTIC[mode])
        assert (told["value"], told["verdict"]) == (match.value, match.verdict)
        assert told["reasons"] == list(match.reasons)
        assert told["confidence"] == match.confidence


def test_integrate_tells_the_evidence(document: Callable[..., Any]) -> None:
    """Score, evidence in metres and uncertainty of the best and of its rivals; nothing of it in paper mode."""
    told = document("integrate", OFFICE, 20, 21)
    maps = [extract(read_log(OFFICE).scan(i), Parameters(), index=i) for i in (20, 21)]
    best, *rivals = match_maps(maps[0], maps[1], preset("verified"), None, "verified").ranked
    assert best.evidence is not None
    assert best.uncertainty is not None
    assert (told["score"], told["evidence"]["supported"]) == (best.score, best.evidence.supported)
    assert told["evidence"]["agreement"] == best.evidence.agreement
    assert told["uncertainty"]["weakest"] == best.uncertainty.weakest
    assert [rival["score"] for rival in told["rivals"]] == [rival.score for rival in rivals]
    assert all(set(rival["evidence"]) == set(told["evidence"]) for rival in told["rivals"])
    assert not {"score", "evidence", "rivals"} & set(document("integrate", OFFICE, 20, 21, "--mode", "paper"))


def test_integrate_explains_only_when_asked(run: Run, document: Callable[..., Any]) -> None:
    """--explain: what sums to value, score and confidence, as JSON and as tables; in paper mode the value alone."""
    told = document("integrate", OFFICE, 20, 21, "--explain")
    explained = told["explanation"]
    assert sum(pair["value"] for pair in explained["pairs"]) == pytest.approx(told["value"])
    assert explained["score"] == pytest.approx(told["score"])
    assert sum(explained["terms"].values()) == pytest.approx(told["score"])
    assert 1.0 / (1.0 + math.exp(-sum(explained["confidence"].values()))) == pytest.approx(told["confidence"])
    assert "explanation" not in document("integrate", OFFICE, 20, 21)
    paper = document("integrate", OFFICE, 20, 21, "--mode", "paper", "--explain")["explanation"]
    assert paper["pairs"]
    assert paper["score"] is paper["sights"] is paper["confidence"] is None
    status, out, _ = run("integrate", OFFICE, 20, 21, "--explain")
    assert status == 0
    for expected in ("pairs of segments", "common 1 m", "worst segments", "logit of the confidence"):
        assert expected in out
    assert "worst segments" not in run("integrate", OFFICE, 20, 21)[1]


def test_integrate_takes_a_prior(document: Callable[..., Any], run: Run) -> None:
    """--prior and --prior-std, in metres and degrees: near the truth it is found, elsewhere it is said."""
    truth = truth_of("office")[20].inverse() @ truth_of("office")[21]
    near = f"{truth.x + 0.1:.3f},{truth.y:.3f},{np.degrees(truth.theta):.1f}"
    told = document("integrate", OFFICE, 20, 21, "--prior", near, "--prior-std", "0.3,0.3,8")
    assert told["verdict"] == "accepted"
    assert is_right(Pose2(*told["pose"].values()), truth)
    far = document("integrate", OFFICE, 20, 21, "--prior", "-4,3,90", "--prior-std", "0.3,0.3,8")
    assert far["verdict"] != "accepted"
    assert "prior" in " ".join(far["reasons"])
    for options, expected in (
        (("--prior", "1,2,3"), "--prior-std"),
        (("--prior", "1,2", "--prior-std", "1,1,1"), "X,Y,DEGREES"),
        (("--prior", "1,2,3", "--prior-std", "1,1,0"), "positive"),
    ):
        status, out, err = run("integrate", OFFICE, 20, 21, *options)
        assert (status, out) == (2, "")
        assert expected in err


def test_integrate_finds_where_the_robot_went(document: Callable[..., Any]) -> None:
    """In the laboratory nearly every pose is within 0.25 m and 5 degrees of the truth."""
    poses, right = truth_of("laboratory"), 0
    log = str(samples_folder() / "laboratory.log")
    for i in range(0, 60, 6):
        told = document("integrate", log, i, i + 1)["pose"]
        right += is_right(Pose2(told["x"], told["y"], told["theta"]), poses[i].inverse() @ poses[i + 1])
    assert right >= 9


def test_integrate_for_people(run: Run) -> None:
    """Verdict, reasons, pose and value in words."""
    status, out, _ = run("integrate", OFFICE, 20, 21)
    assert status == 0
    for expected in ("verdict", "threshold", "pose of 21 in 20", "deg", "candidates"):
        assert expected in out


def test_no_transformation_is_a_result(run: Run, document: Callable[..., Any], tmp_path: Path) -> None:
    """Scans without returns: a null pose, and the reason in words."""
    path = tmp_path / "blind.log"
    path.write_text(RECORD.replace("2.50", "81.83") * 2 + RECORD)
    told = document("integrate", path, 0, 1, "--explain")
    assert told["explanation"] is None
    assert (told["pose"], told["value"], told["verdict"], told["chains"]) == (None, 0.0, "rejected", [])
    assert told["reasons"]
    status, out, _ = run("integrate", path, 0, 1)
    assert status == 0
    assert re.search(r"pose of 1 in 0\s+none", out)


# --- merging and projects -------------------------------------------------------------------------


@pytest.mark.parametrize("command", [("merge",), ("map",)])
def test_what_cannot_be_written_is_told_before_the_work(command: tuple[str, ...], run: Run, tmp_path: Path) -> None:
    """Not after it: no log is so much as read."""
    for option in ("--out", "--trajectory"):
        where = tmp_path / "missing" / "map.svg"
        status, out, err = run(*command, tmp_path / "no.log", option, where)
        assert (status, out) == (2, "")
        assert "there is no folder" in err


def test_names_that_are_none(run: Run, tmp_path: Path) -> None:
    """What could have been meant is told: parameters much alike, and every format that export knows."""
    _, _, err = run("integrate", FIRST, 0, 1, "--set", "angle_tolerance=1")
    assert "Did you mean" in err.split("angle_difference_tolerance")[0]
    _, _, err = run("export", tmp_path / "no.segmap", "--to", "dwg", "--out", tmp_path / "map.dwg")
    assert "ros, dxf, svg," in err
    assert "report, walkthrough." in err


def test_help_flows(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paragraphs of a help are as wide as the terminal lets them be, whatever the lines of the source."""
    monkeypatch.setenv("COLUMNS", "72")
    _, out, _ = run("map", "--help")
    told = out.split("LOGS...")[1].split("Arguments")[0].rsplit("\n", 1)[0]
    paragraphs = [lines for one in re.split(r"\n\s*\n", told) if (lines := one.strip().splitlines())]
    assert len(paragraphs) >= 2
    assert all(len(line) > 50 for lines in paragraphs for line in lines[:-1])


def test_compiling_is_told_and_is_no_matching(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """What is compiled the first time is said once where a person sits, and timed apart."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with compiling() as idle:
        pass
    with compiling() as busy:
        for shift in (1, 2):
            assert numba.njit(lambda x, shift=shift: x + shift)(1) == 1 + shift
    assert (idle.milliseconds, idle.told) == (0.0, False)
    assert busy.milliseconds > 1.0
    assert capsys.readouterr().err.count("compiling for this computer") == 1


@pytest.fixture
def merged(document: Callable[..., Any], tmp_path: Path) -> Any:
    """Both robots' logs merged, with everything that can be written."""
    outputs = ("--out", tmp_path / "map.svg", "--out", tmp_path / "map.geojson", "--project", tmp_path / "map.segmap")
    return document("merge", FIRST, SECOND, *outputs)


@pytest.mark.slow
def test_merge_replay_and_export_agree(merged: Any, run: Run, tmp_path: Path) -> None:
    """The project replays to the hash that merging printed, and exports the same segments."""
    assert run("replay", tmp_path / "map.segmap") == (0, f"{merged['hash']}\n", "")
    for format in FORMATS.values():
        to = tmp_path / f"again{format.suffix}"
        assert run("export", tmp_path / "map.segmap", "--to", format.name, "--out", to)[0] == 0
        assert to.stat().st_size > 0
    features = [json.loads((tmp_path / name).read_text())["features"] for name in ("map.geojson", "again.geojson")]
    assert features[0] == features[1]
    assert len(features[0]) == sum(component["segments"] for component in merged["components"])
    assert (tmp_path / "again.svg").read_text().startswith("<svg")
    assert len(ezdxf.readfile(tmp_path / "again.dxf").modelspace().query("LINE")) == len(features[0])


def test_an_exported_map_for_ros_is_free_where_the_robots_were(merged: Any, run: Run, tmp_path: Path) -> None:
    """Every sensor stands on a free cell; the resolution is the one that was asked for."""
    where = ("--out", tmp_path / "floor.yaml", "--resolution", 0.1)
    assert run("export", tmp_path / "map.segmap", "--to", "ros", *where)[0] == 0
    for number, component in enumerate(merged["components"], start=1):
        grid = load_map(tmp_path / ("floor.yaml" if number == 1 else f"floor-{number}.yaml"))
        assert grid.resolution == 0.1
        assert {grid.at(pose["x"], pose["y"]) for pose in component["scans"].values()} == {FREE}


def test_merge_places_or_names_every_scan(merged: Any) -> None:
    """Each scan is in one component or listed as alone; a component is what accepted integrations hold together."""
    placed = [scan for component in merged["components"] for scan in component["scans"]]
    assert len(placed) + len(merged["alone"]) == len({*placed, *merged["alone"]}) == sum(SCANS)
    accepted = [made for made in merged["integrations"] if made["verdict"] == "accepted"]
    assert len(placed) - len(merged["components"]) == len(accepted)
    assert len(merged["integrations"]) == sum(SCANS) - 2


def test_merged_poses_are_near_the_truth(merged: Any) -> None:
    """Each scan lies where it should beside its neighbour, by the measure of the benchmark."""
    truth = [truth_of("two-robots", session) for session in (0, 1)]
    for component in merged["components"]:
        poses = {tuple(map(int, scan.split("."))): Pose2(**pose) for scan, pose in component["scans"].items()}
        for (log, scan), pose in poses.items():
            if (log, scan + 1) in poses:
                true_step = truth[log][scan].inverse() @ truth[log][scan + 1]
                assert is_right(pose.inverse() @ poses[(log, scan + 1)], true_step)


def test_a_merged_project_holds_logs_decisions_and_settings(merged: Any, tmp_path: Path) -> None:
    """The workbench finds the original bytes, and every accepted integration with its evidence."""
    with Store.open(tmp_path / "map.segmap") as store:
        assert store.log_bytes(1) == Path(SECOND).read_bytes()
        assert [log.scans for log in store.state.logs] == SCANS
        decided = {name: decision.value for name, decision in store.state.decisions.items()}
    assert decided == {made["id"]: made["value"] for made in merged["integrations"] if made["verdict"] == "accepted"}


def test_merge_for_people_and_the_trajectory(run: Run, tmp_path: Path) -> None:
    """A table of components; the trajectory holds the largest one, and says which scans it does not hold."""
    status, out, err = run("merge", HALL, "--trajectory", tmp_path / "hall.tum")
    assert status == 0
    assert "integrations accepted" in out
    rows = np.loadtxt(tmp_path / "hall.tum", ndmin=2)
    sizes = [int(line.split()[2]) for line in out.splitlines() if re.match(r"component \d", line)]
    assert rows.shape == (max(sizes), 8)
    assert np.abs(np.hypot(rows[:, 6], rows[:, 7]) - 1.0).max() < 1e-6
    assert err.count("not in this frame") == len(sizes) - 1


def test_merge_without_any_evidence(document: Callable[..., Any], run: Run, tmp_path: Path) -> None:
    """Where nothing is accepted there is no map, and every scan is named; files and project are still valid."""
    outputs = ("--project", tmp_path / "p.segmap", "--trajectory", tmp_path / "t.tum", "--out", tmp_path / "m.svg")
    told = document("merge", HALL, "--set", "value_threshold=1000", *outputs)
    assert told["components"] == []
    assert len(told["alone"]) == len(read_log(HALL))
    assert (tmp_path / "m.svg").read_text().startswith("<svg")
    assert run("replay", tmp_path / "p.segmap") == (0, f"{told['hash']}\n", "")
    status, _, err = run("export", tmp_path / "p.segmap", "--to", "svg", "--out", tmp_path / "again.svg")
    assert status == 2
    assert "nothing to export" in err


# --- the benchmark --------------------------------------------------------------------------------


def test_benchmark_scores_pairs_of_known_truth(run: Run, document: Callable[..., Any], tmp_path: Path) -> None:
    """The documented keys, shares in 0..1, and a table for people."""
    poses = truth_of("laboratory")
    pairs = [{"kind": "consecutive", "i": i, "j": i + 1} for i in range(12)] + [{"kind": "negative", "i": 0, "j": 40}]
    for pair in pairs:
        pair |= dict(zip(("x", "y", "theta"), poses[pair["i"]].inverse() @ poses[pair["j"]], strict=True))
    file = tmp_path / "pairs.json"
    file.write_text(json.dumps({"log": "laboratory.log", "pairs": pairs}))
    (told,) = document("benchmark", "pairs", file, "--logs", samples_folder())["logs"]
    assert told["log"] == "laboratory.log"
    scores = told["kinds"]["consecutive"]
    expected = {"pairs", "success", "median_ms", "p95_ms", "accepted_right", "accepted_wrong", "review", "rejected"}
    assert expected <= set(scores)
    assert scores["pairs"] == 12
    assert scores["success"] > 0.9
    assert told["kinds"]["negative"]["pairs"] == 1
    assert 0.0 <= told["recall_at_zero_false_accepts"] <= 1.0
    status, out, _ = run("benchmark", "pairs", file, "--logs", samples_folder(), "--heuristic", "consecutive")
    assert status == 0
    assert "mean success, consecutive:" in out


def test_real_logs_and_pairs(document: Callable[..., Any], datasets: Path, benchmarks: Path, tmp_path: Path) -> None:
    """The public logs and pairs are taken as they are: here the first ten pairs of the Intel log."""
    held = json.loads((benchmarks / "pairs" / "intel.json").read_text())
    file = tmp_path / "intel.json"
    file.write_text(json.dumps({**held, "pairs": held["pairs"][:10]}))
    (told,) = document("benchmark", "pairs", file, "--logs", datasets, "--mode", "paper", "--heuristic", "all")["logs"]
    assert told["kinds"]["consecutive"]["success"] >= 0.7
    assert document("info", datasets / "intel" / "intel-corrected.log.gz")["scans"] == 910


# --- samples and the workbench --------------------------------------------------------------------


def test_sample_writes_the_samples(run: Run, tmp_path: Path) -> None:
    """The same files as those that come with the program, and their names on standard output."""
    status, out, _ = run("sample", tmp_path / "samples")
    assert status == 0
    for line in out.splitlines():
        assert Path(line).read_bytes() == (samples_folder() / Path(line).name).read_bytes()
    assert len(out.splitlines()) == len(list(samples_folder().iterdir()))


def test_serve_hands_everything_to_the_server(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Files, address, workspace and browser; no browser where nobody sits at a terminal."""
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(app.server, "serve", lambda *arguments: calls.append(arguments))
    assert run("serve")[0] == 0
    assert run("serve", OFFICE, HALL, "--port", 9000, "--workspace", tmp_path, "--host", "::1", "--browser")[0] == 0
    assert calls == [
        ((), "127.0.0.1", None, None, False),
        ([Path(OFFICE), Path(HALL)], "::1", 9000, tmp_path, True),
    ]
