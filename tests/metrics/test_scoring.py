"""All scores of small worlds, by hand; what is empty, short or full of gaps scores without a crash or a NaN."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from perdure.metrics import Score, score
from perdure.metrics.clear import Clear, clear, pair, switches
from perdure.metrics.compared import best_pairs, compare
from perdure.types import Mask, Rows, Status, Tracks, Use

NOBODY = Rows.of(frames=(), ids=())


def person(frames: range, identity: int = 1, x: float = 0.0, use: Use = Use.SCORED) -> Rows:
    count = len(frames)
    return Rows.of(
        frames=list(frames), ids=[identity] * count, boxes=[(x, 0, x + 10, 20)] * count, use=[use] * count
    )


def join(*parts: Rows) -> Rows:
    return Rows.of(
        frames=np.concatenate([one.frames for one in parts]),
        ids=np.concatenate([one.ids for one in parts]),
        boxes=np.concatenate([one.boxes for one in parts]),
        use=np.concatenate([one.use for one in parts]),
        masks=[mask for one in parts for mask in one.masks],
    )


def test_what_is_true_scores_full_marks():
    truth = join(person(range(10)), person(range(3, 8), 2, 50))
    figures = score(truth, truth).figures
    perfect = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1", "IDP", "IDR", "M1", "M2", "M3", "M")
    assert [figures[name] for name in perfect] == pytest.approx([1.0] * len(perfect))
    assert [figures[name] for name in ("FP", "FN", "IDSW", "Frag", "MT", "PT", "ML")] == [0, 0, 0, 0, 2, 0, 0]


def test_a_person_lost_for_two_of_ten_frames_and_found_under_another_name():
    said = join(person(range(5), 7), person(range(7, 10), 8))
    figures = score(said, person(range(10))).figures
    assert figures["FN"] == 2
    assert figures["IDSW"] == 1
    assert figures["Frag"] == 0  # in frames 5 and 6 nobody is said at all: TrackEval leaves such frames out
    assert figures["MOTA"] == pytest.approx(1 - (2 + 1) / 10)
    assert figures["IDR"] == pytest.approx(0.5)
    assert figures["IDP"] == pytest.approx(5 / 8)
    assert figures["PT"] == 1  # 8 of 10 is not more than 80 %


def test_a_break_counts_where_somebody_else_is_still_followed():
    truth = join(person(range(10)), person(range(10), 2, 50))
    said = join(person(range(5), 7), person(range(7, 10), 7), person(range(10), 9, 50))
    assert score(said, truth).figures["Frag"] == 1


def test_a_followed_pair_is_kept_although_another_box_fits_better():
    truth = person(range(4))
    said = join(person(range(4), 7, 2), person(range(2, 4), 8, 0))  # 8 comes later and lies exactly on her
    assert score(said, truth).figures["IDSW"] == 0


def test_flag_0_rows_are_not_asked_for_and_excuse_nothing():
    truth = join(person(range(10)), person(range(10), 2, 50, Use.IGNORED))
    figures = score(join(person(range(10), 7), person(range(10), 8, 50)), truth).figures
    assert (figures["truth_rows"], figures["FP"], figures["excused"]) == (10, 10, 0)


def test_rows_said_on_a_distractor_are_taken_away():
    truth = join(person(range(10)), person(range(10), 2, 50, Use.DISTRACTOR))
    figures = score(join(person(range(10), 7), person(range(10), 8, 50)), truth).figures
    assert (figures["truth_rows"], figures["FP"], figures["excused"], figures["MOTA"]) == (10, 0, 10, 1.0)


def test_of_tracks_lost_rows_groups_and_unsure_hidden_ones_do_not_count():
    tracks = Tracks.of(
        frames=0,
        times=0.0,
        ids=[1, 2, 3, 4],
        boxes=[[0, 0, 10, 20], [50, 0, 60, 20], [90, 0, 99, 20], [0, 0, 60, 20]],
        status=[Status.VISIBLE, Status.LOST, Status.OCCLUDED, Status.VISIBLE],
        confidence=[1, 1, 0.4, 1],
        groups=[4, 0, 0, 0],
    )
    assert score(tracks, person(range(1))).figures["rows"] == 1
    assert score(tracks, person(range(1)), report_confidence=0.3).figures["rows"] == 2


def block(x: int, width: int = 10) -> Mask:
    return Mask(0, x, np.ones((10, width), bool))


def silhouettes(*places: int, use: Use = Use.SCORED) -> Rows:
    return Rows.of(
        frames=[0] * len(places),
        ids=range(1, len(places) + 1),
        masks=[block(x) for x in places],
        use=[use] * len(places),
    )


def test_silhouettes_are_scored_by_the_pixels_they_share():
    figures = score(silhouettes(2), silhouettes(0), masks=True).figures  # 8 of 12 columns
    assert figures["MOTSP"] == pytest.approx(8 / 12)
    assert figures["sMOTSA"] == pytest.approx(8 / 12)
    assert figures["MOTSA"] == 1.0
    assert "MOTA" not in figures


def test_a_silhouette_in_an_ignored_area_is_taken_away_unless_it_is_on_somebody():
    area = Rows.of(frames=[0], ids=[9], masks=[Mask(0, 0, np.ones((20, 60), bool))], use=[Use.REGION])
    truth = join(silhouettes(0), area)
    assert score(silhouettes(0, 30), truth, masks=True).figures["FP"] == 0
    assert score(silhouettes(0, 56), truth, masks=True).figures["FP"] == 1  # less than half of it lies inside
    assert score(silhouettes(0), truth, masks=True).figures["TP"] == 1


def test_masks_of_a_side_that_has_none_are_refused():
    with pytest.raises(ValueError, match="only boxes"):
        score(person(range(2)), silhouettes(0), masks=True)


def test_one_id_twice_in_a_frame_is_refused():
    with pytest.raises(ValueError, match="id 1 stands twice in frame 0"):
        score(join(person(range(1)), person(range(1), 1, 50)), person(range(1)))


@pytest.mark.parametrize("masks", [False, True])
@pytest.mark.parametrize(
    ("said", "truth"),
    [
        (NOBODY, NOBODY),
        (NOBODY, silhouettes(0, 30)),
        (silhouettes(0, 30), NOBODY),
        (silhouettes(0), silhouettes(40)),
        (silhouettes(0), silhouettes(0, use=Use.IGNORED)),
    ],
)
def test_nothing_to_find_or_nothing_said_is_a_score_without_nan(said: Rows, truth: Rows, masks: bool):
    one = score(said, truth, masks=masks)
    together = Score.together([one, one])
    for figures in (one.figures, together.figures):
        assert all(math.isfinite(value) for value in figures.values())
        assert figures["HOTA"] == 0
        assert figures["MOTSA" if masks else "MOTA"] <= 0


def test_an_empty_result_misses_everything():
    figures = score(NOBODY, join(person(range(4)), person(range(2), 2, 50))).figures
    assert (figures["FN"], figures["ML"], figures["LocA"]) == (6, 2, 1.0)


some_rows = some.lists(
    some.tuples(some.sampled_from([0, 1, 5, 900]), some.sampled_from([1, 3, 10**9]), some.integers(0, 6)),
    unique_by=lambda row: row[:2],
    max_size=12,
)


def of(found: list[tuple[int, int, int]]) -> Rows:
    return Rows.of(
        frames=[frame for frame, _, _ in found],
        ids=[identity for _, identity, _ in found],
        boxes=[(4 * x, 0, 4 * x + 10, 10) for _, _, x in found] or None,
    )


@given(some_rows, some_rows)
def test_ids_and_frames_may_have_gaps(said, truth):
    compared = compare(of(said), of(truth))
    figures = score(of(said), of(truth)).figures
    assert all(math.isfinite(value) for value in figures.values())
    assert figures["TP"] + figures["FN"] == len(truth)
    assert figures["TP"] + figures["FP"] == len(said)
    assert figures["MT"] + figures["PT"] + figures["ML"] == len({identity for _, identity, _ in truth})
    assert figures["IDSW"] == len(switches(compared, pair(compared)))
    renumbered = of([(frame // 4, identity % 7, x) for frame, identity, x in said])
    squeezed = of([(frame // 4, identity % 7, x) for frame, identity, x in truth])
    if len({(row[0] // 4) for row in said + truth}) == len({row[0] for row in said + truth}):
        assert score(renumbered, squeezed).figures == pytest.approx(figures)


@given(some_rows, some_rows)
def test_two_sequences_are_together_what_they_are_one_after_the_other(said, truth):
    parts = [score(of(said), of(truth)), score(of(truth), of(said))]
    later = [(frame + 2000, identity + 11, x) for frame, identity, x in said]
    later_truth = [(frame + 2000, identity + 11, x) for frame, identity, x in truth]
    whole = score(of(said + later_truth), of(truth + later)).figures
    together = Score.together(parts).figures
    for name in ("HOTA", "DetA", "AssA", "MOTA", "FP", "FN", "IDSW", "MT", "ML", "M1", "M2", "M3", "tracks_FP"):
        assert together[name] == pytest.approx(whole[name]), name


def test_the_greatest_total_is_paired_and_worthless_pairs_are_not():
    rows, columns = best_pairs(np.array([[0.9, 0.8], [0.8, 0.0], [0.0, 0.0]]))
    assert list(zip(rows, columns, strict=True)) == [(0, 1), (1, 0)]


def test_the_counts_of_clear_add_up():
    one = Clear(truth=4, found=3, wrong=1, switches=1, overlap=2.0)
    assert Clear.together([one, one]).mota == one.mota == pytest.approx(1 / 4)
    assert Clear().mota == 0


def test_clear_takes_tracks_as_they_are():
    rows = Tracks.of(frames=[0, 1], times=[0, 1], ids=[1, 1], boxes=[[0, 0, 9, 9]] * 2)
    assert clear(rows, rows).mota == 1.0
