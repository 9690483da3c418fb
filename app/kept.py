"""Matches in a project file, by what they depend on: found once, whoever looks for them and however often."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from typing import Protocol

from pydantic import TypeAdapter

from app.review import Outcome
from segmap.errors import SegmapError
from segmap.events import IntegrationId
from segmap.integration import Match
from segmap.spreading import Matches, Pair

__all__ = ["KeptMatches", "ResultStore", "keep_matches", "kept_match", "kept_outcomes"]

_OUTCOME = TypeAdapter(Outcome)
log = logging.getLogger(__name__)


class ResultStore(Protocol):
    """The cache of results in a project file."""

    def put_result(self, key: str, text: str) -> None: ...
    def put_results(self, texts: Mapping[str, str]) -> None: ...
    def get_result(self, key: str) -> str | None: ...
    def results(self, keys: Iterable[str]) -> Mapping[str, str]: ...
    def result_keys(self, prefix: str) -> list[str]: ...


def kept_match(store: ResultStore, key: str, integration: str) -> Match | None:
    """A match found under the settings of a key; None: not found yet, or no longer kept."""
    text = store.get_result(_match_key(key, integration))
    try:
        return None if text is None else Match.from_json(text)
    except ValueError:
        return None


def kept_outcomes(store: ResultStore, key: str, integrations: Iterable[str]) -> dict[str, Outcome | None]:
    """The outcomes that are kept of some integrations, in one go; one that cannot be read is computed again."""
    places = {_outcome_key(key, integration): integration for integration in integrations}
    return {places[place]: _outcome(text) for place, text in store.results(list(places)).items()}


def keep_matches(store: ResultStore, key: str, found: Mapping[str, tuple[Match, Outcome]]) -> None:
    """Write matches to the cache; a cache that cannot be written costs time later, nothing else."""
    try:
        full = {_match_key(key, id): match.to_json() for id, (match, _) in found.items()}
        short = {_outcome_key(key, id): _OUTCOME.dump_json(one).decode() for id, (_, one) in found.items()}
        store.put_results(full | short)
    except SegmapError as error:
        log.warning("The matches of %d pairs were not kept: %s", len(found), error)


def _outcome(text: str) -> Outcome | None:
    try:
        return _OUTCOME.validate_json(text)
    except ValueError:
        return None


def _match_key(key: str, integration: str) -> str:
    return f"match/{key}/{integration}"


def _outcome_key(key: str, integration: str) -> str:
    return f"outcome-2/{key}/{integration}"


class KeptMatches(Mapping[Pair, Match]):
    """All matches a project file holds under the settings of a key, each read when it is asked for."""

    def __init__(self, store: ResultStore, key: str) -> None:
        self._store, self._key = store, key
        prefix = _match_key(key, "")
        names = (name.removeprefix(prefix) for name in store.result_keys(prefix))
        self._found: dict[Pair, Match | None] = {(pair.first, pair.second): None for pair in map(_pair, names) if pair}

    def keep(self, matches: Matches) -> None:
        """Write new ones into the file."""
        self._found.update(matches)
        keep_matches(self._store, self._key, {_name(pair): (m, Outcome.of(m)) for pair, m in matches.items()})

    def __len__(self) -> int:
        return len(self._found)

    def __iter__(self) -> Iterator[Pair]:
        return iter(self._found)

    def __contains__(self, pair: object) -> bool:
        """Whether it is there, and can be read."""
        return pair in self._found and self.get(pair) is not None

    def __getitem__(self, pair: Pair) -> Match:
        held = self._found[pair] or kept_match(self._store, self._key, _name(pair))
        if held is None:  # dropped meanwhile, or no match at all
            del self._found[pair]
            raise KeyError(pair)
        self._found[pair] = held
        return held


def _name(pair: Pair) -> str:
    return str(IntegrationId(*pair))


def _pair(name: str) -> IntegrationId | None:
    try:
        return IntegrationId.parse(name)
    except SegmapError:
        return None
