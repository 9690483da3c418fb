"""The project file keeps logs, history and results, for several threads and programs."""

from __future__ import annotations

import hashlib
import io
import sqlite3
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from segmap import store as store_module
from segmap.errors import ConflictError, ProjectError
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.project import Choice, Clear, Create, Decide, Redo, Rename, SetHeuristic, SetParameters, Undo, accepted
from segmap.store import CHUNK, Store

SCANS = 200
IDS = [f"0.{i}-0.{i + 1}" for i in range(SCANS - 1)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "hall.segmap"


@pytest.fixture
def store(path: Path) -> Iterator[Store]:
    """A project with one log of 200 scans."""
    with Store.create(path, "Hall") as created:
        created.add_log("hall.log", b"one scan\n" * SCANS, scans=SCANS, format="CARMEN")
        yield created


def decide(store: Store, *integrations: str, verdict: str = "accepted", who: str = "") -> Decide:
    made = {"verdict": verdict, "T_1_2": Pose2(0.1, 0.2, 0.3), "value": 7.5, "parameters": store.state.fingerprint}
    return Decide(choices=tuple(Choice(integration=name, **made) for name in integrations), who=who)


def history(path: Path) -> tuple[object, ...]:
    """All that must survive: events, state, and the bytes of the logs."""
    with Store.open(path) as opened:
        logs = tuple(opened.log_bytes(log.index) for log in opened.state.logs)
        return opened.events(), opened.state, logs


# history


def test_a_project_closed_and_opened_again_is_the_same(path: Path) -> None:
    """Name, parameters, heuristic, logs, decisions and what can be undone and redone survive a restart."""
    with Store.create(path, "Hall", Parameters(seed=3), "random", "paper", who="Anna") as store:
        store.add_log("hall.log", b"content", scans=SCANS)
        store.append(decide(store, IDS[0], IDS[1]))
        store.append(SetParameters(parameters=Parameters(seed=4)))
        store.append(Rename(name="Office"))
        store.append(Undo())
        held = store.events(), store.state, (b"content",)
    assert history(path) == held
    with Store.open(path) as store:
        assert (store.state.can_undo, store.state.can_redo) == ("changed seed to 4", "renamed the project to Office")
        assert store.append(Undo()).undoes == 4
        assert store.state.parameters.seed == 3
        assert store.append(Redo()).redoes == 4
    assert len(accepted(history(path)[1])) == 2


def test_a_recorded_event_says_number_time_version_and_revision(store: Store) -> None:
    """What append returns is what is in the file, with all that was filled in."""
    event = store.append(decide(store, IDS[0], who="Anna"))
    assert (event.seq, event.revision, event.version) == (3, 2, "0.1.0")
    assert event.at.endswith("Z")
    assert store.events(after=2) == (event,)
    assert store.state.revision == 3


def test_a_clock_that_goes_backwards_changes_nothing(store: Store, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The order of events is their number, never their time."""
    monkeypatch.setattr(store_module, "_now", iter(["2031-01-01T00:00:00Z", "1999-01-01T00:00:00Z"]).__next__)
    store.append(decide(store, IDS[0]))
    store.append(decide(store, IDS[0], verdict="rejected"))
    store.close()
    assert history(path)[1].decisions[IDS[0]].verdict == "rejected"


def test_a_refused_event_leaves_nothing_behind(store: Store) -> None:
    """Conflicts and impossible events are not recorded."""
    store.append(decide(store, IDS[0], who="Anna"))
    before = store.events(), store.state
    with pytest.raises(ConflictError, match=f"Anna accepted {IDS[0]}"):
        store.append(decide(store, IDS[0], verdict="rejected"), expected_revision=2)
    with pytest.raises(ProjectError, match="There is nothing to redo"):
        store.append(Redo())
    with pytest.raises(ProjectError, match="no scan 9"):
        store.append(Clear(integrations=("9.0-9.1",)))
    with pytest.raises(ProjectError, match=r"Store\.create"):
        store.append(Create(name="again", parameters=Parameters()))
    assert (store.events(), store.state) == before


def test_the_history_cannot_be_changed_even_by_hand(store: Store, path: Path) -> None:
    """The file itself refuses to change, remove, replace or skip an event or a piece of a log."""
    store.append(decide(store, IDS[0]))
    with closing(sqlite3.connect(path)) as other:
        for statement in (
            "UPDATE events SET body = '{}'",
            "DELETE FROM events WHERE seq = 3",
            "INSERT OR REPLACE INTO events VALUES (3, '{}', 0)",
            "INSERT INTO events VALUES (9, '{}', 0)",
            "UPDATE chunks SET data = x''",
            "DELETE FROM chunks",
        ):
            with pytest.raises(sqlite3.IntegrityError):
                other.execute(statement)


def test_threads_share_a_store(store: Store) -> None:
    """Four threads that append at once: each event is recorded once, numbered without a gap."""
    recorded: list[object] = []

    def work(first: int) -> None:
        for name in IDS[first::4]:
            recorded.append(store.append(decide(store, name)))
            store.put_result(name, name)

    run_together([lambda first=first: work(first) for first in range(4)])
    assert sorted(event.seq for event in recorded) == list(range(3, 3 + len(IDS)))
    assert {event.seq: event for event in store.events(after=2)} == {event.seq: event for event in recorded}
    assert set(store.state.decisions) == set(IDS)


def run_together(works: list[Callable[[], None]]) -> None:
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def test_two_programs_write_into_one_file(store: Store, path: Path) -> None:
    """Each writes on top of what the other wrote; refresh shows it."""
    with Store.open(path) as other:
        other.append(decide(other, IDS[0]))
        event = store.append(decide(store, IDS[1]))
        assert event.seq == 4
        assert set(store.state.decisions) == {IDS[0], IDS[1]}
        assert set(other.state.decisions) == {IDS[0]}
        assert other.refresh() == store.state


def test_two_programs_conflict_as_two_people_do(store: Store, path: Path) -> None:
    """The second decision on one integration is refused, though its program had not seen the first."""
    with Store.open(path) as other:
        other.append(decide(other, IDS[0], who="Anna"))
        with pytest.raises(ConflictError, match=f"Anna accepted {IDS[0]}"):
            store.append(decide(store, IDS[0], verdict="rejected"), expected_revision=store.state.revision)
    assert store.refresh().decisions[IDS[0]].who == "Anna"


def test_threads_of_two_programs_lose_nothing(store: Store, path: Path) -> None:
    """Two stores on one file, written at once: all events are there, in one order that both see."""
    with Store.open(path, patience=60.0) as other:
        run_together(
            [
                lambda: [store.append(decide(store, name)) for name in IDS[:60]],
                lambda: [other.append(decide(other, name)) for name in IDS[60:120]],
            ]
        )
        assert store.refresh() == other.refresh()
        assert set(store.state.decisions) == set(IDS[:120])


# logs


def piece(size: int) -> bytes:
    """Bytes that do not repeat every chunk."""
    return b"".join(i.to_bytes(4, "little") for i in range(size // 4 + 1))[:size]


@pytest.mark.parametrize("size", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 5 * CHUNK + 17])
def test_a_log_comes_out_as_it_went_in(store: Store, path: Path, size: int) -> None:
    """Byte for byte, whatever its size, from bytes or from a file, and across a restart."""
    content = piece(size)
    info = store.add_log("a.log", content, scans=1, format="CARMEN")
    assert (info.index, info.size, info.name) == (1, size, "a.log")
    assert info.sha256 == hashlib.sha256(content).hexdigest()
    assert store.add_log("b.log", io.BytesIO(content), scans=1).sha256 == info.sha256
    store.close()
    assert history(path)[2][1:] == (content, content)


def test_a_log_lies_in_chunks(store: Store, path: Path) -> None:
    """No row of the file holds more than one chunk."""
    store.add_log("a.log", piece(3 * CHUNK + 5), scans=1)
    assert [len(chunk) for chunk in store.log_chunks(1)] == [CHUNK, CHUNK, CHUNK, 5]


def test_a_log_can_be_read_as_a_file(store: Store) -> None:
    """Readers may seek in it; it is their own copy."""
    content = piece(2 * CHUNK)
    store.add_log("a.log", content, scans=1)
    with store.open_log(1) as file:
        assert file.read() == content
        file.seek(CHUNK)
        assert file.read(3) == content[CHUNK : CHUNK + 3]


class Long(io.RawIOBase):
    """A file of many megabytes that nobody holds in memory."""

    left = 48

    def read(self, size: int = -1) -> bytes:
        self.left -= 1
        return bytes(size) if self.left >= 0 else b""


def test_a_long_log_does_not_need_its_size_in_memory(store: Store) -> None:
    """A log goes in and out chunk by chunk."""
    tracemalloc.start()
    try:
        info = store.add_log("long.log", Long(), scans=1)
        assert sum(map(len, store.log_chunks(1))) == info.size == 48 * CHUNK
        assert tracemalloc.get_traced_memory()[1] < 8 * CHUNK
    finally:
        tracemalloc.stop()


class Broken(io.BytesIO):
    """An upload whose sender goes away."""

    def read(self, size: int | None = -1) -> bytes:
        if self.tell() >= 2 * CHUNK:
            raise ConnectionResetError(104, "Connection reset by peer")
        return super().read(size)


def test_a_log_that_breaks_off_is_not_kept(store: Store) -> None:
    """Either all of a log is in the project or nothing; what was there before is unharmed."""
    before = store.events()
    with pytest.raises(ProjectError, match=r"half\.log cannot be read to its end: Connection reset by peer"):
        store.add_log("half.log", Broken(piece(4 * CHUNK)), scans=1)
    assert store.events() == before
    assert store.add_log("whole.log", b"x", scans=1).index == 1
    assert store.log_bytes(1) == b"x"


def test_a_damaged_log_is_found(store: Store, path: Path) -> None:
    """A log is checked against its SHA-256 whenever it is read."""
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("DROP TRIGGER no_UPDATE_of_chunks")
        other.execute("UPDATE chunks SET data = 'another scan'")
    with pytest.raises(ProjectError, match=r"hall\.log inside .* is damaged"):
        store.log_bytes(0)
    with pytest.raises(ProjectError, match="is damaged"):
        store.open_log(0)


def test_a_log_that_is_not_there_is_said(store: Store) -> None:
    """An index from elsewhere gets a sentence."""
    with pytest.raises(ProjectError, match="no log 5: it holds 1"):
        store.log_bytes(5)


# results


def test_results_are_kept_until_they_are_dropped(store: Store, path: Path) -> None:
    """Results survive a restart, the newest of one key wins, and they can be forgotten."""
    store.put_result("a", "old")
    store.put_results({"a": "new", "b": "é" * 1000})
    store.close()
    with Store.open(path) as again:
        assert again.get_result("a") == "new"
        assert again.results(["b", "c", "a"]) == {"a": "new", "b": "é" * 1000}
        again.drop_results()
        assert again.get_result("a") is None


def test_many_results_are_read_at_once(store: Store) -> None:
    """More keys than one query takes."""
    texts = {f"key {i}": str(i) for i in range(2500)}
    store.put_results(texts)
    assert store.results(texts) == texts
    assert store.results(()) == {}


def test_results_are_listed_by_how_their_keys_begin(store: Store) -> None:
    """Nothing that stands for anything, such as a percent sign, is taken for more than itself."""
    store.put_results({"match/a%/2": "", "match/a%/1": "", "match/ab/1": "", "other": ""})
    assert store.result_keys("match/a%/") == ["match/a%/2", "match/a%/1"]
    assert len(store.result_keys("")) == 4


def test_results_stay_within_their_room(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the limit the oldest results go, and never the history."""
    monkeypatch.setattr(store_module, "RESULTS_LIMIT", 2000)
    for i in range(100):
        store.put_result(str(i), hashlib.sha512(str(i).encode()).hexdigest())
    kept = sorted(map(int, store.results(map(str, range(100)))))
    assert kept == list(range(100 - len(kept), 100))
    assert 10 <= len(kept) <= 30
    assert len(store.events()) == 2


def test_a_result_of_another_version_is_no_result(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache filled by an older segmap is not believed."""
    store.put_result("a", "computed by 0.1.0")
    monkeypatch.setattr(store_module, "_version", lambda: "9.9")
    assert store.get_result("a") is None


@pytest.mark.parametrize("value", [b"nonsense", None, 7, "text", b"x\x9c"])
def test_a_strangers_result_that_is_none_is_passed_over(store: Store, path: Path, value: object) -> None:
    """Whatever lies in the cache of a file that came from elsewhere: it is computed again."""
    store.put_result("a", "good")
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("UPDATE results SET value = coalesce(?, zeroblob(9))", (value,))
    assert store.get_result("a") is None


# the file


def test_a_backup_is_the_project_in_one_file(store: Store, tmp_path: Path) -> None:
    """History, logs and results are in it, nothing lies beside it, and it goes its own way."""
    store.append(decide(store, IDS[0]))
    store.put_result("a", "b")
    copy = tmp_path / "copy" / "c.segmap"
    copy.parent.mkdir()
    store.backup(copy)
    assert [file.name for file in copy.parent.iterdir()] == ["c.segmap"]
    assert history(copy) == (store.events(), store.state, (store.log_bytes(0),))
    with Store.open(copy) as other:
        assert other.get_result("a") == "b"
        other.append(SetHeuristic(heuristic="random"))
    assert store.refresh().heuristic == "all"


def test_a_backup_while_others_write_is_a_moment_of_the_project(store: Store, tmp_path: Path) -> None:
    """Work goes on during a backup, which holds the history up to some event."""
    run_together(
        [
            lambda: [store.append(decide(store, name)) for name in IDS[:100]],
            lambda: [store.backup(tmp_path / f"{i}.segmap") for i in range(10)],
        ]
    )
    events = store.events()
    for i in range(10):
        copied = history(tmp_path / f"{i}.segmap")[0]
        assert copied == events[: len(copied)]


def test_a_closed_project_is_one_file(store: Store, path: Path) -> None:
    """Nothing lies beside it that a copy could forget."""
    store.append(decide(store, IDS[0]))
    store.close()
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_closed_store_says_so(store: Store, tmp_path: Path) -> None:
    """Whatever is asked of it; closing it again is harmless."""
    store.close()
    store.close()
    asked: list[Callable[[], object]] = [
        lambda: store.append(Undo()),
        store.refresh,
        store.events,
        lambda: store.log_bytes(0),
        lambda: store.add_log("x", b"x", scans=1),
        lambda: store.get_result("a"),
        lambda: store.put_result("a", "b"),
        lambda: store.backup(tmp_path / "c.segmap"),
    ]
    for ask in asked:
        with pytest.raises(ProjectError, match="is closed: open it again"):
            ask()
