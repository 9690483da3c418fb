"""Walkthroughs over the API and on the command line: any step of any stage, files that hold them, bad questions."""

import io
import json
import re
import zipfile

import pytest
from PIL import Image

from app.classes import Classes
from app.errors import UnknownError
from app.lesson import LESSON
from app.resources import samples_folder, static_folder
from app.walk_pictures import ROLES
from segmap.candidates import PAPER_HEURISTICS
from segmap.walkthrough import SWEPT

HALL = {"sample": "laboratory", "pair": "0.0-0.1", "heuristic": "consecutive"}


def test_stages_then_any_step(client):
    """The overview names stages with their counts; steps come in any order and are the same each time."""
    walk = client.get("/api/walk", params=HALL).json()
    assert walk["pair"] == "0.0-0.1"
    assert walk["heuristics"][0] == "all"
    stages = {stage["id"]: stage for stage in walk["stages"]}
    assert list(stages)[:3] == ["points-1", "points-2", "angles-1"]
    assert set(walk["algorithms"]) >= {stage["algorithm"] for stage in walk["stages"]}
    last = stages["evaluation"]["count"] - 1
    ask = lambda start, count=1: client.get(  # noqa: E731
        "/api/walk/steps", params={**HALL, "stage": "evaluation", "start": start, "count": count}
    ).json()["steps"]
    backwards = [ask(k)[0] for k in range(last, -1, -1)]
    assert ask(0, 64) == backwards[::-1]


def test_a_candidate_can_be_entered(client):
    """What a step says can be entered is a stage of its own."""
    step = client.get("/api/walk/steps", params={**HALL, "stage": "evaluation", "start": 1}).json()["steps"][0]
    entered = client.get("/api/walk/stage", params={**HALL, "stage": step["enter"]["stage"]}).json()
    assert entered["id"] == "pairs:1"
    assert entered["count"] > 1


def test_of_a_project(client, project):
    """The scans of a project are walked through with its own mode, heuristic and parameters."""
    walk = client.get("/api/walk", params={"project": project, "pair": "0.1-0.2"}).json()
    assert walk["mode"] == "verified"
    assert {"refinement", "sight", "result"} <= {stage["id"] for stage in walk["stages"]}
    assert not walk["truth"]


@pytest.mark.parametrize(
    ("asked", "status", "words"),
    [
        ({}, 400, "project or of a sample"),
        ({"sample": "hall", "project": "x"}, 400, "name one"),
        ({"sample": "nowhere"}, 404, "no sample"),
        ({"project": "../x"}, 404, "no project"),
        ({"sample": "hall", "pair": "0.0"}, 400, "0.0-0.1"),
        ({"sample": "hall", "pair": "0.0-0.999"}, 400, "no scan 999"),
        ({"sample": "hall", "pair": "0.0-7.0"}, 404, "no log 7"),
        ({"sample": "hall", "mode": "magic"}, 400, "no mode"),
        ({"sample": "hall", "heuristic": "magic"}, 400, "no heuristic"),
        ({"sample": "hall", "set": "magic=1"}, 400, "magic"),
        ({"sample": "hall", "set": "magic"}, 400, "NAME=VALUE"),
        ({"sample": "hall", "color": "red"}, 422, "color"),
    ],
)
def test_questions_that_make_no_sense(client, asked, status, words):
    """Each is answered in one sentence."""
    answer = client.get("/api/walk", params=asked)
    assert answer.status_code == status, answer.text
    assert words in answer.json()["error"]["message"]


@pytest.mark.parametrize(
    ("more", "status"),
    [({"stage": "nowhere"}, 404), ({"stage": "points-1", "start": 10**6}, 404), ({"stage": "a", "count": 1000}, 422)],
)
def test_steps_that_are_not_there(client, more, status):
    """A stage or a step that does not exist is said so."""
    assert client.get("/api/walk/steps", params={**HALL, **more}).status_code == status


@pytest.mark.slow
def test_files(client):
    """The page holds every stage and fetches nothing; the archive holds numbered PNGs, the animation its frames."""
    page = client.get("/api/walk/file/html", params=HALL)
    assert "attachment" in page.headers["content-disposition"]
    held = json.loads(re.search(r'<script type="application/json" id="walk">(.*?)</script>', page.text, re.S)[1])
    assert list(held["steps"]) == [stage["id"] for stage in held["walk"]["stages"]]
    assert all(len(held["steps"][stage["id"]]) == stage["count"] for stage in held["walk"]["stages"])
    assert not re.search(r"""\b(?:src|href)\s*=\s*["']|@import|\bimport\b[^.]*\bfrom\b""", page.text.split("<main")[0])
    archive = zipfile.ZipFile(io.BytesIO(client.get("/api/walk/file/zip", params={**HALL, "most": 12}).content))
    names = archive.namelist()
    assert [name[:3] for name in names] == [f"{k:03d}" for k in range(1, len(names) + 1)]
    assert Image.open(archive.open(names[0])).size == (1280, 720)
    chain = {**HALL, "stage": "chains", "most": 4}
    assert Image.open(io.BytesIO(client.get("/api/walk/file/gif", params=chain).content)).n_frames > 1
    assert client.get("/api/walk/file/exe", params=HALL).status_code == 400
    assert client.get("/api/walk/file/zip", params={**HALL, "stage": "x"}).status_code == 404


def test_colours_of_files_are_those_of_the_page():
    """Images and the player give each role one colour."""
    css = (static_folder() / "css" / "figures.css").read_text()
    light = dict(re.findall(r"--((?:role|chain)-[\w-]+): light-dark\((#\w{6}), #\w{6}\);", css))
    assert len(light) == 17
    told = {name.removeprefix("role-"): colour for name, colour in light.items()}
    assert {name: ROLES[name] for name in told} == told


def test_command(run, tmp_path):
    """The command writes what the suffix says, and says no to another."""
    log = samples_folder() / "hall.log"
    out = tmp_path / "hall.html"
    status, told, _ = run("walkthrough", log, 0, 1, "--out", out, "--mode", "paper", "--heuristic", "random")
    assert status == 0
    assert "stages" in told
    assert "Hall" in out.read_text() or "hall.log" in out.read_text()
    merged = tmp_path / "merge.html"
    assert run("walkthrough", log, 10, 12, "--merge", "--out", merged)[0] == 0
    assert "The three methods compared" in merged.read_text()
    assert run("walkthrough", log, 10, 50, "--merge", "--out", merged)[0] == 2
    assert run("walkthrough", log, 0, 1, "--out", tmp_path / "hall.mp4")[0] == 2
    assert run("walkthrough", log, 0, 999, "--out", out)[0] == 2


def test_a_merge_and_an_integration_of_it(client):
    """A row of scans is merged by three methods; a step that was an integration can be gone into."""
    merge = {"sample": "laboratory", "merge": "0.0-0.3", "mode": "verified"}
    walk = client.get("/api/walk", params=merge).json()
    assert [stage["id"] for stage in walk["stages"]] == ["sequential", "tree", "pivot", "comparison", "graph"]
    tree = walk["stages"][1]
    assert {"kind": "tree"}.items() <= tree["chart"].items()
    asked = {**merge, "stage": "tree", "start": 0, "count": tree["count"]}
    steps = client.get("/api/walk/steps", params=asked).json()["steps"]
    node = steps[-1]["enter"]["node"]
    inner = client.get("/api/walk", params={**merge, "node": node}).json()
    assert {"chains", "result"} <= {stage["id"] for stage in inner["stages"]}
    assert client.get("/api/walk", params={**merge, "node": "tree:0"}).status_code == 404
    for row in ("0.0-0.40", "0.3-0.0", "0.0-1.2", "0.0"):
        assert client.get("/api/walk", params={**merge, "merge": row}).status_code == 400


def test_the_graph_of_a_project(client, project):
    """What is accepted is optimised step by step; without two integrations that is said."""
    graph = {"project": project, "graph": "true"}
    assert "two accepted" in client.get("/api/walk", params=graph).json()["error"]["message"]
    ids = [row["id"] for row in client.get(f"/api/projects/{project}/integrations").json()["integrations"]]
    body = {"integrations": ids, "verdict": "accepted"}
    assert client.post(f"/api/projects/{project}/decisions", json=body).status_code == 200
    (stage,) = client.get("/api/walk", params=graph).json()["stages"]
    asked = {**graph, "stage": "graph", "start": stage["count"] - 1}
    assert client.get("/api/walk/steps", params=asked).json()["steps"][0]["line"] == "5"


def test_race_and_sweep(client):
    """Every heuristic of both modes runs, and a parameter goes through its range; the truth of a sample is known."""
    raced = client.get("/api/walk/race", params=HALL).json()
    assert raced["truth"]
    assert [run["heuristic"] for run in raced["runs"] if run["mode"] == "paper"] == list(PAPER_HEURISTICS)
    assert {run["right"] for run in raced["runs"]} <= {True, False}
    asked = {**HALL, "parameter": "angle_difference_tolerance"}
    swept = client.get("/api/walk/sweep", params=asked).json()
    settings = [run["setting"] for run in swept["runs"]]
    assert settings == sorted(settings) == list(SWEPT["angle_difference_tolerance"])
    tries = [run["tries"] for run in swept["runs"]]
    assert tries == sorted(tries), "a larger tolerance lets more candidates in"
    assert client.get("/api/walk/sweep", params={**HALL, "parameter": "magic"}).status_code == 400
    assert client.get("/api/walk/race", params={"sample": "hall", "merge": "0.0-0.3"}).status_code == 400


def test_each_stop_of_the_lesson_restores_a_view(client):
    """Every address leads to a stage that exists and to the step that is meant, a mark by its label."""
    stops = client.get("/api/lesson").json()["stops"]
    assert 10 <= len(stops) <= 15
    for stop in LESSON:
        assert str(stop.url(1)) in {**stops[0], "url": stop.url(1)}["url"]
        held = client.get("/api/walk/stage", params={**stop.asked, "stage": stop.stage})
        assert held.status_code == 200, stop.title
        assert stop.step in [label for _, label in held.json()["marks"]], stop.title


def test_the_lesson_tells_the_truth(client):
    """The corridor's best value is wrong by metres and verified mode right; the tree doubles more than the pivot."""

    def step_of(title):
        stop = next(stop for stop in LESSON if stop.title == title)
        asked = {**stop.asked, "stage": stop.stage}
        marks = client.get("/api/walk/stage", params=asked).json()["marks"]
        (at,) = [index for index, label in marks if label == stop.step]
        step = client.get("/api/walk/steps", params={**asked, "start": at}).json()["steps"][0]
        return {name: value for name, value, _ in step["quantities"]}

    assert float(step_of("Why corridors are ambiguous")["off the truth"]) > 1.5
    assert float(step_of("The truth is among the candidates")["off the truth"]) < 0.1
    corridor = next(stop for stop in LESSON if "beams" in stop.title).asked
    result = client.get("/api/walk/stage", params={**corridor, "stage": "result"}).json()
    asked = {**corridor, "stage": "result", "start": result["count"] - 1}
    (last,) = client.get("/api/walk/steps", params=asked).json()["steps"]
    assert float({name: value for name, value, _ in last["quantities"]}["off the truth"]) < 0.2
    merge = next(stop for stop in LESSON if "tree" in stop.title).asked
    asked = {**merge, "stage": "comparison", "count": 3}
    steps = client.get("/api/walk/steps", params=asked).json()["steps"]
    _, tree, pivot = [float(step["quantities"][-1][1]) for step in steps]
    assert tree > 2.0 * pivot


def test_a_class_follows(client):
    """Who shared leads; who has the link sees where it is, and cannot lead; only walkthroughs can be led to."""
    place = "sample=hall&pair=0.0-0.1&stage=chains&step=2"
    made = client.post("/api/classes", json={"place": place})
    assert made.status_code == 201
    id, key = made.json()["id"], made.json()["key"]
    url, seen = f"/api/classes/{id}", f"/follow/walk/{id}"
    assert client.get(f"{seen}/place").json() == {"place": place, "serial": 1}
    on = place.replace("step=2", "step=3")
    assert client.post(url, json={"key": key, "place": on}).json() == {"serial": 2}
    assert client.get(f"{seen}/place").json() == {"place": on, "serial": 2}
    assert key not in client.get(f"{seen}/place").text
    asked = {"sample": "hall", "pair": "0.0-0.1", "stage": "chains", "start": 3}
    followed = client.get(f"{seen}/api/steps", params={"stage": "chains", "start": 3}).json()
    assert followed == client.get("/api/walk/steps", params=asked).json()
    elsewhere = client.get(f"{seen}/api", params={"sample": "laboratory"}).json()
    assert elsewhere == client.get("/api/walk", params={"sample": "hall", "pair": "0.0-0.1"}).json()
    assert client.post(url, json={"key": "guess", "place": place}).status_code == 404
    assert client.post(url, json={"key": key, "place": "https://elsewhere.example"}).status_code == 400
    assert client.get("/follow/walk/nobody/place").status_code == 404
    assert client.get("/follow/walk/nobody/api").status_code == 404
    assert client.get(f"{seen}/place").json()["place"] == on


def test_classes_end():
    """A class nobody moves is over after hours, and there are never more than some."""
    now = [0.0]
    classes = Classes(clock=lambda: now[0])
    made = [classes.open("sample=hall") for _ in range(60)]
    with pytest.raises(UnknownError):
        classes.get(made[0].id)
    assert classes.get(made[-1].id).serial == 1
    now[0] = 1e6
    with pytest.raises(UnknownError, match="over"):
        classes.get(made[-1].id)


def test_a_project_as_a_walkthrough(run, client, project, tmp_path):
    """export --to walkthrough writes the first accepted pair step by step, and the graph of all of them."""
    ids = [row["id"] for row in client.get(f"/api/projects/{project}/integrations").json()["integrations"]]
    client.post(f"/api/projects/{project}/decisions", json={"integrations": ids, "verdict": "accepted"})
    file, out = tmp_path / "copy.segmap", tmp_path / "walk.html"
    file.write_bytes(client.get(f"/api/projects/{project}/download").content)
    assert run("export", file, "--to", "walkthrough", "--out", out)[0] == 0
    assert '"id":"refinement"' in out.read_text()
    assert '"id":"graph"' in out.read_text()
    assert run("export", file, "--to", "walkthrough", "--out", tmp_path / "walk.exe")[0] == 2
