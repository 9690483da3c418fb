"""Which scans hang on a single doubtful step."""

from __future__ import annotations

from itertools import combinations, pairwise

from hypothesis import given
from hypothesis import strategies as st

from segmap.graph import components
from segmap.holding import FIRM, doubtful_steps, weakly_held
from segmap.links import Link
from segmap.pose import Pose2
from segmap.scans import ScanId

SOME = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01))


def link(a: int, b: int, why: str = "accepted") -> Link:
    return Link(ScanId(0, a), ScanId(0, b), Pose2(1.0, 0.0, 0.0), SOME, why, 0.9)


def chain(scans: range) -> list[Link]:
    return [link(a, b) for a, b in pairwise(scans)]


def warned(*links: Link) -> set[int]:
    return {scan.scan for scan in weakly_held(links, components([one.edge for one in links]))}


FIVE, TWO = chain(range(5)), chain(range(10, 12))


def test_what_accepted_links_hold_is_held():
    """Nothing is said of it."""
    assert warned(*FIVE, *TWO, link(4, 10)) == set()


def test_the_smaller_part_hangs_on_the_larger():
    """By one step that neighbours agreed on, however many of them."""
    step = [link(4, 10, "voted"), link(3, 10, "voted"), link(4, 11, "voted")]
    held = weakly_held([*FIVE, *TWO, *step], [[ScanId(0, i) for i in (0, 1, 2, 3, 4, 10, 11)]])
    assert sorted(scan.scan for scan in held) == [10, 11]
    assert set(held.values()) == {
        "2 scans from 0.10 on hang on the rest by a step that no accepted integration bears out."
    }


def test_a_second_way_bears_out_the_first():
    """Where two steps that have no scan in common lead to a part."""
    assert warned(*FIVE, *TWO, link(4, 10, "voted"), link(0, 11, "joined")) == set()
    assert warned(*FIVE, *TWO, link(4, 10, "voted"), link(4, 11, "joined")) == {10, 11}


def test_a_ring_of_doubtful_steps_bears_itself_out():
    """Three parts in a ring: without any one step all are still held together."""
    others = chain(range(20, 23))
    ring = [link(4, 10, "paced"), link(11, 20, "paced"), link(22, 0, "joined")]
    assert warned(*FIVE, *TWO, *others, *ring) == set()
    assert warned(*FIVE, *TWO, *others, *ring[:2]) == {10, 11, 20, 21, 22}


def test_components_have_a_home_each():
    """What holds nothing together is not said to hang on anything."""
    assert warned(*FIVE, *TWO) == set()


@given(
    st.lists(
        st.builds(link, st.integers(0, 5), st.integers(6, 11), st.sampled_from([*FIRM, "voted", "paced", "joined"])),
        max_size=14,
        unique_by=lambda one: one.pair,
    )
)
def test_taking_away_any_step_leaves_what_is_held(links: list[Link]):
    """What is held stays with the largest firm part when one doubtful step is taken away; what is not held does not."""
    wholes = components([one.edge for one in links])
    loose = weakly_held(links, wholes)
    firm = components([one.edge for one in links if one.why in FIRM], [scan for whole in wholes for scan in whole])
    for whole in wholes:
        home = max((part for part in firm if part[0] in whole), key=len)
        torn = set()
        for step in doubtful_steps(links):
            kept = [one.edge for one in links if one not in step]
            (own,) = (part for part in components(kept, whole) if home[0] in part)
            torn |= set(whole) - set(own)
        assert torn == {scan for scan in loose if scan in whole}


def test_steps_share_no_scan():
    """Links with a scan in common are of one step."""
    steps = doubtful_steps([link(0, 1, "voted"), link(1, 2, "voted"), link(3, 4, "paced"), link(2, 3)])
    ends = [{scan for one in step for scan in one.pair} for step in steps]
    assert sorted(map(len, steps)) == [1, 2]
    assert all(a.isdisjoint(b) for a, b in combinations(ends, 2))
