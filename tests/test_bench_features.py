"""The bench of the features: times every feature of the pool, and compares pairs by themselves with the same result."""

from __future__ import annotations

import features as bench
import numpy as np
import pytest

from perdure.errors import ParameterError
from perdure.features.pool import PAPER, POOL

PICTURE = (200, 240)


@pytest.fixture(scope="module")
def film() -> bench.Film:
    return bench.drawn(3, PICTURE, bench.WARM + 2)


def test_a_drawn_film_has_pictures_and_boxes_of_its_size(film: bench.Film):
    frame, regions = film.seen[-1]
    assert frame.image is not None
    assert frame.image.shape == (240, 200, 3)
    sizes = regions.boxes[:, 2:] - regions.boxes[:, :2]
    assert np.abs(sizes - np.array(bench.SIZE)).max() < 8
    assert bench.drawn(3, PICTURE, 1, pictures=False).seen[0][0].image is None


def test_only_pairs_that_may_be_linked_pass_the_gate(film: bench.Film):
    crowd = bench.drawn(12, (1600, 240), 2, pictures=False)
    before, now = crowd.seen
    pairs = bench.gated(crowd.scene, before, now)
    assert 0 < len(pairs.one) < len(before[1]) * len(now[1])
    apart = before[1].boxes[pairs.one] - now[1].boxes[pairs.other]
    assert np.hypot(apart[:, 0], apart[:, 1]).max() < 120


@pytest.mark.parametrize("name", [name for name in PAPER if name not in ("hog", "displacement_3d")])
def test_a_pair_by_itself_is_as_alike_as_among_all_pairs(name: str, film: bench.Film):
    before, now = film.seen[-2:]
    feature = POOL[name](film.scene)
    (_, mine), (_, theirs) = (feature.describe(feature.start(film.scene), *one) for one in (before, now))
    expected = feature.similarity(mine[:1], theirs[:1], np.array([1 / bench.FPS]))
    pair = bench.cut_out(film.scene, (before[0], before[1].take([0])), (now[0], now[1].take([0])))
    with bench.twins():
        assert bench.alone(POOL[name], pair) == pytest.approx(expected, abs=2e-3)


def test_costs_and_steps_are_laid_out(film: bench.Film):
    cost = bench.cost_of("area", film)
    assert cost.whole == cost.describe + cost.similarity
    assert cost.ratio == pytest.approx(cost.plain / cost.whole)
    table = bench.pool_table([cost])
    assert [row[0] for row in table.rows] == ["area", "the paper's eight"]
    step = bench.timed(film, "defaults", bench.MultiFeature())
    assert step.slowest >= step.ms > 0
    assert step.given.startswith("3 targets, ")
    assert step.given.endswith("200x240, pictures")
    for one in (table, bench.steps_table([step])):
        assert {len(row) for row in one.rows} == {len(one.head)}


@pytest.mark.parametrize(("parts", "frames"), [(["poll"], 20), (["pool"], 3)])
def test_an_unknown_part_or_too_few_frames_are_refused(parts: list[str], frames: int):
    with pytest.raises(ParameterError):
        bench.measure(parts, frames)
