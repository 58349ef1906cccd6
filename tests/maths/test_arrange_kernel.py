"""Where things lie in the silhouette they have in common: the kernel against its twin, and small scenes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.arrange import OUTSIDE, UNKNOWN, WITHIN, arrange, arrange_twin

MARKS = {".": OUTSIDE, "#": WITHIN, "?": UNKNOWN}
COLOURS = {"r": (200, 0, 0), "b": (0, 0, 200), ".": (90, 90, 90)}
NO_PICTURE = np.zeros((0, 0, 3), np.float32)
PULL, CONTRAST = 0.01, 100.0


def drawn(scene: str) -> np.ndarray:
    return np.array([[MARKS[mark] for mark in row] for row in scene.split()], np.uint8)


def painted(scene: str) -> np.ndarray:
    return np.array([[COLOURS[mark] for mark in row] for row in scene.split()], np.float32)


def arranged(
    scene: str,
    sizes: list[tuple[int, int]],
    corners: list[tuple[int, int]],
    *,
    reach: int = 3,
    picture: np.ndarray = NO_PICTURE,
    wearing: str = "..",
    pull: float = PULL,
    colour: float = 1.0,
    gains: np.ndarray | None = None,
) -> list[tuple[int, int]]:
    """Where forms of sizes and places expected (rows, columns), whole and in one colour each, are put."""
    extents = np.array(sizes, np.int64)
    forms = np.zeros((len(sizes), *extents.max(axis=0), 4), np.float32)
    for form, (height, width), worn in zip(forms, sizes, wearing[: len(sizes)], strict=True):
        form[:height, :width] = (*COLOURS[worn], 1)
    gains = np.zeros(len(sizes)) if gains is None else gains
    around, expected = np.full_like(extents, reach), np.array(corners, np.int64)
    places = arrange(drawn(scene), picture, forms, extents, expected, around, pull, colour, CONTRAST, gains)
    return [(y, x) for y, x in places.tolist()]


@st.composite
def worlds(draw):
    """All that `arrange` is given but the gains; shares in 64ths, so that sums have no rounding."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape, count, largest = rng.integers(1, 8, 2), draw(st.integers(0, 3)), rng.integers(1, 4, 2)
    support = rng.choice(np.array([OUTSIDE, WITHIN, WITHIN, UNKNOWN], np.uint8), shape)
    picture = rng.integers(0, 256, (*shape, 3)).astype(np.float32) if draw(st.booleans()) else NO_PICTURE
    colours = rng.integers(0, 256, (count, *largest, 3))
    shares = rng.choice([0, 1 / 64, 1 / 8, 1 / 2, 1], (count, *largest, 1))
    forms = np.concatenate([colours, shares], axis=3).astype(np.float32)
    extents = rng.integers(1, largest + 1, (count, 2))
    corners = rng.integers(-2, shape + 2, (count, 2))
    reach = rng.integers(0, 3, (count, 2))
    contrast = draw(st.sampled_from([30.0, 150.0]))
    return support, picture, forms, extents, corners, reach, draw(st.sampled_from([0.0, 0.3])), 1.5, contrast


@given(worlds())
def test_the_kernel_puts_forms_where_its_twin_does(world):
    before = [part.copy() for part in world[:6]]
    gains, twins = np.zeros((2, len(world[3])))
    np.testing.assert_array_equal(arrange(*world, gains), arrange_twin(*world, twins))
    np.testing.assert_allclose(gains, twins, atol=1e-6)
    for part, was in zip(world[:6], before, strict=True):
        np.testing.assert_array_equal(part, was)  # what is given is not changed


@given(worlds())
def test_nobody_moves_farther_than_the_reach(world):
    corners, reach = world[4], world[5]
    placed = arrange(*world, np.zeros(len(corners)))
    assert (np.abs(placed - corners) <= reach).all()


@given(st.integers(0, 2**32 - 1))
def test_one_form_is_put_where_most_of_it_is_within(seed):
    rng = np.random.default_rng(seed)
    support = rng.choice(np.array([OUTSIDE, WITHIN], np.uint8), (7, 7))
    whole, gains = np.ones((1, 3, 2, 4), np.float32), np.zeros(1)
    three, two, extents = np.array([[2, 2]]), np.array([[2, 2]]), np.array([[3, 2]])
    ((y, x),) = arrange(support, NO_PICTURE, whole, extents, two, three, 0.0, 1.0, CONTRAST, gains)
    counted = {(a, b): support[a : a + 3, b : b + 2].sum() for a in range(5) for b in range(5)}  # 1 where within
    assert counted[y, x] == max(counted.values())
    assert gains[0] == pytest.approx((2 * counted[y, x] - 6) / 6)  # those within less those outside


def test_two_expected_at_one_place_are_put_side_by_side_in_a_wide_silhouette():
    scene = """
    ........
    .######.
    .######.
    .######.
    ........
    """
    gains = np.zeros(2)
    assert sorted(arranged(scene, [(3, 3), (3, 3)], [(1, 2), (1, 3)], gains=gains)) == [(1, 1), (1, 4)]
    way = 1 / 9  # squared, of one cell in three
    np.testing.assert_allclose(gains, 1 - PULL * way)


def test_two_of_unlike_height_fill_an_l_shaped_silhouette():
    scene = """
    ......
    .##...
    .##...
    .####.
    .####.
    ......
    """
    assert arranged(scene, [(4, 2), (2, 2)], [(0, 2), (2, 2)]) == [(1, 1), (3, 3)]


def test_the_same_two_stay_on_each_other_where_there_is_no_room_beside():
    scene = """
    ......
    ..##..
    ..##..
    ......
    """
    assert arranged(scene, [(2, 2), (2, 2)], [(1, 2), (1, 2)], reach=1) == [(1, 2), (1, 2)]


@pytest.mark.parametrize(("wearing", "places"), [("rb", [(1, 1), (1, 4)]), ("br", [(1, 4), (1, 1)])])
def test_colours_decide_who_stands_where(wearing, places):
    scene = """
    ........
    .######.
    .######.
    ........
    """
    picture = painted("........ .rrrbbb. .rrrbbb. ........")
    assert arranged(scene, [(2, 3), (2, 3)], [(1, 2), (1, 3)], picture=picture, wearing=wearing) == places


def test_another_s_colours_speak_against_one_unless_the_other_stands_there():
    scene, picture, gains = "###", painted("bbb"), np.zeros(2)
    arranged(scene, [(1, 3)], [(0, 0)], reach=0, picture=picture, wearing="r", colour=2.0, gains=gains[:1])
    assert gains[0] == pytest.approx(1 - 2)
    arranged(scene, [(1, 3)] * 2, [(0, 0)] * 2, reach=0, picture=picture, wearing="rb", colour=2.0, gains=gains)
    np.testing.assert_allclose(gains, [0, 2])  # hidden behind the other, she is not refuted


def test_beyond_the_picture_nothing_is_gained_or_lost():
    gains = np.zeros(1)
    assert arranged("???###", [(1, 4)], [(0, 2)], reach=0, gains=gains) == [(0, 2)]
    np.testing.assert_allclose(gains, 3 / 4)
    arranged("...###", [(1, 4)], [(0, 2)], reach=0, gains=gains)
    np.testing.assert_allclose(gains, 2 / 4)
    arranged("###", [(1, 4)], [(0, -1)], reach=0, gains=gains)  # the array's border is known to be outside
    np.testing.assert_allclose(gains, 2 / 4)


def test_one_walks_half_out_of_the_picture_rather_than_onto_the_ground():
    assert arranged("??#..", [(1, 3)], [(0, 1)], reach=1) == [(0, 0)]
    assert arranged("...#.", [(1, 3)], [(0, 1)], reach=1) == [(0, 1)]


def test_one_stays_where_expected_if_nothing_speaks_for_another_place():
    everywhere = "#########\n" * 9
    assert arranged(everywhere, [(2, 2)], [(3, 4)]) == [(3, 4)]
    assert arranged(everywhere.replace("#", "."), [(2, 2)], [(3, 4)]) == [(3, 4)]


def test_the_way_costs_so_that_a_far_place_needs_a_good_reason():
    scene = "...####..."
    assert arranged(scene, [(1, 4)], [(0, 0)], pull=0.01) == [(0, 3)]
    assert arranged(scene, [(1, 4)], [(0, 0)], pull=9.0) == [(0, 0)]


def test_no_forms_need_no_place():
    nothing, none = np.zeros((0, 1, 1, 4), np.float32), np.zeros((0, 2), np.int64)
    for function in (arrange, arrange_twin):
        placed = function(drawn("##"), NO_PICTURE, nothing, none, none, none, PULL, 1.0, CONTRAST, np.zeros(0))
        assert placed.shape == (0, 2)
