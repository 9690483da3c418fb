"""Servers killed while they match, and right after a click: every decision is there again, and the same map.

As in :mod:`crashing`, with decisions that make a map; after each kill the history is replayed as ``segmap replay``
does, and the next server's map must have that hash.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from crashing import PATIENCE, _line

from app.inputs import Inputs
from app.merged import merge_project
from segmap.store import Store

LONGEST = 0.6
"""seconds that a person works at most before the server is killed"""


@dataclass
class Clicks:
    """What a killed server had acknowledged, by the name each click was made under: the pair and the verdict."""

    made: dict[str, tuple[str, str]] = field(default_factory=dict)
    map_before: str = ""
    """hash of the map the server began with; empty where nothing is accepted"""


def kill(process: subprocess.Popen[str], project: str, seed: int) -> Clicks:
    """Let a person decide while everything is matched again, and kill the server: at any time, or after a click."""
    numbers, clicks, clicked = random.Random(seed), Clicks(), threading.Event()
    assert process.stdin is not None
    process.stdin.write("go\n")
    server = int(_line(process).removeprefix("pid "))
    url = f"http://127.0.0.1:{_line(process).removeprefix('at ')}/api/projects/{project}"
    with httpx.Client(timeout=PATIENCE, trust_env=False) as client:
        clicks.map_before = map_hash(client, url)
        changes = {"sight_tolerance": round(0.2 + 1e-4 * seed, 6)}
        client.post(f"{url}/parameters", json={"changes": changes, "who": f"{seed}.p"}).raise_for_status()
        person = threading.Thread(target=_decide, args=(url, seed, clicks, clicked))
        person.start()
        if numbers.random() < 0.5:
            clicked.wait(PATIENCE)  # right after a click
        else:
            time.sleep(numbers.random() * LONGEST)
        os.kill(server, signal.SIGKILL)
    person.join(PATIENCE)
    while _line(process) != "dead":
        pass
    return clicks


def map_hash(client: httpx.Client, url: str) -> str:
    """Of the map a server shows."""
    answer = client.get(f"{url}/export/geojson")
    if answer.status_code != 200:
        return ""
    return str(answer.json()["metadata"]["map_hash"])


def _decide(url: str, seed: int, clicks: Clicks, clicked: threading.Event) -> None:
    """Accept, reject and clear what is matched, until the server is gone."""
    numbers = random.Random(-seed)
    with httpx.Client(timeout=PATIENCE, trust_env=False) as client, suppress(httpx.HTTPError):
        for turn in range(100_000):
            rows = client.get(f"{url}/integrations").json()["integrations"]
            row = numbers.choice(rows)
            verdict = numbers.choice(("accepted", "accepted", "rejected", "undecided"))
            who = f"{seed}.{turn}"
            body: dict[str, Any] = {"integrations": [row["id"]], "verdict": verdict, "who": who}
            answer = client.post(f"{url}/decisions", json=body)
            if answer.status_code == 200 and answer.json()["rows"]:  # else it was so already, or is not matched yet
                clicks.made[who] = row["id"], verdict
                clicked.set()


def replayed(path: Path) -> str:
    """The hash that ``segmap replay`` prints; empty where nothing is accepted."""
    with Store.open(path) as store:
        inputs = Inputs(store, store.state.logs, store.log_bytes)
        merged = merge_project(store.state, inputs.segment_map)
        return merged.hash if merged.components else ""


def lost(path: Path, clicks: Clicks) -> list[str]:
    """What was acknowledged and is not in the history, or not as it was said."""
    with Store.open(path) as store:
        events = {event.who: event for event in store.events()}
    found = []
    for who, (integration, verdict) in clicks.made.items():
        event = events.get(who)
        choices = [(c.integration, c.verdict) for c in getattr(event, "choices", ())]
        choices += [(name, "undecided") for name in getattr(event, "integrations", ())]
        if (integration, verdict) not in choices:
            found.append(f"{who}: {integration} {verdict}")
    return found
