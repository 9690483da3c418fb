"""``segmap evaluate``."""

from __future__ import annotations

import json

import pytest

from app.cli import main

TUM = "1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n"
RELATIONS = "1.0 2.0 1.3 0.4 0 0 0 0\n"
KEYS = {
    "relations",
    "matched",
    "translation_mean_m",
    "translation_std_m",
    "rotation_mean_deg",
    "rotation_std_deg",
}


@pytest.fixture
def run(capsys, tmp_path):
    """Run the command on a trajectory and relations with these texts: exit status, standard output, standard error."""

    def run(trajectory: str, relations: str, *options: str) -> tuple[int, str, str]:
        (tmp_path / "run.tum").write_text(trajectory)
        (tmp_path / "run.relations").write_text(relations)
        with pytest.raises(SystemExit) as stopped:
            main(["evaluate", str(tmp_path / "run.tum"), str(tmp_path / "run.relations"), *options])
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    return run


def test_json_for_scripts(run):
    """One document with the promised keys and the right numbers."""
    status, out, err = run(TUM, RELATIONS, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert set(found) == KEYS
    assert (found["relations"], found["matched"]) == (1, 1)
    assert found["translation_mean_m"] == pytest.approx(0.5)


def test_a_table_for_people(run):
    """Matched relations, translation and rotation."""
    status, out, _ = run(TUM, RELATIONS)
    assert status == 0
    assert "1 of 1" in out
    assert "0.5000 +- 0.0000 m" in out


def test_bad_lines_are_told(run):
    """A bad line is told on standard error with its number, and costs only itself."""
    status, out, err = run(TUM, f"oops\n{RELATIONS}", "--json")
    assert status == 0
    assert json.loads(out)["relations"] == 1
    assert "run.relations: line 1: there are 1 numbers instead of 8" in err


@pytest.mark.parametrize(("trajectory", "relations"), [("hello\n", RELATIONS), (TUM, ""), (TUM, "8 9 0 0 0 0 0 0\n")])
def test_bad_input_is_one_sentence(run, trajectory, relations):
    """Files of another kind, and times that do not match: status 2 and one line, no traceback."""
    status, out, err = run(trajectory, relations)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("segmap: ")


def test_the_mount_of_the_laser(run):
    """A laser half a metre behind the robot, and a robot that turns about."""
    turned = "1.0 -0.5 0 0 0 0 0 1\n2.0 0.5 0 0 0 0 1 0\n"
    about = "1.0 2.0 0 0 0 0 0 3.14159265\n"
    assert json.loads(run(turned, about, "--mount", "-0.5", "0", "0", "--json")[1])["translation_mean_m"] < 1e-6
    assert json.loads(run(turned, about, "--json")[1])["translation_mean_m"] == pytest.approx(1.0)
