"""The matches of a project: found in the background, kept in its file, shown only under the parameters they are for."""

from __future__ import annotations

import hashlib
import json
import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from app.jobs import Backlog, Check
from app.kept import ResultStore, keep_matches, kept_match, kept_outcomes
from app.resources import program_version
from app.review import THRESHOLDS, Outcome
from segmap.errors import CancelledError, SegmapError
from segmap.integration import DEFAULT_PRESET, Match, heuristics
from segmap.parameters import Parameters, preset
from segmap.verdict import CALIBRATION

__all__ = ["Matching", "Progress", "Settings", "Task", "recall"]

MATCHES_IN_MEMORY = 256
PREPARING = "Getting ready; the first time this takes some seconds."
IRRELEVANT = {*THRESHOLDS, "fusion_tolerance", "fusion_variant", "fusion_bound", "max_connector", "pivot_form"}
"""parameters no candidate's value depends on"""
EVIDENCE = {
    "use_sights",
    "use_refinement",
    "use_rivals",
    "use_confidence",
    "sight_tolerance",
    "shadow_depth",
    "conflict_weight",
    "shadow_weight",
    "unseen_weight",
    "judged_candidates",
    "refined_candidates",
    "refine_gate",
    "rival_distance",
    "rival_angle",
}
"""parameters that matter to verified mode only"""
OWN = {
    "consecutive": {"segment_length_percentage", "consecutive_over_short", "consecutive_strict"},
    "random": {"segment_division_factor", "random_rounds", "seed", "good_enough"},
    "histogram": {"histogram_slots"},
}
"""parameters that matter to one heuristic only"""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Settings:
    """What every match depends on, beside the two scans and the heuristic."""

    parameters: Parameters
    mode: str

    def key(self, heuristic: str) -> str:
        """The same for settings under which a heuristic finds the same."""
        foreign = {name for other, names in OWN.items() if other != heuristic for name in names}
        unused = set() if self.mode == "verified" else EVIDENCE
        relevant = self.parameters.model_dump(mode="json", exclude=IRRELEVANT | foreign | unused)
        calibration = CALIBRATION if self.mode == "verified" else {}
        told = json.dumps([program_version(), self.mode, heuristic, relevant, calibration], sort_keys=True)
        return hashlib.sha256(told.encode()).hexdigest()[:24]

    @property
    def searched(self) -> Parameters:
        """The parameters to search with: the thresholds judge afterwards, and never decide what is found."""
        own = preset(DEFAULT_PRESET[self.mode])
        return self.parameters.replace(**{name: getattr(own, name) for name in THRESHOLDS})


@dataclass(frozen=True)
class Task:
    """One match to be found; equal tasks have equal results."""

    integration: str
    heuristic: str
    key: str


@dataclass(frozen=True)
class Progress:
    """How far matching is."""

    done: int
    total: int
    running: int
    cancelled: bool
    message: str

    def to_json(self) -> dict[str, Any]:
        """As the pages get it."""
        return asdict(self)


class Matching:
    """Finds the matches of a list of integrations, those asked for first, and keeps them.

    ``find`` does the matching; ``told`` hears of each new outcome, ``changed`` of progress.
    """

    def __init__(
        self,
        store: ResultStore,
        find: Callable[[str, str, Settings, Check], Match],
        *,
        told: Callable[[str, str], None],
        changed: Callable[[], None],
        prepare: Callable[[Check], None] | None = None,
        workers: int = 1,
    ) -> None:
        self._store, self._find, self._told = store, find, told
        self._lock = threading.RLock()
        self._settings: Settings | None = None
        self._heuristic, self._integrations, self._listed = "", tuple[str, ...](), set[str]()
        self._keys: dict[str, str] = {}
        self._done = 0
        self._outcomes: dict[tuple[str, str], Outcome | None] = {}
        self._matches: OrderedDict[tuple[str, str], Match] = OrderedDict()
        self._backlog: Backlog[Task] = Backlog(
            self._work, workers=workers, name="matching", prepare=prepare, changed=changed
        )
        self.cancel, self.resume = self._backlog.cancel, self._backlog.resume
        self.settle, self.close = self._backlog.settle, self._backlog.close

    @property
    def progress(self) -> Progress:
        """How far matching by the heuristic in use is."""
        done, total, backlog = self._done, len(self._integrations), self._backlog
        message = PREPARING if backlog.preparing else _message(done, total, backlog.running, backlog.cancelled)
        return Progress(done, total, backlog.running, backlog.cancelled, message)

    def use(self, settings: Settings, heuristic: str, integrations: Sequence[str]) -> None:
        """Find the matches of some pairs by a heuristic under these settings; what was found under others is no
        longer shown.
        """
        keys = {name: settings.key(name) for name in heuristics(settings.mode)}
        with self._lock:
            self._settings = settings
            if (keys, heuristic, integrations) == (self._keys, self._heuristic, self._integrations):
                return
            self._forget(name for name in {*keys, *self._keys} if keys.get(name) != self._keys.get(name))
            self._keys, self._heuristic, self._integrations = keys, heuristic, tuple(integrations)
            self._listed = set(integrations)
            self._recall(heuristic)
            missing = [id for id in self._integrations if self._outcomes[id, heuristic] is None]
            self._done = len(self._integrations) - len(missing)
            self._backlog.replace([self._task(id, heuristic) for id in missing])

    def _forget(self, heuristics: Iterable[str]) -> None:
        gone = set(heuristics)
        self._outcomes = {place: outcome for place, outcome in self._outcomes.items() if place[1] not in gone}
        for place in [place for place in self._matches if place[1] in gone]:
            del self._matches[place]

    def ask(self, integration: str, heuristic: str) -> bool:
        """Look for this match next; False when it is there already. One that failed is tried again."""
        task = self._task(integration, heuristic)
        with self._lock:
            held = self.match(integration, heuristic)
            if held is None:
                self._backlog.ask(task)
                return True
            told = self.outcome(integration, heuristic) is not None
        if not told:  # the search for loops found it meanwhile
            self._record(task, Outcome.of(held), held)
        return False

    def outcome(self, integration: str, heuristic: str) -> Outcome | None:
        """What is known of a match; None: not computed yet."""
        place = (integration, heuristic)
        with self._lock:
            if place not in self._outcomes:
                self._outcomes[place] = kept_outcomes(self._store, self._key(heuristic), [integration]).get(integration)
            return self._outcomes[place]

    def match(self, integration: str, heuristic: str) -> Match | None:
        """A match in full; None: not computed yet, or failed."""
        place = (integration, heuristic)
        with self._lock:
            if place not in self._matches:
                match = kept_match(self._store, self._key(heuristic), integration)
                if match is None:
                    return None
                self._keep(place, match)
            self._matches.move_to_end(place)
            return self._matches[place]

    def _recall(self, heuristic: str) -> None:
        """Read what the project file holds of a heuristic, in one go."""
        missing = [id for id in self._integrations if self._outcomes.get((id, heuristic)) is None]
        held = kept_outcomes(self._store, self._key(heuristic), missing)
        self._outcomes = dict.fromkeys((id, heuristic) for id in missing) | self._outcomes
        self._outcomes |= {(id, heuristic): outcome for id, outcome in held.items()}

    def _work(self, task: Task, check: Check) -> None:
        with self._lock:
            settings = self._settings
            if settings is None or not self._wanted(task):
                return
            held = self.match(task.integration, task.heuristic)
        if held is not None:  # the search for loops found it meanwhile
            self._record(task, Outcome.of(held), held)
            return
        try:
            match = self._find(task.integration, task.heuristic, settings, check)
        except CancelledError:
            raise
        except SegmapError as error:
            self._failed(task, str(error))
        except Exception as error:
            log.exception("Matching %s failed.", task.integration)
            self._failed(task, f"Matching failed: {type(error).__name__}. The server's output says where.")
        else:
            self._found(task, match)

    def _found(self, task: Task, match: Match) -> None:
        outcome = Outcome.of(match)
        if self._wanted(task):
            keep_matches(self._store, task.key, {task.integration: (match, outcome)})
        self._record(task, outcome, match)

    def _failed(self, task: Task, reason: str) -> None:
        self._record(task, Outcome(task.heuristic, failure=reason))

    def _record(self, task: Task, outcome: Outcome, match: Match | None = None) -> None:
        place = (task.integration, task.heuristic)
        with self._lock:
            if not self._wanted(task):
                return
            listed = task.integration in self._listed
            self._done += listed and task.heuristic == self._heuristic and self._outcomes.get(place) is None
            self._outcomes[place] = outcome
            if match is not None:
                self._keep(place, match)
        if listed:
            self._told(*place)

    def _wanted(self, task: Task) -> bool:
        """False for results that come after the parameters were changed."""
        with self._lock:
            return task.key == self._keys.get(task.heuristic)

    def _keep(self, place: tuple[str, str], match: Match) -> None:
        self._matches[place] = match
        while len(self._matches) > MATCHES_IN_MEMORY:
            self._matches.popitem(last=False)

    def _task(self, integration: str, heuristic: str) -> Task:
        return Task(integration, heuristic, self._key(heuristic))

    def _key(self, heuristic: str) -> str:
        return self._keys.get(heuristic, "")


def recall(store: ResultStore, settings: Settings) -> Callable[[str, str], Outcome | None]:
    """What a project file holds of matches under these settings, by integration and heuristic; nothing is computed."""

    def outcome(integration: str, heuristic: str) -> Outcome | None:
        return kept_outcomes(store, settings.key(heuristic), [integration]).get(integration)

    return outcome


def _message(done: int, total: int, running: int, cancelled: bool) -> str:
    if done >= total:
        return f"All {total} pairs are matched." if total else "There is nothing to match."
    if cancelled:
        return f"Stopped: {done} of {total} pairs are matched."
    return f"{done} of {total} pairs are matched." if running or done else f"{total} pairs are about to be matched."
