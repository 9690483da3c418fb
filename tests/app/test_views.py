"""Open views: how many, how long, and that they are closed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from clocks import Clock

from app.errors import BusyError, UnknownError
from app.views import Views


class Thing:
    """A view, or a scene, that remembers whether it was closed."""

    def __init__(self) -> None:
        self.closed = False

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def views(clock: Clock) -> Iterator[Views]:
    views = Views(lambda _: (Thing(), Thing()), limit=3, idle_seconds=60.0, clock=clock)  # type: ignore[arg-type, return-value]
    yield views
    views.close_all()
    assert len(views) == 0


def session() -> Any:
    return object()


def test_ids_cannot_be_guessed(views: Views) -> None:
    """Long, different, and fit for an address."""
    first, second = views.open(session()), views.open(session())
    assert first.id != second.id
    assert len(first.id) >= 16
    assert first.id.replace("-", "").replace("_", "").isalnum()


def test_idle_views_are_closed(views: Views, clock: Clock) -> None:
    """One that no page listens to goes after a while, with its scene; one that is used stays."""
    idle, used, watched = (views.open(session()) for _ in range(3))
    with views.watched(watched.id):
        clock.now = 59.0
        views.get(used.id)
        clock.now = 61.0
        views.reap()
        assert (idle.scene.closed, used.scene.closed, watched.scene.closed) == (True, False, False)  # type: ignore[attr-defined]
        assert idle.view.closed  # type: ignore[attr-defined]
        with pytest.raises(UnknownError):
            views.get(idle.id)
    clock.now = 120.0
    views.reap()
    assert len(views) == 1  # the page left just before
    clock.now = 122.0
    views.reap()
    assert len(views) == 0


def test_the_number_is_capped(views: Views, clock: Clock) -> None:
    """A new view takes the place of the one left longest; where pages look at all, it is refused."""
    opened = []
    for now in range(3):
        clock.now = float(now)
        opened.append(views.open(session()))
    views.open(session())
    assert [view.scene.closed for view in opened] == [True, False, False]  # type: ignore[attr-defined]
    ids = list(views._views)
    with (
        views.watched(ids[0]),
        views.watched(ids[1]),
        views.watched(ids[2]),
        pytest.raises(BusyError, match="close a page"),
    ):
        views.open(session())
    assert views.open(session())


def test_a_scene_that_fails_takes_no_place(clock: Clock) -> None:
    """After failures there is as much room as before."""

    def fail(session: Any) -> Any:
        raise OSError("no port")

    views = Views(fail, limit=1, clock=clock)
    for _ in range(3):
        with pytest.raises(OSError, match="no port"):
            views.open(session())


def test_closing_twice_is_harmless(views: Views) -> None:
    """Pages say goodbye more than once."""
    opened = views.open(session())
    views.close(opened.id)
    views.close(opened.id)
    assert opened.scene.closed  # type: ignore[attr-defined]


def test_views_of_a_session_close_with_it(views: Views) -> None:
    """Those of other sessions stay."""
    mine = session()
    first, second = views.open(mine), views.open(session())
    views.close_of(mine)
    assert (first.scene.closed, second.scene.closed) == (True, False)  # type: ignore[attr-defined]


# --- sharing --------------------------------------------------------------------------------------


def test_a_view_is_followed_by_a_name_of_its_own(views: Views) -> None:
    """The name is made once, leads to the view, is not its id, and ends with it; nobody follows what is not shared."""
    opened = views.open(None)  # type: ignore[arg-type]
    with pytest.raises(UnknownError):
        views.followed("")
    token = views.share(opened.id).follow
    assert views.share(opened.id).follow == token
    assert token != opened.id
    assert views.followed(token) is opened
    with pytest.raises(UnknownError):
        views.get(token)
    with pytest.raises(UnknownError):
        views.followed(opened.id)
    views.close(opened.id)
    with pytest.raises(UnknownError, match="has ended"):
        views.followed(token)


def test_one_scene_for_all_who_follow(clock: Clock) -> None:
    """It is made when the first of them comes, is the same for all, and closes with the view."""
    made: list[Thing] = []

    def audience(_: Any) -> Any:
        made.append(Thing())
        return made[-1]

    views = Views(lambda _: (Thing(), Thing()), make_audience=audience, clock=clock)  # type: ignore[arg-type, return-value]
    opened = views.open(None)  # type: ignore[arg-type]
    token = views.share(opened.id).follow
    assert made == []
    assert views.audience_of(token) is views.audience_of(token)
    assert len(made) == 1
    views.close(opened.id)
    assert made[0].closed


def test_who_follows_keeps_the_view_open(views: Views, clock: Clock) -> None:
    """A view stays as long as somebody follows it, though the page that shared it is loaded again."""
    opened = views.open(None)  # type: ignore[arg-type]
    token = views.share(opened.id).follow
    with views.watched(token):
        clock.now = 500.0
        views.reap()
        assert views.followed(token) is opened
    clock.now = 1000.0
    views.reap()
    with pytest.raises(UnknownError):
        views.followed(token)
