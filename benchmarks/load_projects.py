"""The projects for load.py: many small ones, and a large one with everything matched, as after a night's work."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from app.kept import keep_matches
from app.matching import Settings
from app.resources import samples_folder
from app.review import Outcome
from app.session import Session
from segmap.events import Choice, Decide, IntegrationId, Proposal, Propose
from segmap.integration import DEFAULT_HEURISTIC, DEFAULT_PRESET, Match, match_maps
from segmap.logs import read_log
from segmap.parameters import preset
from segmap.scans import ScanId
from segmap.segments import extract
from segmap.store import Store

MODE = "verified"
BATCH = 500
ACCEPTED = 1500
"""pairs accepted in the large project"""
SMALL_SCANS = 12


def repeated(name: str, scans: int) -> bytes:
    """A sample's scans again and again."""
    lines = (samples_folder() / f"{name}.log").read_bytes().splitlines(keepends=True)
    laser = [line for line in lines if line.startswith(b"FLASER")]
    head = [line for line in lines if not line.startswith(b"FLASER")]
    return b"".join([*head, *(laser[i % len(laser)] for i in range(scans))])


def _new(path: Path, name: str, log: bytes) -> int:
    read = read_log(log, f"{name}.log")
    with Store.create(path, name, preset(DEFAULT_PRESET[MODE]), DEFAULT_HEURISTIC[MODE], MODE) as store:
        store.add_log(f"{name}.log", log, scans=len(read), format=read.format)
    return len(read)


def small_projects(folder: Path, count: int) -> None:
    """So many projects of twelve scans, matched and accepted where that is sure."""
    first = folder / "small-000.segmap"
    _new(first, "hall", repeated("hall", SMALL_SCANS))
    session = Session("small", Store.open(first))
    session.settle()
    sure = [row.id for row in session.rows() if row.verdict == "accepted"]
    session.decide(sure[: len(sure) // 2], "accepted")
    session.settle()
    session.close()
    for number in range(1, count):
        shutil.copy(first, folder / f"small-{number:03}.segmap")


def large_project(path: Path, scans: int, integrations: int) -> None:
    """A project of so many scans and pairs, all of them matched."""
    log = repeated("office", scans)
    count = _new(path, "large", log)
    pairs = [IntegrationId(ScanId(0, i), ScanId(0, i + 1)) for i in range(count - 1)]
    step, more = 2, list[IntegrationId]()
    while len(pairs) + len(more) < integrations:
        more += [IntegrationId(ScanId(0, i), ScanId(0, i + step)) for i in range(count - step)]
        step += 1
    more = more[: integrations - len(pairs)]
    with Store.open(path) as store:
        store.append(Propose(proposals=tuple(Proposal(integration=str(pair), kind="closure") for pair in more)))
    _match(path, [*pairs, *more], _matches(log))


def _matches(log: bytes) -> Sequence[Match]:
    """Real matches of the first scans of a log, to stand for all that come again."""
    parameters = preset(DEFAULT_PRESET[MODE])
    maps = [extract(scan, parameters, 0, i) for i, scan in enumerate(read_log(log)[:60])]
    return [match_maps(a, b, parameters, None, MODE) for a, b in pairwise(maps)]


def _match(path: Path, pairs: Sequence[IntegrationId], matches: Sequence[Match]) -> None:
    """Keep the matches in the project, and accept what is sure at its beginning."""
    found = {str(pair): matches[pair.first.scan % len(matches)] for pair in pairs}
    sure = [id for id, match in list(found.items())[:ACCEPTED] if match.verdict == "accepted"]
    names = list(found)
    with Store.open(path) as store:
        state = store.state
        key = Settings(state.parameters, MODE).key(state.heuristic)
        for start in range(0, len(names), BATCH):
            keep_matches(store, key, {id: (found[id], Outcome.of(found[id])) for id in names[start : start + BATCH]})
        made = {"heuristic": state.heuristic, "mode": MODE, "candidate": 0, "parameters": state.fingerprint}
        poses = {id: {"T_1_2": found[id].T_1_2, "value": found[id].value} for id in sure}
        choices = (Choice(integration=id, verdict="accepted", **poses[id], **made) for id in sure)
        store.append(Decide(choices=tuple(choices), who="benchmark"))
