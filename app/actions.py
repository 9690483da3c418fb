"""What pages can ask a view to do, by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeGuard

from app.drawables import Pick
from app.errors import RequestError
from segmap.pose import Pose2

if TYPE_CHECKING:
    from app.workbench import View

__all__ = ["ACTIONS", "perform"]


def _plain(name: str) -> Callable[[View, Any], None]:
    def action(view: View, _: Any) -> None:
        getattr(view, name)()

    return action


def _with(name: str, kind: type[str] | type[int]) -> Callable[[View, Any], None]:
    def action(view: View, value: Any) -> None:
        if not isinstance(value, kind) or isinstance(value, bool):
            raise RequestError(f"The action {name} takes a {'text' if kind is str else 'whole number'} as its value.")
        getattr(view, name)(value)

    return action


def _decision(name: str) -> Callable[[View, Any], None]:
    def action(view: View, value: Any) -> None:
        told = value if isinstance(value, dict) else {"integration": value}
        meant, revision, who = told.get("integration"), told.get("revision"), told.get("who")
        if not (isinstance(meant, str | None) and _is_whole(revision, optional=True) and isinstance(who, str | None)):
            raise RequestError(f"The action {name} takes the integration that is meant as its value, or none.")
        getattr(view, name)(meant, revision, None if who is None else who[:255])

    return action


def _is_whole(value: Any, optional: bool = False) -> bool:
    return (optional and value is None) or (isinstance(value, int) and not isinstance(value, bool))


def _decide_many(view: View, value: Any) -> None:
    told = value if isinstance(value, dict) else {}
    ids, verdict, revision = told.get("integrations"), told.get("verdict"), told.get("revision")
    who, known = told.get("who"), _are_texts(ids) and isinstance(verdict, str)
    if not known or not _is_whole(revision, optional=True) or not isinstance(who, str | None):
        raise RequestError("The action decide_many takes {integrations, verdict} as its value.")
    view.decide_many(list(ids or ()), str(verdict), revision, None if who is None else who[:255])


def _set_order(view: View, value: Any) -> None:
    if value is not None and not _are_texts(value):
        raise RequestError("The action set_order takes a list of integrations as its value, or none.")
    view.set_order(value)


def _are_texts(value: Any) -> TypeGuard[list[str]]:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


def _try_parameters(view: View, value: Any) -> None:
    if value is not None and not (isinstance(value, dict) and all(isinstance(name, str) for name in value)):
        raise RequestError("The action try_parameters takes {name: value} as its value, or none.")
    view.try_parameters(value)


def _set_nudging(view: View, value: Any) -> None:
    if not isinstance(value, bool):
        raise RequestError("The action set_nudging takes true or false as its value.")
    view.set_nudging(value)


def _hold(view: View, value: Any) -> None:
    told = value if isinstance(value, dict) else {}
    numbers = [told.get(name) for name in ("x", "y", "theta")]
    if not all(isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n) for n in numbers):
        raise RequestError("The action hold takes {x, y, theta} as its value, in metres and radians.")
    view.hold(Pose2(*map(float, numbers)))  # type: ignore[arg-type]


def _lay(view: View, value: Any) -> None:
    pick = _picked("lay", value)
    if pick is not None and pick.source not in ("first", "second"):
        raise RequestError("The action lay takes a segment of the first or of the second map.")
    view.lay(pick)


def _set_picked(view: View, value: Any) -> None:
    pick = _picked("set_picked", value)
    view.set_picked(None if pick is None else pick.source, 0 if pick is None else pick.segment)


def _picked(name: str, value: Any) -> Pick | None:
    if value is None:
        return None
    source, segment = (value.get("source"), value.get("segment")) if isinstance(value, dict) else (None, None)
    if not isinstance(source, str) or not _is_whole(segment):
        raise RequestError(f"The action {name} takes {{source, segment}} as its value, or none.")
    return Pick(source, int(segment or 0))


MAP = ("set_colouring", "toggle_component", "isolate", "set_compare", "set_side")
"""actions on the merged map"""
ACTIONS: Mapping[str, Callable[[View, Any], None]] = {
    **{
        name: _plain(name)
        for name in (
            "next",
            "previous",
            "next_candidate",
            "previous_candidate",
            "next_heuristic",
            "previous_heuristic",
            "next_stage",
            "previous_stage",
            "toggle_dimension",
            "toggle_measuring",
            "fit",
            "skip",
            "toggle_nudging",
            "let_go",
            "undo",
            "redo",
        )
    },
    **{
        name: _with(name, str)
        for name in ("select", "set_heuristic", "set_stage", "toggle_layer", "set_theme", "set_who", "set_reason", *MAP)
    },
    **{name: _with(name, int) for name in ("set_candidate", "set_dimension")},
    **{name: _decision(name) for name in ("accept", "reject")},
    "set_picked": _set_picked,
    "decide_many": _decide_many,
    "set_order": _set_order,
    "set_nudging": _set_nudging,
    "hold": _hold,
    "try_parameters": _try_parameters,
    "lay": _lay,
}
"""Every action; the value it takes is told when it is wrong."""


def perform(view: View, action: str, value: Any = None) -> None:
    """Do what a page asks for.

    Raises:
        RequestError: there is no such action, or it cannot be done with this value.
    """
    if action not in ACTIONS:
        raise RequestError(f"There is no action {action[:80]!r}. Actions are: {', '.join(ACTIONS)}.")
    ACTIONS[action](view, value)
