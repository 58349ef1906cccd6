"""Settling: corrections that come late are applied to what was said before."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.fold import Corrections, coherent, settle, settle_by_frame
from perdure.types import Dropped, Event, Renamed, Report, Tracks


def said(frame: int, *ids: int, **columns) -> Tracks:
    boxes = [[10 * one, 0, 10 * one + 5, 5] for one in ids]
    return Tracks.of(frames=frame, times=frame / 10, ids=list(ids), boxes=boxes, **columns)


def pairs(tracks: Tracks) -> list[tuple[int, int]]:
    return list(zip(tracks.frames.tolist(), tracks.ids.tolist(), strict=True))


def test_a_name_given_later_holds_for_the_frames_it_names():
    reports = [Report(said(k, 2)) for k in range(4)]
    reports[3] = Report(said(3, 1), renamed=(Renamed(old=2, new=1, begin=1, end=9),))
    assert pairs(settle(reports)) == [(0, 2), (1, 1), (2, 1), (3, 1)]


def test_a_correction_does_not_touch_what_its_own_report_says():
    reports = [Report(said(0, 1, 2)), Report(said(1, 1, 2), renamed=(Renamed(1, 2, 0, 9), Renamed(2, 1, 0, 9)))]
    swapped = settle(reports)
    assert pairs(swapped) == [(0, 1), (0, 2), (1, 1), (1, 2)]
    assert swapped.in_frame(0).boxes[:, 0].tolist() == [20, 10]
    assert swapped.in_frame(1).boxes[:, 0].tolist() == [10, 20]


def test_corrections_of_corrections_are_followed_in_order():
    reports = [
        Report(said(0, 5)),
        Report(renamed=(Renamed(5, 4, 0, 9),)),
        Report(renamed=(Renamed(4, 3, 0, 9),)),
        Report(renamed=(Renamed(5, 9, 0, 9),)),
    ]
    assert pairs(settle(reports)) == [(0, 3)]


def test_dropped_rows_are_gone_and_only_those():
    reports = [Report(said(k, 1, 2)) for k in range(3)] + [Report(dropped=(Dropped(id=2, begin=0, end=1),))]
    assert pairs(settle(reports)) == [(0, 1), (1, 1), (2, 1), (2, 2)]


def test_rows_said_late_find_their_frame():
    late = Tracks.join([said(0, 7), said(1, 7), said(2, 7)])
    assert pairs(settle([Report(said(0, 1)), Report(), Report(late)])) == [(0, 1), (0, 7), (1, 7), (2, 7)]


def test_of_two_rows_of_one_id_the_one_that_was_seen_stays():
    guess, sight = said(0, 1, inferred=[True], confidence=[0.9]), said(0, 1, inferred=[False], confidence=[0.2])
    for order in ([guess, sight], [sight, guess]):
        settled = settle(Report(rows) for rows in order)
        assert (len(settled), settled.inferred.tolist()) == (1, [False])


def test_a_group_is_renamed_in_its_members_too():
    reports = [Report(said(0, 1, 9, groups=[9, 0])), Report(renamed=(Renamed(9, 4, 0, 0),))]
    settled = settle(reports)
    assert settled.groups.tolist() == [4, 0]
    assert settled.is_group.tolist() == [False, True]


def test_events_bear_the_settled_ids():
    corrections = Corrections.of(
        [Report(events=(Event("merge", 0, 0, (1, 2)),)), Report(renamed=(Renamed(2, 8, 0, 0),))]
    )
    assert corrections.event(Event("merge", 0, 0, (1, 2)), 0).ids == (1, 8)


def test_nothing_said_settles_to_nothing():
    assert len(settle([])) == 0
    assert list(settle_by_frame(lambda: [Report(), Report()])) == []


corrections = st.one_of(
    st.builds(Renamed, st.integers(1, 3), st.integers(1, 3), st.integers(0, 4), st.integers(0, 4)),
    st.builds(Dropped, st.integers(1, 3), st.integers(0, 4), st.integers(0, 4)),
)


@given(
    st.lists(
        st.tuples(st.sets(st.integers(1, 3)), st.lists(corrections, max_size=2), st.integers(0, 2)), max_size=5
    )
)
def test_whatever_is_corrected_one_row_per_frame_and_id_is_left_and_twice_changes_nothing(history):
    reports = []
    for frame, (ids, changes, behind) in enumerate(history):
        reports.append(
            Report(
                said(max(0, frame - behind), *sorted(ids)),
                renamed=tuple(one for one in changes if isinstance(one, Renamed)),
                dropped=tuple(one for one in changes if isinstance(one, Dropped)),
            )
        )
    once = settle(reports)
    assert pairs(once) == sorted(set(pairs(once)))
    assert settle([Report(once)]).equals(once)
    assert np.all(np.isin(once.ids, (1, 2, 3)))


def test_events_do_not_contradict_corrections():
    """Two turns out to be one: one has entered once, and who has no row any more is not lost."""
    reports = [
        Report(said(0, 1), events=(Event("entered", 0, 0, (1,)),)),
        Report(said(1, 2), events=(Event("entered", 1, 1, (2,)),)),
        Report(events=(Event("exchanged", 1, 2, (1, 2, 3)), Event("lost", 2, 2, (4,)), Event("alarm", 2, 2))),
        Report(renamed=(Renamed(2, 1, 0, 9), Renamed(3, 2, 0, 9))),
    ]
    corrections = Corrections.of(reports)
    settled = [corrections.event(one, k) for k, report in enumerate(reports) for one in report.events]
    told = coherent(settled, set(settle(reports).ids.tolist()))
    assert [(one.kind, one.ids) for one in told] == [("entered", (1,)), ("exchanged", (1, 2)), ("alarm", ())]


def test_of_several_of_whom_one_is_left_nothing_has_happened():
    reports = [Report(said(0, 1, 2, 3)), Report(renamed=(Renamed(2, 1, 0, 9),), dropped=(Dropped(3, 0, 9),))]
    corrections = Corrections.of(reports)
    assert corrections.event(Event("meets", 0, 0, (1, 2)), 0).ids == ()
    assert corrections.event(Event("meets", 0, 0, (1, 3)), 0).ids == ()
    assert corrections.event(Event("merge", 0, 0, (1, 2, 3, 4)), 0).ids == (1, 4)
    assert corrections.event(Event("stops", 0, 0, (2,)), 0).ids == (1,)
