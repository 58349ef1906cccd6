"""What things look like: what of a box is seen, what is remembered of it, and who looks alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.features.appearance import GRID, alike, blended, look, signature
from perdure.types import Mask

RED, GREEN, BLUE, GREY = (200, 20, 20), (20, 180, 20), (20, 20, 220), (120, 120, 120)
DOWN, ACROSS = GRID
BANDS = 3


def picture() -> np.ndarray:
    """48 x 24: red above, blue below, a green column on the left edge.

    g r r r
    g r r r
    g b b b
    g b b b
    """
    image = np.zeros((48, 24, 3), np.uint8)
    image[:24], image[24:], image[:, :6] = RED, BLUE, GREEN
    return image


def dressed(*colours: tuple[int, int, int], seen: float = 1.0) -> np.ndarray:
    """The look of one who wears colours in equal bands from head to foot."""
    whole = np.ones((*GRID, 4), np.float32) * seen
    for rows, colour in zip(np.array_split(np.arange(DOWN), len(colours)), colours, strict=True):
        whole[rows, :, :3] = colour
    return whole


@st.composite
def looks(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    colours = rng.integers(0, 256, (*GRID, 3)) // draw(st.sampled_from([1, 60, 255]))
    seen = rng.choice(
        [0.0, 0.3, 1.0], (*GRID, 1), p=draw(st.sampled_from([(1, 0, 0), (0.9, 0.1, 0), (0, 0.3, 0.7)]))
    )
    seen[: draw(st.integers(0, DOWN))] = 0
    return np.concatenate([colours, seen], axis=2).astype(np.float32)


def test_a_look_has_the_colours_of_the_box_cell_by_cell():
    seen = look(picture(), Mask.empty(), (0, 0, 24, 48))
    assert seen.shape == (*GRID, 4)
    assert seen.dtype == np.float32
    assert (seen[..., 3] == 1).all()
    assert (seen[:, :3, :3] == GREEN).all()
    assert (seen[:12, 3:, :3] == RED).all()
    assert (seen[12:, 3:, :3] == BLUE).all()


def test_a_small_box_is_laid_over_with_the_same_grid():
    seen = look(picture(), Mask.empty(), (5, 23, 7, 25))  # four pixels
    quarters = seen[[0, 0, -1, -1], [0, -1, 0, -1], :3]
    assert quarters.tolist() == [list(GREEN), list(RED), list(GREEN), list(BLUE)]
    assert (seen[..., 3] == 1).all()


def test_a_cell_shows_the_pixel_in_which_its_middle_lies():
    image = np.zeros((48, 24, 3), np.uint8)
    image[..., 0], image[..., 1] = np.arange(48)[:, None], np.arange(24)
    seen = look(image, Mask.empty(), (0, 0, 24, 48))  # a cell is two by two pixels
    assert seen[:, 0, 0].tolist() == list(range(1, 48, 2))
    assert seen[0, :, 1].tolist() == list(range(1, 24, 2))
    shifted = look(image, Mask.empty(), (0.6, 0.4, 12.6, 24.4))  # a cell is as large as a pixel
    assert shifted[:, 0, 0].tolist() == list(range(24))
    assert shifted[0, :, 1].tolist() == list(range(1, 13))


def test_of_a_box_with_a_mask_only_the_mask_is_seen():
    mask = Mask(12, 6, np.ones((24, 6), bool))  # half as high, half as wide as the right part
    seen = look(picture(), mask, (6, 0, 18, 48))
    expected = np.zeros(GRID)
    expected[6:18, :6] = 1
    np.testing.assert_array_equal(seen[..., 3], expected)
    assert (seen[6:12, :6, :3] == RED).all()
    assert (seen[12:18, :6, :3] == BLUE).all()
    assert not seen[expected == 0].any()


def test_of_a_mask_beside_the_box_nothing_is_seen():
    assert not look(picture(), Mask(0, 0, np.ones((4, 4), bool)), (10, 10, 20, 30)).any()
    assert not look(picture(), Mask(10, 10, np.zeros((20, 10), bool)), (10, 10, 20, 30)).any()


@pytest.mark.parametrize(
    ("box", "inside"),
    [
        ((-12, 0, 12, 48), np.s_[:, 6:]),
        ((12, 0, 36, 48), np.s_[:, :6]),
        ((0, -24, 24, 24), np.s_[12:, :]),
        ((0, 24, 24, 72), np.s_[:12, :]),
        ((100, 100, 124, 148), np.s_[:0, :]),
    ],
)
@pytest.mark.parametrize("mask", [Mask.empty(), Mask(-60, -60, np.ones((300, 300), bool))])
def test_what_lies_beyond_the_picture_is_not_seen(box, inside, mask):
    seen = look(picture(), mask, box)
    expected = np.zeros(GRID)
    expected[inside] = 1
    np.testing.assert_array_equal(seen[..., 3], expected)
    assert (seen[expected == 1][:, :3].sum(axis=1) > 0).all()
    assert not seen[expected == 0].any()


def test_what_is_blended_goes_a_share_of_the_way():
    after = blended(dressed(GREY), dressed(RED), 0.25)
    np.testing.assert_allclose(
        after[..., :3], np.broadcast_to(0.75 * np.array(GREY) + 0.25 * np.array(RED), (*GRID, 3))
    )
    assert (after[..., 3] == 1).all()


def test_colours_that_are_not_seen_now_are_kept_and_grow_less_sure():
    hidden = dressed(RED)
    hidden[12:] = 0  # behind a hedge
    after = blended(dressed(GREY), hidden, 0.25)
    assert (after[12:, :, :3] == GREY).all()
    assert (after[12:, :, 3] == 0.75).all()
    assert (after[:12, :, :3] != GREY).all()


def test_colours_seen_for_the_first_time_are_taken_whole():
    hidden = dressed(BLUE)
    hidden[12:] = 0
    after = blended(hidden, dressed(RED), 0.25)
    assert (after[12:, :, :3] == RED).all()
    assert (after[12:, :, 3] == 0.25).all()


def test_of_those_never_seen_the_first_look_is_taken_whole_and_the_others_are_left_alone():
    before = np.stack([np.zeros((*GRID, 4), np.float32), dressed(GREY)])
    now = np.stack([dressed(RED, seen=0.5), dressed(RED)])
    now[0, ..., :3] = RED
    after = blended(before, now, 0.25)
    np.testing.assert_array_equal(after[0], now[0])
    np.testing.assert_array_equal(after[1], blended(before[1], now[1], 0.25))
    assert after.dtype == np.float32


@given(looks())
def test_a_look_blended_with_itself_is_itself(one):
    colours = np.where(one[..., 3:] > 0, one[..., :3], 0)
    one = np.concatenate([colours, one[..., 3:]], axis=2)
    np.testing.assert_allclose(blended(one, one, 0.3), one, rtol=1e-6)


def test_who_wears_the_same_is_alike_and_who_wears_other_colours_is_not():
    one, other = signature(dressed(RED, BLUE, GREY)), signature(dressed(GREEN, RED, BLUE))
    assert one.shape == (BANDS * 6**3,)
    assert alike(one, one) == pytest.approx(1)
    assert alike(one, other) < 0.1


def test_where_a_colour_is_worn_counts():
    upright, upside_down = signature(dressed(RED, GREY, BLUE)), signature(dressed(BLUE, GREY, RED))
    assert alike(upright, upside_down) == pytest.approx(1 / 3, abs=0.05)  # the middle alone


@pytest.mark.parametrize("grey", range(0, 248, 8))
def test_a_little_more_light_makes_little_difference_whatever_the_colour(grey):
    before, after = dressed((grey, grey, grey)), dressed((grey + 8, grey + 8, grey + 8))
    assert alike(signature(before), signature(after)) > 0.7


def test_of_bands_that_only_one_has_nothing_is_said():
    legs_hidden = dressed(RED, BLUE, GREY)
    legs_hidden[16:] = 0
    feet_alone = dressed(RED, BLUE, GREY)
    feet_alone[:16] = 0
    whole = signature(dressed(RED, BLUE, GREEN))
    assert alike(signature(legs_hidden), whole) == pytest.approx(1)  # other trousers are not seen
    assert alike(signature(feet_alone), whole) < 0.1
    assert alike(signature(legs_hidden), signature(feet_alone)) == 0.5  # nothing in common: nobody can say
    assert alike(signature(np.zeros((*GRID, 4), np.float32)), whole) == 0.5


@given(looks())
def test_every_band_seen_adds_up_to_one_and_every_other_to_nothing(one):
    bands = signature(one).reshape(BANDS, -1)
    assert (bands >= 0).all()
    seen = [part[..., 3].sum() > 0 for part in np.array_split(one, BANDS)]
    np.testing.assert_allclose(bands.sum(axis=1), seen, atol=1e-5)


@given(looks(), looks())
def test_alikeness_is_from_nothing_to_one_and_the_same_both_ways(one, other):
    mine, theirs = signature(one), signature(other)
    assert 0 <= alike(mine, theirs) <= 1
    assert alike(mine, theirs) == alike(theirs, mine)
    assert alike(mine, mine) == (pytest.approx(1, abs=1e-5) if one[..., 3].any() else 0.5)


def test_alikeness_is_no_more_than_one_where_rounding_would_have_it_so():
    for seed in range(60):
        weights = np.random.default_rng(seed).random(BANDS * 216).astype(np.float32).reshape(BANDS, -1)
        mine = (weights / weights.sum(axis=1, keepdims=True)).ravel()
        assert alike(mine, mine) <= 1
