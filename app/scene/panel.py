"""The panel at the right of the scene: the current step, its buttons and its hotkeys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import viser

from app.drawing import STAGES
from app.scene import markup
from app.workbench import View

__all__ = ["HOTKEYS", "Onlookers", "Panel"]

Do = Callable[[Callable[[], None]], None]
"""runs an action of the view, and tells people what goes wrong"""

WIDTH = 330
"""pixels"""
HERE = "● "
"""before the name of the stage and the dimension that are shown"""
PREVIOUS, NEXT, FIT = "‹ Previous", "Next ›", "Fit"
DIMENSIONS = ("2D", "3D", FIT)
BY_HAND, HAND_OFF = "Lay by hand", "Stop laying by hand"

HOTKEYS: tuple[tuple[str, str, str | None, str], ...] = (
    ("Next pair", "J", None, "next"),
    ("Previous pair", "K", None, "previous"),
    ("Next candidate", "N", None, "next_candidate"),
    ("Previous candidate", "P", None, "previous_candidate"),
    ("Next heuristic", "H", None, "next_heuristic"),
    ("Previous heuristic", "H", "shift", "previous_heuristic"),
    ("Next stage", "T", None, "next_stage"),
    ("Previous stage", "T", "shift", "previous_stage"),
    ("Accept", "Y", None, "accept"),
    ("Reject", "X", None, "reject"),
    ("Skip: decide later", "L", None, "skip"),
    ("Undo", "U", None, "undo"),
    ("Redo", "R", None, "redo"),
    ("Lay the second scan by hand", "G", None, "toggle_nudging"),
    ("2D or 3D", "V", None, "toggle_dimension"),
    ("Fit everything into the window", "F", None, "fit"),
    ("Measure between two clicks", "M", None, "toggle_measuring"),
)
"""label, key, modifier, action of the view; W A S D Q E and the arrows are viser's own"""


class Panel:
    """viser's panel, wired to a view; :meth:`show` brings it up to a snapshot."""

    def __init__(self, gui: viser.GuiApi, view: View, do: Do) -> None:
        self._gui, self._view, self._do = gui, view, do
        self._shown: dict[str, str] = {}
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        self._add_step()
        self._add_choices()
        self._add_looks()
        self._add_hotkeys()

    # --- building ---------------------------------------------------------------------------------

    def _add_step(self) -> None:
        self._step, self._value, self._messages = (self._gui.add_html("") for _ in range(3))
        self._accept = self._button("Accept", "green", viser.Icon.CHECK, "accept", "Accept this candidate (Y)")
        self._reject = self._button("Reject", "red", viser.Icon.X, "reject", "Reject this pair (X)")
        self._group("Otherwise", {"Skip": "skip", "Undo": "undo", "Redo": "redo"}, "Decide later: L. Undo: U. Redo: R.")
        self._gui.add_divider()

    def _add_choices(self) -> None:
        self._candidate = self._gui.add_html("")
        self._group("Candidate", {PREVIOUS: "previous_candidate", NEXT: "next_candidate"}, "Keys P and N")
        self._hand = self._button(BY_HAND, "gray", viser.Icon.HAND_MOVE, "toggle_nudging", "Drag the second scan (G)")
        self._gui.add_divider()
        self._heuristics = self._gui.add_html("")
        self._group("Heuristic", {PREVIOUS: "previous_heuristic", NEXT: "next_heuristic"}, "Keys Shift+H and H")
        self._gui.add_divider()
        self._stages = self._choice("Stage", STAGES, self._view.set_stage, "Keys 1 to 6, or T and Shift+T")
        self._dimensions = self._choice("View", DIMENSIONS, self._set_dimension, "2D or 3D: V. Fit: F.")

    def _add_looks(self) -> None:
        with self._gui.add_folder("Clicked segment"):
            self._picked = self._gui.add_html("")
        with self._gui.add_folder("Legend"):
            self._legend = self._gui.add_html("")
        self._layer_folder = self._gui.add_folder("Layers", expand_by_default=False)
        self._layers: dict[str, viser.GuiCheckboxHandle] = {}
        with self._gui.add_folder("Export"):
            self._gui.add_html(markup.exports(self._view.session.id))

    def _set_dimension(self, name: str) -> None:
        if name == FIT:
            self._view.fit()
        else:
            self._view.set_dimension(int(name[0]))

    def _add_hotkeys(self) -> None:
        for label, key, modifier, action in HOTKEYS:
            command = self._gui.add_command(label, hotkey=key, modifier=modifier)  # type: ignore[arg-type]
            command.on_trigger(self._doing(getattr(self._view, action)))
        for number, stage in enumerate(STAGES, 1):
            command = self._gui.add_command(f"Stage: {stage}", hotkey=str(number))  # type: ignore[arg-type]
            command.on_trigger(self._doing(partial(self._view.set_stage, stage)))

    def _doing(self, action: Callable[[], None]) -> Callable[[Any], None]:
        return lambda _: self._do(action)

    def _button(self, label: str, colour: Any, icon: Any, action: str, hint: str) -> viser.GuiButtonHandle:
        button = self._gui.add_button(label, color=colour, icon=icon, hint=hint)
        button.on_click(self._doing(getattr(self._view, action)))
        return button

    def _group(self, label: str, actions: Mapping[str, str], hint: str) -> None:
        group = self._gui.add_button_group(label, tuple(actions), hint=hint)
        group.on_click(lambda event: self._do(getattr(self._view, actions[event.target.value])))

    def _choice(
        self, label: str, names: tuple[str, ...], choose: Callable[[str], None], hint: str
    ) -> viser.GuiButtonGroupHandle:
        """Buttons of which one is on; its name is marked, as viser has no look for that."""
        group = self._gui.add_button_group(label, names, hint=hint)
        group.on_click(lambda event: self._do(lambda: choose(event.target.value.removeprefix(HERE))))
        return group

    # --- showing ----------------------------------------------------------------------------------

    def show(self, snapshot: Mapping[str, Any]) -> None:
        """Bring everything up to a snapshot; what has not changed is not sent."""
        _show(self._step, markup.step(snapshot))
        _show(self._value, markup.value(snapshot))
        _show(self._messages, markup.messages(snapshot))
        _show(self._candidate, markup.candidate(snapshot))
        _show(self._heuristics, markup.heuristics(snapshot))
        _show(self._picked, markup.picked(snapshot))
        _show(self._legend, markup.legend(snapshot))
        _mark(self._stages, STAGES, snapshot["stage"])
        _mark(self._dimensions, DIMENSIONS, f"{snapshot['dimension']}D")
        _enable(self._accept, snapshot["candidate"] is not None)
        _enable(self._reject, snapshot["row"] is not None)
        _enable(self._hand, snapshot["row"] is not None)
        _relabel(self._hand, HAND_OFF if snapshot["nudging"] else BY_HAND)
        self._show_layers(snapshot["layers"])

    def _show_layers(self, layers: list[dict[str, Any]]) -> None:
        for layer in layers:
            box = self._layers.get(layer["name"]) or self._add_layer(layer["name"], layer["title"], layer["visible"])
            if box.value != layer["visible"]:
                box.value = layer["visible"]  # type: ignore[misc]  # its setter is hidden from type checkers
        names = {layer["name"] for layer in layers}
        for name, box in self._layers.items():
            if box.visible != (name in names):
                box.visible = name in names

    def _add_layer(self, name: str, title: str, visible: bool) -> viser.GuiCheckboxHandle:
        with self._layer_folder:
            box = self._gui.add_checkbox(title, visible)
        box.on_update(lambda event: self._switched(event, name))
        self._layers[name] = box
        return box

    def _switched(self, event: viser.GuiEvent[viser.GuiCheckboxHandle], name: str) -> None:
        if event.client is not None:  # otherwise it was the panel itself, following the view
            self._do(lambda: self._view.switch_layer(name, event.target.value))


class Onlookers:
    """The panel of those who may only look: what is shown, in words, and nothing to press."""

    def __init__(self, gui: viser.GuiApi) -> None:
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        self._parts = {part: gui.add_html("") for part in (markup.step, markup.value, markup.candidate, markup.picked)}
        with gui.add_folder("Legend"):
            self._parts[markup.legend] = gui.add_html("")

    def show(self, snapshot: Mapping[str, Any]) -> None:
        """Bring everything up to a snapshot."""
        for part, handle in self._parts.items():
            _show(handle, "" if part is markup.picked and snapshot["picked"] is None else part(snapshot))


def _show(handle: viser.GuiHtmlHandle, content: str) -> None:
    """Change a part of the panel, where it is another one."""
    if handle.content != content:
        handle.content = content


def _mark(group: viser.GuiButtonGroupHandle, names: tuple[str, ...], here: str) -> None:
    options = tuple(HERE + name if name == here else name for name in names)
    if tuple(group.options) != options:
        group.options = options


def _relabel(button: viser.GuiButtonHandle, label: str) -> None:
    if button.label != label:
        button.label = label


def _enable(button: viser.GuiButtonHandle, on: bool) -> None:
    if button.disabled == on:
        button.disabled = not on
