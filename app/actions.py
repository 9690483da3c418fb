"""What pages can ask a view to do, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from app.errors import RequestError

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
        if not (value is None or isinstance(value, str)):
            raise RequestError(f"The action {name} takes the integration that is meant as its value, or none.")
        getattr(view, name)(value)

    return action


def _set_picked(view: View, value: Any) -> None:
    if value is None:
        view.set_picked(None)
        return
    source, segment = (value.get("source"), value.get("segment")) if isinstance(value, dict) else (None, None)
    if not isinstance(source, str) or not isinstance(segment, int):
        raise RequestError("The action set_picked takes {source, segment} as its value, or none.")
    view.set_picked(source, segment)


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
            "undo",
            "redo",
        )
    },
    **{name: _with(name, str) for name in ("select", "set_heuristic", "set_stage", "toggle_layer", "set_theme", *MAP)},
    **{name: _with(name, int) for name in ("set_candidate", "set_dimension")},
    **{name: _decision(name) for name in ("accept", "reject")},
    "set_picked": _set_picked,
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
