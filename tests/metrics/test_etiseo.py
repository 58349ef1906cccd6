"""ETISEO by hand: ten frames, people on fixed places; each film strip names who is said to stand there.

A letter is a said id, a dot nobody; a strip shorter than the person's life ends it. `A` is the first letter.
"""

from __future__ import annotations

import numpy as np
import pytest

from perdure.metrics.compared import compare
from perdure.metrics.etiseo import Etiseo, etiseo
from perdure.types import Rows


def rows(strips: list[str]) -> Rows:
    """A row for every letter; strip k stands 100 pixels further to the right than strip k - 1."""
    found = [
        (frame, ord(letter), 100 * place)
        for place, strip in enumerate(strips)
        for frame, letter in enumerate(strip)
        if letter != "."
    ]
    return Rows.of(
        frames=[frame for frame, _, _ in found],
        ids=[identity for _, identity, _ in found],
        boxes=[(x, 0, x + 10, 20) for _, _, x in found] or None,
    )


def scored(truth: list[str], said: list[str]) -> Etiseo:
    return etiseo(compare(rows(said), rows(truth)))


def test_two_people_followed_by_one_id_each():
    score = scored(["1111111111", "2222222222"], ["aaaaaaaaaa", "bbbbbbbbbb"])
    assert (score.m1, score.m2, score.m3, score.mean) == (1, 1, 1, 1)
    assert (score.tracked, score.lost, score.noisy) == (2, 0, 0)


def test_a_person_followed_by_two_ids_one_after_the_other():
    # matched most by a, in 6 of her 10 frames; two ids were hers; each id was hers alone
    score = scored(["1111111111"], ["aaaaaabbbb"])
    assert (score.m1, score.m2, score.m3) == pytest.approx((0.6, 0.5, 1.0))
    assert score.mean == pytest.approx(0.7)
    assert (score.tracked, score.lost, score.noisy) == (1, 0, 0)


def test_two_people_who_exchange_their_ids():
    # each is matched most for 7 of 10 frames, each has two ids, each id has two people
    score = scored(["1111111111", "2222222222"], ["aaaaaaabbb", "bbbbbbbaaa"])
    assert (score.m1, score.m2, score.m3) == pytest.approx((0.7, 0.5, 0.5))


def test_a_person_who_is_never_found_has_no_time_and_no_persistence():
    score = scored(["1111111111", "2222222222"], ["aaaaaaaa..", ".........."])
    assert (score.m1, score.m2, score.m3) == pytest.approx((0.4, 0.5, 1.0))
    assert (score.tracked, score.lost, score.noisy) == (1, 1, 0)


def test_a_person_followed_for_just_half_of_his_life_is_lost():
    assert scored(["1111111111"], ["aaaaa....."]).lost == 1
    assert scored(["1111111111"], ["aaaaaa...."]).tracked == 1


def test_an_id_on_nothing_is_noise_and_confuses_nobody():
    score = scored(["1111111111", ""], ["aaaaaaaaaa", "bbb"])
    assert (score.m3, score.noisy) == (1.0, 1)


def test_an_id_that_is_on_somebody_for_most_of_its_life_is_no_noise():
    score = scored(["111111", ""], ["aaaaaa", "......aaaaa"])
    assert score.noisy == 0
    assert scored(["11111", ""], ["aaaaa", ".....aaaaa"]).noisy == 1  # half is not most


def test_one_id_over_three_people_one_after_the_other():
    score = scored(["1111", "....2222", "........3333"], ["aaaa", "....aaaa", "........aaaa"])
    assert (score.m1, score.m2) == (1.0, 1.0)
    assert score.m3 == pytest.approx(1 / 3)


def test_a_reference_is_matched_to_at_most_one_of_two_said_boxes():
    # b lies 3 pixels beside a: Dice .7 with the person, but she is a's
    truth, beside = rows(["1111"]), rows(["bbbb"])
    both = Rows.of(
        frames=np.tile(np.arange(4), 2),
        ids=[97] * 4 + [98] * 4,
        boxes=np.concatenate([truth.boxes, np.add(beside.boxes, (3, 0, 3, 0))]),
    )
    score = etiseo(compare(both, truth))
    assert (score.m1, score.m2, score.m3, score.noisy) == (1, 1, 1, 1)


@pytest.mark.parametrize(("shift", "found"), [(4.9, True), (5.0, True), (5.1, False)])
def test_boxes_match_from_a_dice_of_one_half(shift: float, found: bool):
    truth = rows(["1"])  # 10 wide: moved by 5, half of each is shared
    said = truth.replace(boxes=np.add(truth.boxes, (shift, 0, shift, 0)))
    assert etiseo(compare(said, truth)).m1 == found


def test_several_sequences_count_every_object_once():
    one = scored(["1111111111"], ["aaaaaabbbb"])
    three = scored(["1111", "2222", "3333"], ["aaaa", "bbbb", "cccc"])
    score = Etiseo.together([one, three])
    assert score.m1 == pytest.approx((0.6 + 3) / 4)
    assert score.m2 == pytest.approx((0.5 + 3) / 4)
    assert score.m3 == pytest.approx(1.0)
    assert score.tracked == 4


@pytest.mark.parametrize(("truth", "said"), [([], []), (["1111"], []), ([], ["aaaa"])])
def test_nothing_on_a_side_scores_nothing(truth: list[str], said: list[str]):
    score = scored(truth, said)
    assert (score.m1, score.m2, score.m3, score.mean) == (0, 0, 0, 0)
    assert (score.lost, score.noisy) == (len(truth), len(said))
