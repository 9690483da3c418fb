"""The benchmarks in benchmarks/: their pure parts on small sets give tables that make sense."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from segmap.benchmark import Pair
from segmap.integration import match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import LaserLog, LaserScan
from segmap.segments import Order, SegmentMap

ROOT = Path(__file__).resolve().parents[1]
QUICK = Parameters()


@pytest.fixture(scope="module")
def script():
    """The scripts by name, with their folder on the path as when they are run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module


def office() -> LaserLog:
    return read_log(ROOT / "sample_logs" / "office.log")


@pytest.fixture(scope="module")
def held(script):
    """A sample log with two pairs whose truth is the identity: a scan with itself."""
    pairs = tuple(Pair(kind=kind, i=i, j=i, x=0.0, y=0.0, theta=0.0) for kind, i in (("consecutive", 0), ("wide", 3)))
    return script("common").LogPairs("office", office(), (*pairs, Pair(kind="negative", i=0, j=30)))


def cells(table: str) -> list[list[str]]:
    """The cells of a Markdown table, without its rule."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in (lines[0], *lines[2:])]


def within(part: SegmentMap, whole: SegmentMap) -> bool:
    """Whether every segment of one map is one of another's."""
    return set(map(tuple, part.coordinates)) <= set(map(tuple, whole.coordinates))


def test_a_table_has_as_many_cells_in_every_line(script):
    """Header, rule and rows of a Markdown table agree."""
    text = script("common").markdown(["a", "b"], [[1, "x"], [2, "y"]])
    assert text.splitlines() == ["| a | b |", "| --- | ---: |", "| 1 | x |", "| 2 | y |"]


def test_numbers_say_where_they_come_from(script):
    """Date, cores and the version of every package that matters."""
    text = script("common").provenance()
    assert "cores" in text
    assert all(name in text for name in ("segmap", "numpy", "numba", "Python"))


def test_a_folder_without_pairs_is_told_of(script, tmp_path):
    """The message names the folder and the option."""
    with pytest.raises(SystemExit, match="--pairs"):
        script("common").load(tmp_path, tmp_path)


def test_trimmed_scans_have_the_size_asked_for_and_keep_their_order(script, held):
    """The longest segments stay, in beam order; more than there are is an error."""
    first, second = script("common").trimmed([held], (5, 4), QUICK)
    assert (len(first), len(second)) == (5, 4)
    assert first.order is Order.BEAMS
    whole = next(scan for pair in held.pairs[:2] for scan in held.maps(pair, QUICK) if within(first, scan))
    rows = [int(np.flatnonzero((whole.coordinates == row).all(axis=1))[0]) for row in first.coordinates]
    assert rows == sorted(rows)
    assert first.lengths.min() >= np.sort(whole.lengths)[-5]
    with pytest.raises(LookupError, match="1000"):
        script("common").trimmed([held], (1000, 4), QUICK)


# --- the paper's tables ---------------------------------------------------------------------------


def test_table_1_counts_what_extraction_gives(script):
    """A scan of one straight wall, one of nothing: half a segment on average, as long as the wall."""
    angles = np.linspace(-0.5, 0.5, 101)
    wall = LaserScan(2.0 / np.cos(angles), -0.5, 0.01)
    nothing = LaserScan(np.full(101, np.nan), -0.5, 0.01)
    (_, row) = cells(script("paper_tables").table_1({"wall": LaserLog("wall", (wall, nothing))}, ["default"]))
    assert row[:3] == ["wall", "2", "0.5"]
    assert float(row[3]) == pytest.approx(4000.0 * math.tan(0.5), abs=1.0)


def test_every_heuristic_is_tried_on_every_pair(script, held):
    """A scan is found in itself by `all`; each trial has one answer a pair; nothing else is counted."""
    tables = script("paper_tables")
    found = tables.rights([held], "wide", (*tables.HEURISTICS, *tables.VARIANTS), QUICK, threads=2)
    assert found["All transformations"] == {"office": [True]}
    assert all(len(by_log["office"]) == 1 for by_log in found.values())


def test_the_best_heuristic_is_right_where_any_is(script):
    """Pair by pair, not the better of two shares; variants do not count; the mean is over logs."""
    tables = script("paper_tables")
    found = {
        "All transformations": {"a": [True, False], "b": [False]},
        "Histogram": {"a": [False, True], "b": [False]},
        "Consecutive, refuse_angle 0": {"a": [False, False], "b": [True]},
    }
    rows = {row[0]: row[1:] for row in cells(tables.success_table(found, ["a", "b"]))[1:]}
    assert rows["All transformations"] == ["25.0", "50.0", "0.0"]
    assert rows["Using the best of these 2"] == ["50.0", "100.0", "0.0"]
    assert rows["Consecutive, refuse_angle 0"] == ["50.0", "0.0", "100.0"]
    assert list(rows)[-1] == "Consecutive, refuse_angle 0"


def test_the_heavy_preset_takes_a_subset_for_all_and_says_so(script, held, monkeypatch):
    """With the paper's parameters `all` runs on every n-th pair only, beside all pairs for the others."""
    tables = script("paper_tables")
    monkeypatch.setattr(tables, "preset", {tables.HEAVY: QUICK}.get)
    whole, subset, *others = tables.table_2([held], tables.HEAVY, every=5, threads=1)
    assert "every pair" in whole
    assert "All transformations" not in whole
    assert "every 5th pair" in subset
    assert "All transformations" in subset
    assert [title.split(",")[0] for title in (whole, subset, *others)] == ["**consecutive"] * 2 + ["**wide"] * 2


def test_table_3_takes_the_pair_nearest_in_size(script, held, monkeypatch):
    """One column group a place, with segments, time, tried and right; a place without its log is left out."""
    tables = script("paper_tables")
    sizes = tuple(map(len, held.maps(held.pairs[1], QUICK)))
    assert tuple(map(len, held.maps(tables.nearest(held, sizes, QUICK), QUICK))) == sizes
    monkeypatch.setattr(tables, "EXAMPLES", (("room", "office", sizes), ("moon", "apollo", (1, 1))))
    header, numbers, *rows = cells(tables.table_3([held], "default", repeats=1))
    assert header == ["Heuristic", "room: ms", "tried", "right"]
    assert numbers[1] == f"{sizes[0]}, {sizes[1]}"
    assert [row[0] for row in rows] == [trial.name for trial in tables.HEURISTICS]
    assert rows[0][3] == "yes"
    assert "draws" in rows[2][2]


# --- speed ----------------------------------------------------------------------------------------


def test_the_twin_gives_the_same_values_before_times_are_compared(script, held):
    """The table of evaluation has both readings, all candidates, and none discarded in the second."""
    speed = script("speed")
    maps = script("common").trimmed([held], (6, 5), QUICK)
    poses = speed.poses_between(maps, 50, QUICK)
    assert 0 < len(poses) <= 50
    _, shipped, whole = cells(speed.evaluation_table(maps, poses, QUICK, repeats=1))
    assert shipped[1] == whole[1] == str(len(poses))
    assert whole[2] == "0"


def test_twins_that_differ_are_not_compared(script, held, monkeypatch):
    """A ratio of times means nothing when the values differ."""
    speed = script("speed")
    maps = script("common").trimmed([held], (6, 5), QUICK)
    monkeypatch.setattr(speed.plain_reading(), "values", lambda *maps_poses_p: np.full(len(maps_poses_p[2]), -1.0))
    with pytest.raises(SystemExit, match="other values"):
        speed.evaluation_table(maps, speed.poses_between(maps, 50, QUICK), QUICK, repeats=1)


def test_a_search_that_finds_others_is_not_timed(script, held, monkeypatch):
    """Nor does a search that misses the best count as fast."""
    speed = script("speed")
    monkeypatch.setattr(speed, "best", lambda *_: np.zeros(1, int))
    with pytest.raises(SystemExit, match="other candidates"):
        speed.exact_table([script("common").trimmed([held], (6, 5), QUICK)], QUICK, repeats=1)


def test_the_exact_best_and_the_pairs_are_timed(script, held):
    """Sizes, candidates and every pair appear; a 95th percentile is no less than the median."""
    speed = script("speed")
    maps = script("common").trimmed([held], (6, 5), QUICK)
    header, row = cells(speed.exact_table([maps], QUICK, repeats=1))
    assert row[:2] == ["6 x 5", str(match_maps(*maps, QUICK, "all").candidates)]
    assert header[-2:] == ["every value / search", "numpy twin / search"]
    assert float(row[-2]) > 0.0
    _, office_row, all_row = cells(speed.pairs_table([held], repeats=1))
    assert office_row[:2] == ["office", "3"]
    assert all_row[:2] == ["all", "3"]
    assert float(all_row[2]) <= float(all_row[3])


# --- fusion ---------------------------------------------------------------------------------------


def test_distances_from_a_polyline_by_hand(script):
    """A source across a corner: far from either edge, its extremes on the polyline, its middle in between."""
    corner = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    across = np.array([[0.0, 0.0, 3.0, 4.0], [0.0, 0.0, 3.0, 0.0]])
    (one_edge, extremes, everywhere), on_it = script("fusion_errors").distances(across, corner)
    assert one_edge == pytest.approx(3.0)
    assert extremes == pytest.approx(0.0)
    assert everywhere == pytest.approx(12.0 / 7.0, abs=0.02)
    assert on_it == pytest.approx([0.0, 0.0, 0.0])


def test_a_scan_fused_with_itself_errs_by_nothing_more_than_its_tolerance(script, held):
    """Greedy and plain, extremes are within the tolerance; both count every chain once."""
    errors_of = script("fusion_errors")
    for variant in errors_of.VARIANTS:
        errors = errors_of.all_errors([held], QUICK.replace(fusion_variant=variant))
        assert errors.chains > 0
        assert errors.finished <= errors.chains
        assert errors.distances[:, 1].max() <= QUICK.fusion_tolerance + 1e-9


def test_pairs_without_chains_still_give_a_table(script):
    """Two empty maps: no source, no chain, no failure."""
    errors_of = script("fusion_errors")
    empty = errors_of.pair_errors(SegmentMap.empty(), SegmentMap.empty(), Pose2.identity(), QUICK)
    assert (empty.distances.shape, empty.chains) == ((0, 3), 0)
    assert errors_of.table([])


def test_real_pairs_fill_the_tables(script, benchmarks, datasets):
    """Two real pairs a kind: `all` finds most at the shipped defaults, and greedy errs as little as the paper says."""
    common = script("common")
    logs = [one for one in common.load(datasets, benchmarks / "pairs") if one.name in ("fr079", "fr101")]
    tables = script("paper_tables")
    found = tables.rights(logs, "consecutive", tables.HEURISTICS, QUICK, every=30)
    assert np.mean(list(found["All transformations"].values())) >= 0.75
    errors = script("fusion_errors").all_errors(logs, preset("paper-lab"), every=30)
    assert np.mean(errors.distances[:, 2] < 0.040) > 0.9


def test_a_copy_without_reports_tells_nothing_and_is_otherwise_the_same(script, tmp_path):
    """Every report is taken out, and nothing else."""
    taken = script("tracing_cost").without_reports(tmp_path)
    texts = {path.relative_to(tmp_path): path.read_text() for path in (tmp_path / "segmap").rglob("*.py")}
    assert taken > 15
    assert sum("tracing.tell(" in text for text in texts.values()) == 0
    untouched = [path for path in texts if "tracing.tell(" not in (ROOT / path).read_text()]
    assert all(texts[path] == (ROOT / path).read_text() for path in untouched)


def test_robustness_to_parameters_and_to_a_prior(script, held):
    """A scan with itself stays right over wide ranges; a prior that is sure and far off leaves nothing to accept."""
    robustness = script("robustness")
    first, *tables = robustness.robust([held], 2)
    assert "1 pairs" in first
    rows = {table.split()[1]: cells(table)[1:] for table in tables}
    assert list(rows) == list(robustness.SWEEPS)
    assert ["0.03", "100.0"] in rows["point_distance_tolerance"]
    told = cells(robustness.sensitive([held], 1))[1:]
    assert told[0][:3] == ["no prior", "100.0", told[0][2]]
    assert told[-1][-3:] == ["0.0", "0.0", "0.0"]
