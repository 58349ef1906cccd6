"""Meetings: what a tracker told of them, and who came out of them under which name."""

from __future__ import annotations

import numpy as np
import pytest
from test_etiseo import rows

from perdure.metrics.clear import pair
from perdure.metrics.compared import compare
from perdure.metrics.events import (
    EventScore,
    Identities,
    Merge,
    Tally,
    came_back,
    merges_of,
    score_blobs,
    score_events,
)
from perdure.metrics.mistakes import mistakes
from perdure.types import Event, Tracks

MEETING = (Event("merge", 10, 10, (49, 50)), Event("split", 16, 16, (49, 50)))
TRUTH = ["1" * 30, "2" * 30]  # ids 49 and 50, on two places of their own
KEPT = ["a" * 30, "b" * 30]  # ids 97 and 98
SWAPPED = ["a" * 10 + "......" + "b" * 14, "b" * 10 + "......" + "a" * 14]


def identities(said: list[str], truth: list[str] = TRUTH) -> Identities:
    compared = compare(rows(said), rows(truth))
    return Identities(compared, pair(compared))


def told(*events: Event, truth: tuple[Event, ...] = MEETING, said: list[str] = KEPT) -> EventScore:
    return score_events(events, truth, identities(said))


@pytest.mark.parametrize(("frame", "right"), [(5, 1), (10, 1), (15, 1), (4, 0), (16, 0)])
def test_a_merge_may_be_told_five_frames_early_or_late(frame: int, right: int):
    assert told(Event("merge", frame, frame, (97, 98))).merges == Tally(1, 1, right, right)


def test_a_merge_of_other_people_is_not_that_merge():
    three = [*TRUTH, "3" * 30]
    score = score_events([Event("merge", 10, 10, (97, 99))], MEETING, identities([*KEPT, "c" * 30], three))
    assert score.merges == Tally(1, 1, 0, 0)


def test_a_merge_told_twice_is_right_once():
    score = told(Event("merge", 9, 9, (97, 98)), Event("merge", 11, 11, (97, 98)))
    assert score.merges == Tally(true=1, said=2, found=1, right=1)
    assert score.merges.precision == 0.5


def test_one_event_of_three_people_stands_for_its_pairs():
    truth = (Event("merge", 10, 10, (49, 50)), Event("merge", 11, 11, (50, 51)))
    three = identities([*KEPT, "c" * 30], [*TRUTH, "3" * 30])
    score = score_events([Event("merge", 10, 10, (97, 98, 99))], truth, three)
    assert score.merges == Tally(true=2, said=1, found=2, right=1)


def test_a_true_event_of_three_people_is_its_pairs_too():
    three = identities([*KEPT, "c" * 30], [*TRUTH, "3" * 30])
    truth = (Event("merge", 10, 10, (49, 50, 51)),)
    assert score_events([Event("merge", 10, 10, (97, 98, 99))], truth, three).merges == Tally(3, 1, 3, 1)
    assert score_events([Event("merge", 10, 10, (97, 98))], truth, three).merges == Tally(3, 1, 1, 1)


def test_splits_and_total_occlusions_are_told_by_their_own_kinds():
    truth = (*MEETING, Event("full_occlusion", 20, 25, (49,)))
    score = told(Event("split", 17, 17, (97, 98)), Event("occluded", 20, 25, (97,)), truth=truth)
    assert score.splits == Tally(1, 1, 1, 1)
    assert score.occlusions == Tally(1, 1, 1, 1)
    assert score.merges == Tally(1, 0, 0, 0)
    assert score.merges.precision is None


def test_a_result_without_events_is_not_charged_with_them():
    score = score_events(None, MEETING, identities(KEPT))
    assert score.merges == Tally()
    assert (score.judged, score.returned) == (1, 1)


@pytest.mark.parametrize(
    ("said", "back"),
    [
        (KEPT, True),
        (SWAPPED, False),
        (["a" * 10 + "......" + "c" * 14, "b" * 30], False),
        (["a" * 10 + "." * 20, "b" * 30], False),  # never found again
        (["." * 16 + "a" * 14, "b" * 30], False),  # not found before
        (["a" * 10 + "......" + "c" + "a" * 13, "b" * 30], True),  # a moment's doubt is forgiven
    ],
)
def test_everybody_has_to_come_out_of_a_merge_under_the_old_name(said: list[str], back: bool):
    assert came_back(merges_of(MEETING)[0], merges_of(MEETING), identities(said)) is back


def test_who_is_never_free_again_is_not_judged():
    for_ever = (Event("merge", 10, 10, (49, 50)),)
    assert merges_of(for_ever) == [Merge((49, 50), 10, 2**62)]
    assert came_back(merges_of(for_ever)[0], merges_of(for_ever), identities(KEPT)) is None


def test_names_are_compared_where_a_person_stands_free_of_all_merges():
    truth = (*MEETING, Event("merge", 14, 14, (49, 51)), Event("split", 20, 20, (49, 51)))
    # 49 leaves the first merge at 16 but stays in the second up to 20: what is said of her until then is forgiven
    said = ["a" * 10 + "zzzzzzzzzz" + "a" * 10, "b" * 30]
    assert came_back(merges_of(truth)[0], merges_of(truth), identities(said)) is True


def blob(frame: int, ids: tuple[int, ...], *, groups: int = 0, region: int | None = None) -> Tracks:
    count = len(ids)
    return Tracks.of(
        frames=frame,
        times=0.0,
        ids=ids,
        boxes=np.zeros((count, 4)),
        groups=[groups] * count,
        links=[()] * count if region is None else [(region,)] * count,
    )


@pytest.mark.parametrize("together", [{"groups": 7}, {"region": 0}])
def test_who_shares_a_group_or_a_region_is_said_to_share_a_blob(together: dict):
    said = Tracks.join([blob(10, (97, 98), **together), blob(11, (97, 98), **together), blob(12, (97, 98))])
    blobs = {
        10: [frozenset({49, 50})],
        11: [frozenset({49}), frozenset({50})],
        12: [frozenset({49, 50})],
    }
    assert score_blobs(said, blobs, identities(KEPT)) == Tally(true=2, said=2, found=1, right=1)


def test_a_group_row_is_nobody_in_the_blob():
    said = Tracks.join([blob(10, (97, 98), groups=7), blob(10, (7,), region=0)])
    assert score_blobs(said, {10: [frozenset({49, 50})]}, identities(KEPT)) == Tally(1, 1, 1, 1)


# Mistakes ---------------------------------------------------------------------------------------------------


def faults(said: list[str], truth: list[str] = TRUTH, merges: tuple[Merge, ...] = ()) -> list[tuple]:
    compared = compare(rows(said), rows(truth))
    return [(one.kind, one.begin, one.end, one.cost) for one in mistakes(compared, pair(compared), merges)]


def test_no_mistake_is_an_empty_list():
    assert faults(KEPT) == []


def test_two_switches_that_swap_a_pair_are_one_exchange():
    assert faults(SWAPPED)[0] == ("exchange", 16, 16, 20)
    assert [kind for kind, *_ in faults(SWAPPED)] == ["exchange", "lost", "lost"]


def test_a_switch_costs_the_shorter_of_the_two_runs():
    assert faults(["a" * 26 + "c" * 4, "b" * 30]) == [("switch", 26, 26, 4)]
    assert faults(["a" * 3 + "c" * 27, "b" * 30]) == [("switch", 3, 3, 3)]


def test_stretches_lost_and_invented_stand_worst_first():
    found = faults(["a" * 5 + "." * 20 + "a" * 5, "b" * 30, "c" * 7])
    assert found == [("lost", 5, 24, 20), ("invented", 0, 6, 7)]


def test_a_wrong_resolution_is_told_with_its_merge():
    found = faults(SWAPPED, merges=tuple(merges_of(MEETING)))
    assert ("resolution", 10, 16, 14) in found
    compared = compare(rows(SWAPPED), rows(TRUTH))
    (text,) = (
        one.text for one in mistakes(compared, pair(compared), merges_of(MEETING)) if one.kind == "resolution"
    )
    assert text == "after the merge of 49 and 50 up to frame 16: 49 was 97 and is 98, 50 was 98 and is 97"
    assert "resolution" not in [kind for kind, *_ in faults(KEPT, merges=tuple(merges_of(MEETING)))]


def test_a_lost_person_beside_a_box_that_almost_fits_is_told_so():
    truth = rows(["1" * 4])
    said = truth.replace(ids=np.full(4, 9), boxes=np.add(truth.boxes, (4, 0, 4, 0)))  # IoU 6 / 14
    compared = compare(said, truth)
    texts = [one.text for one in mistakes(compared, pair(compared))]
    assert "object 49 was never found; at best 0.43 overlap with id 9" in texts
    assert "id 9 matches nothing in all its 4 frames; at best 0.43 overlap with object 49" in texts
