"""J and F of silhouettes: worked by hand, and against whole pictures and every assignment."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.errors import FormatError
from perdure.metrics.boundary import DavisScore, jaccard_and_boundary
from perdure.types import Mask, Rows, Use

SIZE = (100, 75)  # its diagonal is 125 pixels, so the tolerance is 1


def square(y: int, x: int, side: int = 10) -> Mask:
    return Mask(y, x, np.ones((side, side), bool))


def rows(*said: tuple[int, int, Mask], size: tuple[int, int] = SIZE, use: Use = Use.SCORED) -> Rows:
    frames, ids, masks = zip(*said, strict=True) if said else ((), (), ())
    return Rows.of(frames=frames, ids=ids, masks=masks, size=size, use=[use] * len(ids))


def joined(one: Rows, other: Rows) -> Rows:
    columns = {name: [*getattr(one, name), *getattr(other, name)] for name in ("frames", "ids", "use", "masks")}
    return Rows.of(**columns, size=one.size)


def test_the_truth_itself_is_perfect_under_any_ids():
    truth = rows((0, 1, square(10, 10)), (0, 2, square(10, 40)), (1, 1, square(12, 10)))
    said = truth.replace(ids=np.array([8, 7, 8]))
    score = jaccard_and_boundary(said, truth)
    assert (score.objects, score.j, score.f, score.jf) == (2, 1.0, 1.0, 1.0)


def test_a_square_beside_the_true_one_by_a_pixel_has_its_whole_contour_near():
    score = jaccard_and_boundary(rows((0, 1, square(10, 11))), rows((0, 1, square(10, 10))))
    assert score.j == pytest.approx(90 / 110)
    assert score.f == 1.0


def test_a_square_beside_the_true_one_by_three_pixels_keeps_what_lies_on_the_same_lines():
    # Of the 40 contour pixels, each horizontal side has 11 with the corners: 8 lie on the true one, and 1 beside
    # its end is near; of the 9 others of the side that is inside, the 2 at its ends touch the true horizontal ones.
    score = jaccard_and_boundary(rows((0, 1, square(10, 13))), rows((0, 1, square(10, 10))))
    assert score.j == pytest.approx(70 / 130)
    assert score.f == pytest.approx((2 * 9 + 2) / 40)


def test_a_frame_with_nothing_to_find_and_nothing_said_is_right():
    truth, said = rows((0, 1, square(10, 10))), rows((1, 1, square(10, 10)))
    assert jaccard_and_boundary(said, truth, range(5)).j_by_object.tolist() == [3 / 5]
    assert jaccard_and_boundary(said, truth, range(5)).f_by_object.tolist() == [3 / 5]


def test_an_object_that_nobody_follows_is_right_only_where_it_is_not():
    truth = rows((0, 1, square(10, 10)), (0, 2, square(10, 40)))
    score = jaccard_and_boundary(rows((0, 9, square(10, 40))), truth, range(4))
    assert score.j_by_object.tolist() == [3 / 4, 1.0]
    assert jaccard_and_boundary(rows(), truth, range(4)).jf == 3 / 4


def test_the_ids_are_assigned_once_for_the_whole_film():
    truth = rows(*((frame, identity, square(10, 30 * identity)) for frame in range(4) for identity in (1, 2)))
    said = truth.replace(ids=np.array([1, 2, 2, 1, 2, 1, 2, 1]))  # swapped after the first frame
    assert jaccard_and_boundary(said, truth).j_by_object.tolist() == [3 / 4, 3 / 4]


def test_objects_said_beyond_those_of_the_truth_cost_nothing():
    truth = rows((0, 1, square(10, 10)))
    assert jaccard_and_boundary(rows((0, 1, square(10, 10)), (0, 2, square(50, 10))), truth).jf == 1.0


def test_what_lies_in_an_area_that_is_no_object_does_not_count():
    truth = joined(rows((0, 1, square(10, 10))), rows((0, 255, square(10, 20)), use=Use.REGION))
    wide = Mask(10, 10, np.ones((10, 15), bool))
    assert jaccard_and_boundary(rows((0, 1, wide)), truth).jf == 1.0


def test_the_rim_of_the_picture_is_no_contour():
    whole = Mask(0, 0, np.ones(SIZE, bool))
    score = jaccard_and_boundary(rows((0, 1, Mask.empty())), rows((0, 1, whole)))
    assert (score.j, score.f) == (0.0, 1.0)


@pytest.mark.parametrize(("said", "mean"), [(rows(), 1.0), (rows((0, 1, square(0, 0))), 0.0)])
def test_without_an_object_it_is_right_to_say_nothing(said: Rows, mean: float):
    for truth in (rows(), Rows.of(frames=[], ids=[])):
        score = jaccard_and_boundary(said, truth, range(3))
        assert (score.objects, score.j, score.f, len(score.j_by_object)) == (0, mean, mean, 0)
    assert jaccard_and_boundary(Rows.of(frames=[], ids=[]), Rows.of(frames=[], ids=[])).jf == 1.0


def test_several_films_count_by_their_objects():
    one = jaccard_and_boundary(rows(), rows((0, 1, square(10, 10)), (0, 2, square(10, 40))))
    other = jaccard_and_boundary(rows((0, 1, square(10, 10))), rows((0, 1, square(10, 10))))
    both = DavisScore.together([one, other])
    assert (both.objects, both.j, both.f) == (3, pytest.approx(1 / 3), pytest.approx(1 / 3))
    assert DavisScore.together([]).jf == 1.0


def test_pictures_of_different_sizes_are_refused():
    with pytest.raises(FormatError, match=r"result's pictures are 75x100, the truth's 60x50"):
        jaccard_and_boundary(rows((0, 1, square(0, 0))), rows((0, 1, square(0, 0)), size=(50, 60)))


def test_rows_without_silhouettes_or_a_size_are_refused():
    boxes = Rows.of(frames=[0], ids=[1], boxes=[[0, 0, 9, 9]], size=SIZE)
    with pytest.raises(ValueError, match="no masks"):
        jaccard_and_boundary(boxes, rows((0, 1, square(0, 0))))
    bare = rows((0, 1, square(0, 0))).replace(size=None)
    with pytest.raises(ValueError, match="size"):
        jaccard_and_boundary(bare, bare)


def disc(x: int, y: int, radius: int) -> Mask:
    rows, columns = np.ogrid[:90, :120]
    return Mask.of_image((rows - y) ** 2 + (columns - x) ** 2 <= radius**2)


def rolling_discs() -> tuple[Rows, Rows]:
    """Three discs that roll past each other, and what a poor tracker made of them: moved, shrunk, lost, swapped."""
    truth, said = [], []
    for frame in range(24):
        places = [(10 + 4 * frame, 40, 12), (110 - 4 * frame, 50, 9), (60, 3 * frame, 15)]
        for one, (x, y, radius) in enumerate(places, 1):
            if frame > 3 or one != 2:
                truth.append((frame, one, disc(x, y, radius)))
            if (frame + one) % 7:
                name = 40 + (one if frame < 15 else (2, 1, 3)[one - 1])
                said.append((frame, name, disc(x + frame % 5 - 2, y + one - 2, radius - (frame + one) % 3)))
    return rows(*said, size=(90, 120)), rows(*truth, size=(90, 120))


def test_the_figures_are_those_of_trackeval():
    """TrackEval 1.3.0, `JAndF` with `optim_type = 'J&F'`, over these 24 frames."""
    score = jaccard_and_boundary(*rolling_discs(), range(24))
    assert (score.objects, score.j, score.f) == (
        3,
        pytest.approx(0.4770939213906706),
        pytest.approx(0.5029569876281609),
    )


@st.composite
def films(draw):
    height, width = draw(st.integers(1, 9)), draw(st.integers(1, 9))

    def side(most: int) -> Rows:
        said = []
        for frame, identity in itertools.product(range(2), range(draw(st.integers(0, most)))):
            bits = draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
            said.append((frame, identity, Mask.of_image(np.array(bits).reshape(height, width))))
        return rows(*said, size=(height, width))

    return side(3), side(2)


@settings(deadline=None)
@given(films())
def test_the_score_is_that_of_whole_pictures_under_the_best_of_all_assignments(film: tuple[Rows, Rows]):
    said, truth = film
    score = jaccard_and_boundary(said, truth, range(2))
    objects = np.unique(truth.ids).tolist()
    names = np.unique(said.ids).tolist() + [-1] * max(0, len(objects) - len(np.unique(said.ids)))
    best = max(
        math.fsum(slow_jf(said, truth, name, one) for one, name in zip(objects, chosen, strict=True))
        for chosen in itertools.permutations(names, len(objects))
    )
    assert score.jf * len(objects) == pytest.approx(best) or not objects


def slow_jf(said: Rows, truth: Rows, name: int, one: int) -> float:
    """J and F over two frames, pixel by pixel."""
    found = []
    for frame in range(2):
        true, ours = picture(truth, frame, one), picture(said, frame, name)
        union = (true | ours).sum()
        j = (true & ours).sum() / union if union else 1.0
        precision, recall = near_share(contour(ours), contour(true)), near_share(contour(true), contour(ours))
        f = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
        found.append((j + f) / 2)
    return float(np.mean(found))


def picture(side: Rows, frame: int, identity: int) -> np.ndarray:
    here = [m for m, f, i in zip(side.masks, side.frames, side.ids, strict=True) if (f, i) == (frame, identity)]
    return here[0].to_image(*side.size) if here else np.zeros(side.size or SIZE, bool)


def contour(picture: np.ndarray) -> list[tuple[int, int]]:
    height, width = picture.shape

    def differs(y: int, x: int) -> bool:
        around = [(y + 1, x), (y, x + 1), (y + 1, x + 1)]
        return any(picture[min(b, height - 1), min(a, width - 1)] != picture[y, x] for b, a in around)

    return [(y, x) for y in range(height) for x in range(width) if differs(y, x)]


def near_share(points: list[tuple[int, int]], others: list[tuple[int, int]]) -> float:
    """Which share lies within a pixel of the others; 1 of none."""
    close = [any((y - b) ** 2 + (x - a) ** 2 <= 1 for b, a in others) for y, x in points]
    return sum(close) / len(close) if close else 1.0
