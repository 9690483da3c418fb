"""What is in force is the replay of what happened."""

from __future__ import annotations

import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from segmap.errors import ConflictError, ProjectError
from segmap.events import Grounds, Nudge
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.project import (
    AddLog,
    Choice,
    Clear,
    Create,
    Decide,
    Event,
    IntegrationId,
    LogInfo,
    ProjectState,
    Proposal,
    Propose,
    Redo,
    Rename,
    SetHeuristic,
    SetParameters,
    Undo,
    accepted,
    apply,
    check_conflict,
    event_from_json,
    fingerprint,
    replay,
)
from segmap.scans import ScanId

SCANS = 8
IDS = [f"0.{i}-0.{i + 1}" for i in range(SCANS - 1)]
FAR = ["0.0-0.5", "0.1-0.7"]
"""pairs that are no neighbours"""
SOMEWHERE = Pose2(1.0, 2.0, 0.5)
NUMBERS = st.floats(-1e6, 1e6)
POSES = st.builds(Pose2, NUMBERS, NUMBERS, NUMBERS)


def log(scans: int = SCANS) -> LogInfo:
    return LogInfo(name="hall.log", sha256="0" * 64, size=10, scans=scans)


def choice(integration: str, verdict: str = "accepted", T_1_2: Pose2 | None = SOMEWHERE) -> Choice:
    return Choice(integration=integration, verdict=verdict, T_1_2=T_1_2, parameters=fingerprint(Parameters()))


def propose(*integrations: str, kind: str = "closure", T_1_2: Pose2 | None = None) -> Propose:
    made = [Proposal(integration=name, kind=kind, T_1_2=T_1_2) for name in integrations]  # type: ignore[arg-type]
    return Propose(proposals=tuple(made))


def decide(*integrations: str, verdict: str = "accepted", who: str = "") -> Decide:
    return Decide(choices=tuple(choice(name, verdict) for name in integrations), who=who)


def project(*events: Event) -> ProjectState:
    """A project with one log of eight scans, and these events after it."""
    return replay((Create(name="Hall", parameters=Parameters()), AddLog(log=log()), *events))


def document(state: ProjectState) -> tuple[object, ...]:
    """What undo brings back."""
    settings = state.name, state.parameters, state.fingerprint, state.heuristic, state.mode
    return *settings, dict(state.decisions), dict(state.proposals)


class History(RuleBasedStateMachine):
    """A person at work, against a list of snapshots: the plainest undo there is."""

    @initialize()
    def begin(self) -> None:
        self.events: list[Event] = []
        self.state = ProjectState()
        self.past: list[tuple[object, ...]] = []
        self.future: list[tuple[object, ...]] = []
        self.record(Create(name="Hall", parameters=Parameters()))
        self.record(AddLog(log=log()))

    def record(self, event: Event) -> None:
        event = event.model_copy(update={"seq": len(self.events) + 1})
        self.state = apply(self.state, event)
        self.events.append(event)

    def step(self, event: Event) -> None:
        before = document(self.state)
        self.record(event)
        if document(self.state) != before:
            self.past.append(before)
            self.future.clear()

    @rule(
        verdicts=st.dictionaries(st.sampled_from(IDS), st.sampled_from(["accepted", "rejected"]), min_size=1), T=POSES
    )
    def decide(self, verdicts: dict[str, str], T: Pose2) -> None:
        self.step(Decide(choices=tuple(choice(name, verdict, T) for name, verdict in verdicts.items())))
        assert {name: self.state.decisions[name].verdict for name in verdicts} == verdicts

    @rule(names=st.lists(st.sampled_from(IDS), min_size=1, unique=True))
    def clear(self, names: list[str]) -> None:
        self.step(Clear(integrations=tuple(names)))
        assert not set(names) & set(self.state.decisions)

    @rule(
        names=st.lists(st.sampled_from(IDS + FAR), min_size=1, unique=True),
        kind=st.sampled_from(["closure", "imported", "manual"]),
        T=st.none() | POSES,
    )
    def propose(self, names: list[str], kind: str, T: Pose2 | None) -> None:
        self.step(propose(*names, kind=kind, T_1_2=T))
        assert {self.state.proposals[name].kind for name in names} == {kind}

    @rule(threshold=st.sampled_from([3.0, 4.0, 5.0]))
    def set_parameters(self, threshold: float) -> None:
        self.step(SetParameters(parameters=Parameters(value_threshold=threshold)))
        assert self.state.parameters.value_threshold == threshold

    @rule(heuristic=st.sampled_from(["all", "random"]), mode=st.sampled_from([None, "paper", "verified"]))
    def set_heuristic(self, heuristic: str, mode: str | None) -> None:
        self.step(SetHeuristic(heuristic=heuristic, mode=mode))
        assert self.state.heuristic == heuristic

    @rule(name=st.sampled_from(["Hall", "Office"]))
    def rename(self, name: str) -> None:
        self.step(Rename(name=name))

    @rule()
    def add_log(self) -> None:
        self.record(AddLog(log=log()))
        assert self.state.logs[-1].index == len(self.state.logs) - 1

    @precondition(lambda self: self.past)
    @rule()
    def undo(self) -> None:
        self.future.append(document(self.state))
        self.record(Undo())
        assert document(self.state) == self.past.pop()

    @precondition(lambda self: self.future)
    @rule()
    def redo(self) -> None:
        self.past.append(document(self.state))
        self.record(Redo())
        assert document(self.state) == self.future.pop()

    @invariant()
    def replay_is_the_same(self) -> None:
        written = [event.model_dump_json() for event in self.events]
        assert replay(map(event_from_json, written)) == self.state

    @invariant()
    def steps_are_counted(self) -> None:
        assert (len(self.state.done), len(self.state.undone)) == (len(self.past), len(self.future))
        assert (self.state.can_undo is None, self.state.can_redo is None) == (not self.past, not self.future)


TestHistory = History.TestCase
TestHistory.settings = settings(
    max_examples=60, stateful_step_count=25, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)


def test_a_batch_is_one_step() -> None:
    """Twelve decisions made at once are taken back at once."""
    state = project(decide(IDS[0]), decide(*IDS, verdict="rejected"))
    assert state.can_undo == f"rejected {len(IDS)} integrations"
    state = apply(state, Undo())
    assert list(state.decisions) == [IDS[0]]
    assert state.decisions[IDS[0]].verdict == "accepted"


def test_proposals_are_one_step_told_in_words() -> None:
    """A search, a file or a hand puts pairs into the queue; each is taken back at once."""
    state = project(propose(*FAR), propose("0.2-0.6", kind="manual"))
    assert set(state.proposals) == {*FAR, "0.2-0.6"}
    assert state.can_undo == "proposed 0.2-0.6"
    state = apply(state, Undo())
    assert state.can_undo == "proposed 2 loop closures"
    assert apply(state, Undo()).proposals == {}
    assert apply(state, propose(*FAR)).can_undo == "proposed 2 loop closures"
    assert len(apply(state, propose(*FAR)).done) == 1


def test_a_pair_proposed_again_says_what_was_said_last() -> None:
    """An imported edge gives a pair that was there a pose to compare with; undo brings back what was said before."""
    state = project(propose(FAR[0]), propose(FAR[0], kind="imported", T_1_2=SOMEWHERE))
    assert (state.proposals[FAR[0]].kind, state.proposals[FAR[0]].T_1_2) == ("imported", SOMEWHERE)
    assert apply(state, Undo()).proposals[FAR[0]].kind == "closure"


def test_a_proposal_of_scans_the_project_has_not_is_refused() -> None:
    """As a decision on them is."""
    with pytest.raises(ProjectError, match=r"no scan 0\.99"):
        project(propose("0.0-0.99"))
    with pytest.raises(ProjectError, match="named twice"):
        propose(FAR[0], FAR[0])
    with pytest.raises(ProjectError, match="not finite"):
        propose(FAR[0], T_1_2=Pose2(math.inf, 0.0, 0.0))


def test_nothing_can_be_redone_after_a_new_decision() -> None:
    """A new decision ends what was undone."""
    state = project(decide(IDS[0]), Undo(), decide(IDS[1]))
    assert state.can_redo is None
    with pytest.raises(ProjectError, match="nothing to redo"):
        apply(state, Redo())


def test_nothing_to_undo_is_said() -> None:
    """Creating a project and adding a log are not undone."""
    with pytest.raises(ProjectError, match="nothing to undo"):
        apply(project(), Undo())


def test_what_changes_nothing_is_no_step() -> None:
    """A name or parameters set to what they are, and an undecided integration cleared, leave no step behind."""
    same = (Rename(name="Hall"), SetParameters(parameters=Parameters()), SetHeuristic(heuristic="all"))
    state = project(decide(IDS[0]), Undo(), *same, Clear(integrations=(IDS[1],)))
    assert state.can_undo is None
    assert state.can_redo == f"accepted {IDS[0]}"


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (decide(IDS[0]), "accepted 0.0-0.1"),
        (decide(*IDS[:3]), "accepted 3 integrations"),
        (Decide(choices=(choice(IDS[0]), choice(IDS[1]), choice(IDS[2], "rejected"))), "accepted 2 and rejected 1"),
        (SetParameters(parameters=Parameters(value_threshold=3.5)), "changed value_threshold to 3.5"),
        (SetParameters(parameters=Parameters(value_threshold=3.5, seed=1)), "changed 2 parameters"),
        (SetHeuristic(heuristic="random", mode="verified"), "changed the heuristic to random and the mode to verified"),
        (Rename(name="Office"), "renamed the project to Office"),
    ],
)
def test_steps_are_described_in_words(event: Event, words: str) -> None:
    """A button can say what it takes back, and afterwards what it brings back."""
    state = project(event)
    assert state.can_undo is not None
    assert state.can_undo.startswith(words)
    assert apply(state, Undo()).can_redo == state.can_undo


def test_a_decision_keeps_its_circumstances() -> None:
    """Who, why, when, with which version and parameters, and on what revision: all is in the state."""
    made = {"who": "Anna", "reason": "clear", "at": "2025-01-02T03:04:05.678Z", "version": "1.2", "revision": 2}
    state = project(Decide(choices=(choice(IDS[0]),), **made))
    decision = state.decisions[IDS[0]]
    assert {name: getattr(decision, name) for name in made} == made
    assert decision.seq == state.revision == 3
    assert state.parameter_sets[decision.parameters] == Parameters()


def test_parameters_of_old_decisions_are_kept() -> None:
    """A decision made with earlier parameters can still be told which they were, whatever they are now."""
    state = project(decide(IDS[0]), SetParameters(parameters=Parameters(seed=5)), Undo(), Redo())
    assert state.parameter_sets[state.decisions[IDS[0]].parameters] == Parameters()
    assert state.parameter_sets[state.fingerprint].seed == 5


def test_parameters_keep_the_name_they_were_recorded_under() -> None:
    """Parameters recorded by a version that named them otherwise stay known by that name."""
    event = SetParameters(parameters=Parameters(seed=5), fingerprint="as named then")
    state = project(event_from_json(event.model_dump_json()))
    assert state.fingerprint == "as named then"
    assert apply(state, SetParameters(parameters=Parameters(seed=5))).fingerprint == "as named then"


def test_accepted_integrations_come_in_the_order_of_scans() -> None:
    """The order of the decisions does not change the map: 2 comes before 10, rejected ones are left out."""
    state = replay((AddLog(log=log(20)), decide("0.10-0.11"), decide("0.2-0.3"), decide("0.1-0.2", verdict="rejected")))
    assert accepted(state) == (
        (ScanId(0, 2), ScanId(0, 3), Pose2(1.0, 2.0, 0.5)),
        (ScanId(0, 10), ScanId(0, 11), Pose2(1.0, 2.0, 0.5)),
    )


@given(T=POSES, value=st.none() | st.floats(0.0, 1e9), reason=st.text(max_size=30))
def test_a_written_event_is_read_back_bit_for_bit(T: Pose2, value: float | None, reason: str) -> None:
    """Poses and values do not change by being written down."""
    event = Decide(choices=(choice(IDS[0], T_1_2=T).model_copy(update={"value": value}),), reason=reason)
    again = event_from_json(event.model_dump_json())
    assert again == event
    assert math.copysign(1.0, again.choices[0].T_1_2.x) == math.copysign(1.0, T.x)


# two people


def test_the_second_of_two_conflicting_decisions_is_told() -> None:
    """Bob decides on what Anna has decided since he looked: refused, naming her, the integration and the verdict."""
    state = project(decide(IDS[0], who="Anna"))
    with pytest.raises(ConflictError, match=f"Anna accepted {IDS[0]} after you looked"):
        check_conflict(state, decide(IDS[1], IDS[0], verdict="rejected", who="Bob"), revision=2)


@pytest.mark.parametrize(
    "event",
    [decide(IDS[1]), Clear(integrations=(IDS[1],)), SetParameters(parameters=Parameters(seed=1)), Rename(name="x")],
)
def test_decisions_about_other_things_do_not_conflict(event: Event) -> None:
    """Anna's decision on one integration hinders nobody elsewhere."""
    check_conflict(project(decide(IDS[0], who="Anna")), event, revision=2)


def test_having_seen_a_decision_one_can_decide_again() -> None:
    """On the revision of the earlier decision there is no conflict."""
    check_conflict(project(decide(IDS[0], who="Anna")), decide(IDS[0], who="Bob"), revision=3)


@pytest.mark.parametrize(
    ("events", "late", "words"),
    [
        ((decide(IDS[0]), Clear(integrations=(IDS[0],), who="Anna")), decide(IDS[0]), f"Anna cleared {IDS[0]}"),
        ((decide(*IDS), Undo(who="Anna")), decide(IDS[3]), f"Anna undid: accepted {len(IDS)} integrations"),
        ((decide(IDS[0]), decide(IDS[1], who="Anna")), Undo(), f"Anna accepted {IDS[1]}"),
        ((decide(IDS[0]), Undo(who="Anna")), Redo(), "Anna undid: accepted"),
        ((decide(IDS[0]), Rename(name="x")), Rename(name="y"), "Somebody renamed the project to x"),
        (
            (decide(IDS[0]), SetParameters(parameters=Parameters(seed=1), who="Anna")),
            SetParameters(parameters=Parameters(seed=2)),
            "Anna changed seed to 1 after",
        ),
    ],
)
def test_whatever_changed_since_conflicts(events: tuple[Event, ...], late: Event, words: str) -> None:
    """Clearing, undoing, renaming and parameters conflict as decisions do."""
    with pytest.raises(ConflictError) as caught:
        check_conflict(project(*events), late, revision=project(*events).revision - 1)
    assert str(caught.value).startswith(words)


def test_a_revision_from_the_future_conflicts() -> None:
    """A page that saw more than there is (a backup was put back) is told to load again."""
    with pytest.raises(ConflictError, match="load it again"):
        check_conflict(project(), decide(IDS[0]), revision=99)


def test_undo_of_a_step_that_is_no_longer_last_conflicts() -> None:
    """Who wants to undo step 3 does not undo step 4 instead."""
    state = project(decide(IDS[0]), decide(IDS[1], who="Anna"))
    with pytest.raises(ConflictError, match=f"Anna accepted {IDS[1]}"):
        apply(state, Undo(undoes=3))
    assert apply(state, Undo(undoes=4)).can_undo == f"accepted {IDS[0]}"


# what cannot be


@pytest.mark.parametrize(
    "text", ["", "x", "0.1", "0.1-0.1", "0.2-0.1", "0.1-0.02", "0.1-0.2-0.3", "-1.0-0.2", "٠.1-0.2"]
)
def test_an_integration_has_one_name(text: str) -> None:
    """Two different scans, the earlier first, in plain digits; everything else is refused with how to write it."""
    with pytest.raises(ProjectError, match="names no integration: write two"):
        IntegrationId.parse(text)


@given(st.tuples(*[st.integers(0, 99)] * 4))
def test_integration_names_round_trip(numbers: tuple[int, int, int, int]) -> None:
    """An integration is its name."""
    first, second = sorted((ScanId(*numbers[:2]), ScanId(*numbers[2:])))
    if first != second:
        assert IntegrationId.parse(str(IntegrationId(first, second))) == (first, second)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: choice(IDS[0], T_1_2=None), "cannot be accepted without a transformation"),
        (lambda: choice(IDS[0], T_1_2=Pose2(math.nan, 0.0, 0.0)), "not finite"),
        (lambda: choice("0.1-0.1"), "two different scans"),
        (lambda: choice(IDS[0], "perhaps"), "verdict: input should be 'accepted' or 'rejected'"),
        (lambda: decide(IDS[0], IDS[0]), "named twice"),
        (lambda: Clear(integrations=(IDS[0], IDS[0])), "named twice"),
        (lambda: Decide(choices=()), "choices: "),
        (lambda: Rename(name="x" * 300), "name: string should have at most 255 characters"),
        (lambda: event_from_json("{}"), "no event"),
        (lambda: event_from_json('{"kind": "explode"}'), "no event"),
        (lambda: event_from_json('{"kind": "rename", "name": "x", "more": 1}'), "more: "),
        (lambda: apply(project(), decide("0.7-0.8")), "no scan 0.8"),
        (lambda: apply(project(), decide("0.7-1.0")), "no scan 1.0"),
        (lambda: apply(project(), Clear(integrations=("0.7-0.8",))), "no scan 0.8"),
        (lambda: apply(project(), Create(name="again", parameters=Parameters())), "only once"),
        (lambda: apply(project(), Rename(name="x", seq=9)), "gap"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(make: object, words: str) -> None:
    """Wrong input to an event or at the wrong place raises ProjectError and says what is wrong."""
    with pytest.raises(ProjectError) as caught:
        make()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_parameters_are_refused() -> None:
    """A decision that names parameters the project never had could not be replayed."""
    stranger = choice(IDS[0]).model_copy(update={"parameters": "elsewhere"})
    with pytest.raises(ProjectError, match="never had the parameters 'elsewhere'"):
        apply(project(), Decide(choices=(stranger,)))


def test_names_that_cannot_be_written_are_mended() -> None:
    """A file name with bytes that are no text is kept, with question marks."""
    assert Rename(name="map\udcff.log").name == "map?.log"


def test_a_state_does_not_change_by_what_comes_after() -> None:
    """States are values: an earlier one stays what it was, and its mappings cannot be written to."""
    before = project(decide(IDS[0]))
    held = document(before)
    apply(before, decide(IDS[0], verdict="rejected"))
    assert document(before) == held
    with pytest.raises(TypeError):
        before.decisions["x"] = before.decisions[IDS[0]]  # type: ignore[index]


def test_what_is_laid_by_hand_is_a_step_like_any_other() -> None:
    """It is named, undone and redone; the pair's proposal stays what it was beside it."""
    state = project()
    claim = Proposal(integration="0.0-0.2", kind="imported", T_1_2=Pose2(1.0, 0.0, 0.0), source="graph.g2o")
    state = apply(state, Propose(proposals=(claim,)))
    nudge = Nudge(T_1_2=Pose2(0.9, 0.1, 0.0), start=Pose2(0.8, 0.0, 0.1), ties=((0, 1), (2, 3)))
    state = apply(state, Propose(proposals=(claim.model_copy(update={"nudge": nudge}),), who="Ann"))
    assert state.can_undo == "laid 0.0-0.2 by hand"
    assert state.proposals["0.0-0.2"].T_1_2 == claim.T_1_2
    undone = apply(state, Undo())
    assert undone.proposals["0.0-0.2"] == claim
    assert apply(undone, Redo()).proposals["0.0-0.2"].nudge == nudge


def test_grounds_and_nudges_are_kept_to_the_last_bit_and_nonsense_is_refused() -> None:
    """As JSON and back; a pose that is not finite, or a segment below 0, is none."""
    grounds = Grounds(
        verdict="review", confidence=0.1 + 0.2, score=-1.5, supported=3.0, contradicted=0.25, candidates=7
    )
    made = choice("0.0-0.1", "rejected").model_copy(update={"origin": "nudged", "grounds": grounds})
    event = Decide(choices=(made,), who="Ann")
    assert event_from_json(event.model_dump_json()) == event
    pose = Pose2(0.0, 0.0, 0.0)
    far = Pose2(float("inf"), 0.0, 0.0)
    for wrong in ({"T_1_2": far, "start": pose}, {"T_1_2": pose, "start": pose, "ties": ((-1, 0),)}):
        with pytest.raises(ProjectError):
            Proposal(integration="0.0-0.2", kind="manual", nudge=Nudge(**wrong))
