"""What reporting costs while nobody records: the program as it is against a copy without any report.

    python benchmarks/tracing_cost.py [--runs 20] [--logs DIR] [--pairs DIR]

A copy of the library is made in which every `tracing.tell(...)` is taken out. Both run in processes of their own, in
turn, on the same pairs, and are timed by the CPU time of each run; which begins changes from run to run. Printed are
the medians, and the median of the ratios run by run, with that of a second copy beside it: what the machine alone
makes of it.
"""

from __future__ import annotations

import ast
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from common import arguments, load, markdown, provenance

from segmap.parameters import Parameters

ROOT = Path(__file__).resolve().parents[1]
WORKER = """
import pickle, sys, time
from segmap.integration import integrate
from segmap.parameters import preset
maps = pickle.load(sys.stdin.buffer)
def run(mode, heuristic):
    parameters = preset("verified" if mode == "verified" else "default")
    for one, other in maps:
        integrate(one, other, parameters, heuristic, mode)
ways = [("paper", "consecutive"), ("paper", "all"), ("paper", "random"), ("verified", None)]
for way in ways: run(*way)
print("ready", flush=True)
for line in sys.stdin.buffer:
    started = time.process_time()
    for way in ways: run(*way)
    print(time.process_time() - started, flush=True)
"""


class _WithoutReports(ast.NodeTransformer):
    """Takes out statements that report."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if ast.unparse(node).startswith("tracing.tell(") else node


def without_reports(target: Path) -> int:
    """A copy of the library without reports; how many there were."""
    shutil.copytree(ROOT / "segmap", target / "segmap", ignore=shutil.ignore_patterns("__pycache__"))
    taken = 0
    for path in (target / "segmap").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "tracing.tell(" in text and path.name != "tracing.py":
            taken += text.count("tracing.tell(")
            path.write_text(ast.unparse(_WithoutReports().visit(ast.parse(text))), encoding="utf-8")
    return taken


class Runner:
    """A process that runs the work whenever it is told to."""

    def __init__(self, folder: Path, maps: bytes) -> None:
        environment = {**os.environ, "PYTHONPATH": str(folder)}
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "env": environment}
        self._process = subprocess.Popen([sys.executable, "-c", WORKER], **pipes)  # type: ignore[call-overload]
        self._process.stdin.write(maps)
        self._process.stdin.flush()
        assert self._process.stdout.readline().strip() == b"ready"

    def seconds(self) -> float:
        """One run: its CPU time."""
        self._process.stdin.write(b"go\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline())

    def close(self) -> None:
        """End it."""
        self._process.stdin.close()
        self._process.wait()


def interleaved(runners: list[Runner], runs: int) -> list[list[float]]:
    """CPU times of each runner's runs, the runners taking turns."""
    times: list[list[float]] = [[] for _ in runners]
    for run in range(runs):
        order = range(len(runners)) if run % 2 else reversed(range(len(runners)))
        for place in order:
            times[place].append(runners[place].seconds())
    return times


def main() -> None:
    """Print the comparison."""
    parser = arguments(__doc__)
    parser.add_argument("--runs", type=int, default=20, help="interleaved runs of each")
    parser.add_argument("--each", type=int, default=1, help="pairs of each log")
    options = parser.parse_args()
    parameters = Parameters()
    maps = pickle.dumps(
        [log.maps(pair, parameters) for log in load(options.logs, options.pairs) for pair in log.pairs[: options.each]]
    )
    with tempfile.TemporaryDirectory() as folder:
        taken = without_reports(Path(folder))
        runners = [Runner(place, maps) for place in (ROOT, Path(folder), Path(folder))]
        try:
            times = interleaved(runners, options.runs)
        finally:
            for runner in runners:
                runner.close()
    with_reports, without, again = map(median, times)
    more, noise = (median(a / b - 1.0 for a, b in zip(one, times[1], strict=True)) for one in (times[0], times[2]))
    least = [min(one) for one in times]
    print(provenance())
    rows = [
        (
            "as it is, nobody records",
            f"{with_reports:.4f}",
            f"{least[0]:.4f}",
            f"{more:+.2%}",
            f"{least[0] / least[1] - 1.0:+.2%}",
        ),
        (f"without its {taken} reports", f"{without:.4f}", f"{least[1]:.4f}", "", ""),
        ("the same again", f"{again:.4f}", f"{least[2]:.4f}", f"{noise:+.2%}", f"{least[2] / least[1] - 1.0:+.2%}"),
    ]
    print(markdown(("library", f"CPU s, median of {options.runs}", "least", "against without, median", "least"), rows))


if __name__ == "__main__":
    main()
