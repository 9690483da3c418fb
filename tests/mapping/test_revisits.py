"""Which closures of a whole map a person is asked about."""

from dataclasses import replace
from itertools import pairwise

import pytest
from found import candidate, match, scans

from segmap.graph import optimise
from segmap.integration import Verdict
from segmap.links import Link
from segmap.mapping import WholeMap
from segmap.pose import Pose2
from segmap.revisits import SPACING, neighbours, proposed, revisits
from segmap.scans import ScanId

THERE = scans(*range(20))
BACK = scans(*range(20, 40))
EVERY = [*THERE, *BACK]
"""twenty scans down a corridor, a metre apart, and twenty back beside them"""
PLACES = {scan: Pose2(i if i < 20 else 39.0 - i, 0.0 if i < 20 else 0.5, 0.0) for i, scan in enumerate(EVERY)}


def link(a, b, why="accepted", confidence=0.95, off=0.0):
    """A link that puts two scans where they are, or some metres off."""
    T_1_2 = PLACES[a].inverse() @ PLACES[b] @ Pose2(off, 0.0, 0.0)
    return replace(Link.of((a, b), match(candidate(T_1_2)), 0, why), confidence=confidence)


CHAIN = [link(a, b) for a, b in pairwise(EVERY)]


def closures(numbers=range(20)):
    """Each scan of the way there with the one of the way back beside it, the farther down the corridor the surer."""
    return [link(EVERY[i], EVERY[39 - i], "closed", 0.9 + 0.001 * i) for i in numbers]


def whole_of(links, keys=EVERY):
    """The whole map of some links."""
    return WholeMap(optimise([one.edge for one in links]), tuple(links), tuple(keys), {}, tuple(EVERY))


def beside(verdict=Verdict.ACCEPTED, without=()):
    """The matches of all neighbours."""
    return {one.pair: match(candidate(one.T_1_2), verdict=verdict) for one in CHAIN if one.pair not in without}


def test_one_way_back_is_one_revisit():
    """Of twenty closures that say the same the surest is chosen, and one every few metres of way."""
    (revisit,) = revisits(whole_of([*CHAIN, *closures()]))
    assert [one.confidence for one in revisit.closures] == sorted((one.confidence for one in closures()), reverse=True)
    assert revisit.chosen[0].pair == (EVERY[19], EVERY[20])
    assert [one.first.scan for one in revisit.chosen] == [19, 11, 3]
    assert all(abs(a.first.scan - b.first.scan) >= SPACING for a, b in pairwise(revisit.chosen))


def test_places_far_from_each_other_are_revisits_of_their_own():
    """Where nothing is seen again for more than a few metres, another one begins; each is asked about."""
    found = revisits(whole_of([*CHAIN, *closures([0, 1, 2, 15, 16])]))
    assert sorted(len(one.closures) for one in found) == [2, 3]
    assert all(len(one.chosen) == 1 for one in found)


def test_what_the_others_contradict_is_not_asked_about():
    """It is counted, and so is what says the same."""
    wrong = link(EVERY[5], EVERY[30], "closed", 0.999, off=3.0)
    asked = proposed(whole_of([*CHAIN, *closures(), wrong]), beside())
    assert asked.silenced == (wrong,)
    assert wrong not in asked.chosen
    assert (len(asked.chosen), asked.others, asked.ties) == (3, 17, ())


def test_what_nothing_else_ties_is_asked_about():
    """Where neighbours are not accepted, the surest link inside the chain that holds them, and no other."""
    gap = CHAIN[7].pair
    across = [link(EVERY[6], EVERY[8], "agreed", 0.7), link(EVERY[7], EVERY[9], "agreed", 0.8)]
    links = [one for one in CHAIN if one.pair != gap]
    asked = proposed(whole_of([*links, *across]), beside(without=[gap]))
    assert (asked.revisits, asked.ties) == ((), (across[1],))
    undecided = proposed(whole_of([*CHAIN, *across]), beside(Verdict.REVIEW))
    assert len(undecided.ties) == len(EVERY) - 1


def test_what_would_slide_is_held():
    """A neighbour that is hardly known along the corridor ties it; the link that says where it is comes along."""
    loose = ((4.0, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-5))
    gap = CHAIN[7].pair
    sliding = replace(link(*gap, "paced", 0.99, off=0.2), covariance=loose)
    sharp = link(EVERY[6], EVERY[8], "agreed", 0.6)
    links = [one for one in CHAIN if one.pair != gap]
    asked = proposed(whole_of([*links, sliding, sharp]), beside(without=[gap]))
    assert asked.ties == (sliding,)
    far = replace(sliding, T_1_2=sliding.T_1_2 @ Pose2(1.0, 0.0, 0.0))
    asked = proposed(whole_of([*links, far, sharp]), beside(without=[gap]))
    assert asked.ties == (sharp,)


def test_two_logs_have_revisits_of_their_own():
    """Way along one log is no way along another."""
    other = [ScanId(1, i) for i in range(5)]
    PLACES.update({scan: Pose2(float(i), 1.0, 0.0) for i, scan in enumerate(other)})
    joining = [link(EVERY[i], other[i], "joined") for i in (0, 4)]
    links = [*CHAIN, *(link(a, b) for a, b in pairwise(other)), *joining]
    whole = replace(whole_of(links, [*EVERY, *other]), scans=(*EVERY, *other))
    assert len(revisits(whole)) == 1
    pairs = list(neighbours(whole.scans))
    assert len(pairs) == 43
    assert all(a.log == b.log for a, b in pairs)


@pytest.mark.parametrize("links", [[], CHAIN])
def test_without_closures_there_is_nothing_to_ask(links):
    """No revisit, and no tie where neighbours hold together."""
    asked = proposed(whole_of(links), beside())
    assert (asked.revisits, asked.ties, asked.others) == ((), (), 0)
