"""How fast a walkthrough of a large run is made, and how fast one jumps in it.

    python benchmarks/walkthrough.py [--candidates 20000] [--jumps 200] [--logs DIR] [--pairs DIR]

A pair of real scans whose `all` gives at least so many candidates is walked through in paper mode. Timed: the run
without and with recording, making the walkthrough, then jumps to steps drawn by lot in every stage through the HTTP
API in this process, as the page makes them: the answer as JSON text, in milliseconds of wall clock.
"""

from __future__ import annotations

import asyncio
import gzip
import random
import tempfile
import time
from pathlib import Path
from statistics import median

import httpx
from common import LogPairs, arguments, load, markdown, provenance

from app.server import create_app
from segmap import tracing
from segmap.benchmark import Pair
from segmap.integration import integrate
from segmap.parameters import Parameters


def largest(logs: list[LogPairs], least: int) -> tuple[LogPairs, Pair]:
    """The pair with the fewest candidates that has at least ``least``."""
    found = []
    for held in logs:
        for pair in held.pairs:
            one, other = held.maps(pair, Parameters())
            if min(len(one), len(other)) >= 25:
                match = integrate(one, other, Parameters(), "all").match
                if match.candidates >= least:
                    found.append((match.candidates, held, pair))
            if len(found) >= 5:
                break
    if not found:
        raise SystemExit(f"No pair has {least} candidates.")
    _, held, pair = min(found, key=lambda one: one[0])
    return held, pair


def recorded(held: LogPairs, pair: Pair) -> tuple[float, float]:
    """Milliseconds of the run without and with recording, medians of five."""
    maps = held.maps(pair, Parameters())
    plain, traced = [], []
    for _ in range(5):
        started = time.perf_counter()
        integrate(*maps, Parameters(), "all")
        plain.append(time.perf_counter() - started)
        with tracing.recording():
            started = time.perf_counter()
            integrate(*maps, Parameters(), "all")
            traced.append(time.perf_counter() - started)
    return 1000.0 * median(plain), 1000.0 * median(traced)


async def jumps(log: bytes, name: str, count: int) -> list[tuple[str, int, list[float]]]:
    """Stages with their steps, and the milliseconds of each jump in them."""
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(Path(folder))
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8000") as client:
            made = (await client.post("/api/projects", files={"files": (name, log)})).json()
            asked = {"project": made["id"], "pair": "0.0-0.1", "mode": "paper", "heuristic": "all"}
            started = time.perf_counter()
            walk = (await client.get("/api/walk", params=asked, timeout=600)).json()
            rows = [("(the walkthrough is made)", 1, [1000.0 * (time.perf_counter() - started)])]
            lots = random.Random(0)
            for stage in walk["stages"]:
                times = []
                for _ in range(count):
                    params = {**asked, "stage": stage["id"], "start": lots.randrange(stage["count"])}
                    started = time.perf_counter()
                    (await client.get("/api/walk/steps", params=params)).raise_for_status().json()["steps"][0]
                    times.append(1000.0 * (time.perf_counter() - started))
                rows.append((stage["id"], stage["count"], times))
        app.state.services.close()
    return rows


def two_scans(path: Path, lines: tuple[int, int]) -> bytes:
    """Two lines of a CARMEN log as a log of its own."""
    data = path.read_bytes()
    text = (gzip.decompress(data) if path.suffix == ".gz" else data).decode()
    rows = dict(enumerate(text.splitlines(keepends=True), start=1))
    return "".join(rows[line] for line in lines).encode()


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--candidates", type=int, default=20_000)
    parser.add_argument("--jumps", type=int, default=200, help="in each stage")
    options = parser.parse_args()
    held, pair = largest(load(options.logs, options.pairs), options.candidates)
    plain, traced = recorded(held, pair)
    print(provenance(), f"\n{held.name} {pair.i}, {pair.j}: run {plain:.0f} ms, recorded {traced:.0f} ms\n")
    lines = held.log.scan(pair.i).line, held.log.scan(pair.j).line
    assert None not in lines
    path = options.logs / next(options.logs.glob(f"*/{Path(held.log.name).name}*")).relative_to(options.logs)
    rows = asyncio.run(jumps(two_scans(path, lines), "pair.log", options.jumps))  # type: ignore[arg-type]
    told = [(id, count, f"{median(ms):.1f}", f"{max(ms):.1f}") for id, count, ms in rows]
    print(markdown(("stage", "steps", "median ms", "slowest ms"), told))


if __name__ == "__main__":
    main()
