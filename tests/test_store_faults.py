"""Files that are not what they should be, and disks that do not do what they should: one clear sentence."""

from __future__ import annotations

import gzip
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from segmap import _database
from segmap.errors import ProjectError
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.project import Choice, Clear, Decide, Proposal, Propose, Redo, Rename, SetHeuristic, SetParameters, Undo
from segmap.store import CHUNK, Store

VERSION_1 = Path(__file__).parent / "projects" / "version-1.segmap"


@pytest.fixture
def path(tmp_path: Path, made: Path) -> Path:
    """A closed project with a log, decisions and results."""
    return Path(shutil.copy(made, tmp_path))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The one that is copied."""
    path = tmp_path_factory.mktemp("made") / "hall.segmap"
    with Store.create(path, "Hall") as store:
        store.add_log("hall.log", random.Random(0).randbytes(30_000), scans=100)
        for i in range(99):
            store.append(decide(store, f"0.{i}-0.{i + 1}"))
            store.put_result(str(i), "result" * 20)
    return path


def decide(store: Store, integration: str, verdict: str = "accepted") -> Decide:
    made = {"T_1_2": Pose2(0.1, 0.2, 0.3), "parameters": store.state.fingerprint}
    return Decide(choices=(Choice(integration=integration, verdict=verdict, **made),), who="Anna")


def refused(path: Path, act: Callable[[], object], words: str) -> None:
    """It is a ProjectError of one line that names the file."""
    with pytest.raises(ProjectError) as caught:
        act()
    message = str(caught.value)
    assert words in message
    assert path.name in message
    assert "\n" not in message


def raw(path: Path, *statements: str) -> None:
    """Change a project behind the store's back."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for statement in statements:
            connection.execute(statement).fetchall()


# files that are not projects


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty: its making was interrupted"),
        (b"FLASER 1 2.0\n", "is not a segmap project"),
        (b"SQLite format 3", "is not a segmap project"),
        (b"SQLite format 3\0" + bytes(500), "is damaged or cut off"),
        (gzip.compress(b"SQLite format 3\0"), "is not a segmap project"),
        (bytes(100_000), "is not a segmap project"),
    ],
)
def test_a_file_that_is_no_project_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    """It says what is wrong and leaves the file as it is."""
    path = tmp_path / "x.segmap"
    path.write_bytes(content)
    refused(path, lambda: Store.open(path), words)
    assert path.read_bytes() == content


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """A name without a file, and a folder."""
    refused(tmp_path, lambda: Store.open(tmp_path), "There is no project")
    refused(tmp_path / "x", lambda: Store.open(tmp_path / "x"), "There is no project")
    refused(tmp_path / "x", lambda: Store.open(tmp_path / "x" / "y"), "There is no project")
    assert list(tmp_path.iterdir()) == []


def test_somebody_elses_database_is_refused(tmp_path: Path) -> None:
    """An SQLite file of another program is not touched, even one that claims to be ours."""
    path = tmp_path / "bookmarks.db"
    raw(path, "CREATE TABLE events (seq INTEGER PRIMARY KEY, body TEXT)")
    content = path.read_bytes()
    refused(path, lambda: Store.open(path), "is an SQLite file but not a segmap project")
    assert path.read_bytes() == content
    raw(path, f"PRAGMA application_id = {_database.APPLICATION_ID}", "PRAGMA user_version = 1")
    refused(path, lambda: Store.open(path), "its tables differ")


def test_a_project_with_foreign_triggers_is_refused(path: Path) -> None:
    """A file from a stranger runs no code of theirs."""
    raw(path, "CREATE TRIGGER evil AFTER INSERT ON results BEGIN DELETE FROM results; END")
    refused(path, lambda: Store.open(path), "its tables differ")


def test_a_newer_project_is_refused_with_what_to_do(path: Path) -> None:
    """It says which version it has, which this program reads, and to update."""
    raw(path, "PRAGMA user_version = 99")
    refused(path, lambda: Store.open(path), "written by a newer segmap (version 99 of the project file; this one reads")
    refused(path, lambda: Store.open(path), "update segmap")


# damage


def test_a_project_cut_off_anywhere_is_refused(path: Path, tmp_path: Path) -> None:
    """Whatever length is left of it."""
    content = path.read_bytes()
    cut = tmp_path / "cut.segmap"
    for length in [1, 15, 16, 99, 100, 1000, *range(4096, len(content), 4096), len(content) - 1]:
        cut.write_bytes(content[:length])
        refused(cut, lambda: Store.open(cut), "")


def test_damage_is_found_or_harmless(path: Path, tmp_path: Path) -> None:
    """With bytes overwritten at random, a project is refused in a sentence, or holds what it held."""
    with Store.open(path) as store:
        held = store.events(), store.log_bytes(0)
    content, numbers, found = path.read_bytes(), random.Random(1), 0
    damaged = tmp_path / "damaged.segmap"
    for _ in range(100):
        place, length = numbers.randrange(len(content) - 8), numbers.choice([1, 8, 300])
        damaged.write_bytes(content[:place] + numbers.randbytes(length) + content[place + length :])
        now = survives(damaged)
        assert now in (None, held)
        found += now is None
        for beside in damaged.parent.glob("damaged.segmap-*"):
            beside.unlink()
    assert found > 30


def use(path: Path) -> tuple[object, bytes]:
    with Store.open(path) as store:
        held = store.events(), store.log_bytes(0)
        store.append(Rename(name="again"))
        store.put_result("a", "b")
        return held


def survives(path: Path) -> tuple[object, bytes] | None:
    """What a project holds; None where it says in one line that it is damaged."""
    try:
        return use(path)
    except ProjectError:
        refused(path, lambda: use(path), "")
        return None


def test_tables_without_names_that_are_text_are_refused(path: Path) -> None:
    """SQLite itself then complains with bytes that are no text."""
    content = path.read_bytes()
    path.write_bytes(content.replace(b"CREATE TABLE results", b"CREATE TABLE \xff\xb6sults"))
    refused(path, lambda: Store.open(path), "is damaged or cut off")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("UPDATE events SET body = replace(body, 'Anna', 'Hans') WHERE seq = 7", "event 7 is not what was written"),
        ("DELETE FROM events WHERE seq = 7", "the history has a gap"),
    ],
)
def test_a_history_changed_by_hand_is_refused(path: Path, change: str, words: str) -> None:
    """Who wants to change what was decided decides again."""
    statements = [_definition(path, name) for name in ("no_UPDATE_of_events", "no_DELETE_of_events")]
    raw(path, "DROP TRIGGER no_UPDATE_of_events", "DROP TRIGGER no_DELETE_of_events", change, *statements)
    refused(path, lambda: Store.open(path), words)


def _definition(path: Path, name: str) -> str:
    with closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("SELECT sql FROM sqlite_master WHERE name = ?", (name,)).fetchone()[0])


# other programs


@contextmanager
def another_program_writing(path: Path) -> Iterator[None]:
    """A second process that is in the middle of a transaction."""
    program = (
        "import sqlite3, sys; c = sqlite3.connect(sys.argv[1], isolation_level=None);"
        " c.execute('BEGIN IMMEDIATE'); print('begun', flush=True); input(); c.execute('ROLLBACK')"
    )
    command = [sys.executable, "-c", program, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        yield
        process.communicate("\n")


def test_a_file_another_program_writes_is_waited_for_and_then_said(path: Path) -> None:
    """It can be read meanwhile; writing says who is in the way, keeps nothing, and works afterwards."""
    with Store.open(path, patience=0.05) as store:
        before = store.events()
        with another_program_writing(path):
            with Store.open(path) as reader:
                assert reader.events() == store.events() == before
            refused(path, lambda: store.append(Rename(name="x")), "is being written by another program")
            refused(path, lambda: store.add_log("x", b"x", scans=1), "is being written by another program")
        assert store.events() == before
        assert store.append(Rename(name="x")).seq == len(before) + 1


# disks


def test_a_full_disk_keeps_what_there_was(path: Path) -> None:
    """Nothing of what did not fit is kept; with room again, work goes on."""
    with Store.open(path) as store:
        before = store.events()
        pages = store._connection.execute("PRAGMA page_count").fetchone()[0]
        store._connection.execute(f"PRAGMA max_page_count = {pages + 3}")
        refused(path, lambda: store.add_log("big.log", bytes(3 * CHUNK), scans=1), "the disk is full")
        refused(path, lambda: store.append(Rename(name="x", reason="y" * 9_999, who="z" * 255)) and fill(store), "full")
        assert store.events()[: len(before)] == before
        store._connection.execute("PRAGMA max_page_count = 1000000")
        store.add_log("big.log", bytes(3 * CHUNK), scans=1)
    with Store.open(path) as store:
        assert store.log_bytes(1) == bytes(3 * CHUNK)


def fill(store: Store) -> None:
    while True:
        store.append(Rename(name="x", reason="y" * 9_999))


def test_a_read_only_connection_says_so(path: Path) -> None:
    """Where the system lets nothing be written, it says where to copy the project to."""
    with Store.open(path) as store:
        store._connection.execute("PRAGMA query_only = ON")
        refused(path, lambda: store.append(Rename(name="x")), "read-only. Copy it to a folder you may write to")


@pytest.fixture
def locked_folder() -> Iterator[Path]:
    """A folder everybody can reach and, while the test runs without privileges, nobody may write to."""
    if not hasattr(os, "seteuid"):
        pytest.skip("this system has no users to be")
    folder = Path(tempfile.mkdtemp())
    yield folder
    folder.chmod(0o700)
    shutil.rmtree(folder)


@contextmanager
def unprivileged(folder: Path, mode: int) -> Iterator[None]:
    """As nobody (where the tests run as root), with a folder of this mode."""
    user = os.geteuid()
    folder.chmod(mode)
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)


@pytest.mark.parametrize("mode", [0o444, 0o666])
def test_a_read_only_folder_says_so(path: Path, locked_folder: Path, mode: int) -> None:
    """Neither opened nor created there, and the project stays as it is."""
    there = locked_folder / "hall.segmap"
    shutil.copy(path, there)
    there.chmod(mode)
    content = there.read_bytes()
    with unprivileged(locked_folder, 0o555):
        refused(there, lambda: Store.open(there), "its folder")
        refused(locked_folder / "n.segmap", lambda: Store.create(locked_folder / "n.segmap", "n"), "cannot be created")
    assert there.read_bytes() == content


def test_a_file_one_may_not_read_says_so(path: Path, locked_folder: Path) -> None:
    """Permission denied is a sentence like the others."""
    there = locked_folder / "hall.segmap"
    shutil.copy(path, there)
    there.chmod(0o000)
    with unprivileged(locked_folder, 0o555):
        refused(there, lambda: Store.open(there), "Permission denied")


def test_nothing_is_ever_overwritten(path: Path, tmp_path: Path) -> None:
    """Neither a new project nor a backup takes the place of a file, and a missing folder is said."""
    content = path.read_bytes()
    refused(path, lambda: Store.create(path, "again"), "exists already")
    with Store.open(path) as store:
        refused(path, lambda: store.backup(path), "exists already")
        nowhere = tmp_path / "no" / "b.segmap"
        refused(nowhere, lambda: store.backup(nowhere), "cannot be created: No such file or directory")
    assert path.read_bytes() == content


def test_a_project_that_cannot_be_made_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure in the middle takes the half-made file away."""

    def fail(connection: sqlite3.Connection) -> None:
        raise sqlite3.OperationalError("no")

    monkeypatch.setattr(_database, "MIGRATIONS", (fail,))
    with pytest.raises(ProjectError):
        Store.create(tmp_path / "x.segmap", "x")
    assert list(tmp_path.iterdir()) == []


# versions


def test_a_project_of_version_1_is_read_by_every_later_version(tmp_path: Path) -> None:
    """A file written once and kept in the repository, with every kind of event in it."""
    path = tmp_path / "v1.segmap"
    shutil.copy(VERSION_1, path)
    with Store.open(path) as store:
        state = store.state
        assert (state.name, state.heuristic, state.mode, state.revision) == ("Office", "random", "paper", 12)
        assert [decision.verdict for decision in state.decisions.values()] == ["accepted", "rejected"]
        decision = state.decisions["0.0-0.1"]
        assert (decision.T_1_2, decision.reason) == (Pose2(0.25, -0.5, 0.125), "clear to see")
        assert state.parameters.value_threshold == 3.5
        assert (state.can_undo, state.can_redo) == ("renamed the project to Office", "cleared 0.1-0.2")
        assert store.log_bytes(0) == b"FLASER 0\n" * 4
        assert state.proposals == {}
        assert state.decisions["0.0-0.1"].covariance is None
        assert store.append(decide(store, "0.2-0.3")).seq == 13


def test_what_version_2_brought_older_programs_refuse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs can be proposed in a project of version 1 too; from then on a program of version 1 says to update."""
    path = tmp_path / "v1.segmap"
    shutil.copy(VERSION_1, path)
    proposal = Proposal(integration="0.0-0.3", kind="imported", T_1_2=Pose2(1.0, 2.0, 0.5), source="graph.g2o")
    with Store.open(path) as store:
        store.append(Propose(proposals=(proposal,), who="Anna"))
    with Store.open(path) as store:
        assert store.state.proposals == {"0.0-0.3": proposal}
        assert store.state.can_undo == "proposed 0.0-0.3"
    monkeypatch.setattr(_database, "MIGRATIONS", _database.MIGRATIONS[:1])
    refused(path, lambda: Store.open(path), "written by a newer segmap (version 3 of the project file")


def write_version_1(path: Path) -> None:
    """How that file was made (by the version it is of; a later one would write its own)."""
    with Store.create(path, "Hall") as store:
        store.add_log("hall.log", b"FLASER 0\n" * 4, scans=4, format="CARMEN")
        placed = {"T_1_2": Pose2(0.25, -0.5, 0.125), "value": 7.5, "heuristic": "all", "mode": "paper", "candidate": 0}
        named = {"parameters": store.state.fingerprint}
        accepted = Choice(integration="0.0-0.1", verdict="accepted", **placed, **named)
        rejected = Choice(integration="0.1-0.2", verdict="rejected", **named)
        store.append(Decide(choices=(accepted, rejected), who="Anna", reason="clear to see"))
        store.append(SetParameters(parameters=Parameters(value_threshold=3.5), who="Anna"))
        store.append(SetHeuristic(heuristic="random"))
        store.append(Rename(name="Office"), expected_revision=5)
        store.append(Clear(integrations=("0.1-0.2",), who="Ben"))
        for event in (Undo(), Redo(), Undo(), Redo(), Undo()):
            store.append(event)
        store.put_result("a", "b")


def test_an_older_project_is_brought_to_the_present(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Migrations run once, in order, keep the history, and the result is what a new project looks like."""
    with Store.open(path) as store:
        held = store.events(), store.state

    def first(connection: sqlite3.Connection) -> None:
        connection.execute("CREATE TABLE more (a)")

    def second(connection: sqlite3.Connection) -> None:
        connection.execute("ALTER TABLE more RENAME TO still_more")

    monkeypatch.setattr(_database, "MIGRATIONS", (*_database.MIGRATIONS, first, second))
    for _ in range(2):
        with Store.open(path) as store:
            assert (store.events(), store.state) == held
    monkeypatch.undo()
    refused(path, lambda: Store.open(path), f"version {len(_database.MIGRATIONS) + 2} of the project file")


def test_a_migration_that_fails_changes_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The project stays what it was, and the older segmap still opens it."""

    def fail(connection: sqlite3.Connection) -> None:
        connection.execute("CREATE TABLE more (a)")
        raise sqlite3.OperationalError("no")

    monkeypatch.setattr(_database, "MIGRATIONS", (*_database.MIGRATIONS, fail))
    refused(path, lambda: Store.open(path), "cannot be used as a project: no")
    monkeypatch.undo()
    assert survives(path) is not None
