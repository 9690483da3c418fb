"""What another mode does to a project's settings. Pure."""

from __future__ import annotations

from segmap.integration import DEFAULT_HEURISTIC, DEFAULT_PRESET, chosen_heuristic, heuristics
from segmap.parameters import Parameters, preset
from segmap.project import ProjectState

__all__ = ["NEW_PROJECTS", "heuristic_in", "parameters_in"]

NEW_PROJECTS = "verified"
"""the mode of new projects"""


def heuristic_in(mode: str, state: ProjectState, name: str | None = None) -> str:
    """The heuristic asked for; otherwise the project's, unless it is the default of a mode left, or unknown here.

    Raises:
        ParameterError: there is no such mode, or no such heuristic in it.
    """
    by_choice = state.heuristic != DEFAULT_HEURISTIC[state.mode] and state.heuristic in heuristics(mode)
    kept = state.heuristic if mode == state.mode or by_choice else None
    return chosen_heuristic(mode, name or kept)


def parameters_in(mode: str, state: ProjectState) -> Parameters:
    """The project's parameters; a threshold of the value that stood at its mode's default takes the new mode's."""
    before, after = (preset(DEFAULT_PRESET[name]).value_threshold for name in (state.mode, mode))
    at_default = state.parameters.value_threshold == before
    return state.parameters.replace(value_threshold=after) if at_default else state.parameters
