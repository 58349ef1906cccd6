"""Contexts learnt from drawn films: what tells people apart there gets the weight."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.errors import ParameterError
from perdure.features.pool import POOL
from perdure.learn import PAPER, Film, Learning, Samples, context_of, learn, link_similarity
from perdure.types import Frame, Regions, Rows, Scene, Use

SCENE = Scene(200, 120, 10.0)
NAMES = tuple(POOL)


def crossing(k: int) -> list[list[float]]:
    """A tall one going right and a short one going left; they pass one another in frame 10."""
    return [[10 + 8 * k, 20, 30 + 8 * k, 100], [170 - 8 * k, 35, 190 - 8 * k, 85]]


def of(boxes, count: int = 20, ids=(1, 2), use=None, detected=None) -> Film:
    """A film without pictures: `boxes(k)` in each frame; `detected(k)` where a detector says something else."""
    rows = [(k, i, box) for k in range(count) for i, box in zip(ids, boxes(k), strict=True)]
    truth = Rows.of(
        frames=[k for k, _, _ in rows],
        ids=[i for _, i, _ in rows],
        boxes=[box for _, _, box in rows],
        use=None if use is None else [use[i] for _, i, _ in rows],
    )
    seen = [(Frame(k, k / 10), Regions.of(detected(k)) if detected else Regions.empty()) for k in range(count)]
    return Film("film", seen, truth, SCENE, detected is not None)


def test_shape_tells_apart_those_who_pass_one_another():
    found = learn([of(crossing)], Learning(gap=0.0, carried=0.0), "crossing")
    context = found.context
    assert (context.name, context.training.sources) == ("crossing", ("film",))
    assert context.training.alone["area"].error == 0.0  # 50 over 80 for two, 1 for one
    assert context.training.same == 2 * 19
    assert context.weights == {"shape_ratio": 1.0}  # which never errs either, and comes first
    link, _ = link_similarity(context, found.samples)
    assert (link[found.samples.same] >= context.similar).mean() >= 0.98
    assert link[~found.samples.same].max() < context.similar
    assert context.training.separation == 1.0
    assert context.measures.objects == 2.0


def test_twice_the_same_and_the_same_as_ever_in_two_films():
    one, two = learn([of(crossing)]).context, learn([of(crossing)]).context
    assert one == two
    both = learn([of(crossing), of(crossing)]).context
    assert both.training.same == 2 * one.training.same
    assert both.training.sources == ("film", "film")


def test_the_paper_takes_all_pairs_of_consecutive_frames():
    found = learn([of(crossing)], PAPER)
    assert (found.context.training.same, found.context.training.different) == (38, 38)
    assert found.context.similar == 0.5
    assert found.context.levels == {}
    # All are alike enough in size for Th1; where they pass, displacement errs, which no feature mends.
    assert set(found.context.weights) == {"displacement_2d"}
    near = learn([of(crossing)], Learning(gap=0.0))
    assert near.context.training.different < 38  # far ones are no question


def test_pairs_farther_apart_are_drawn_up_to_the_gap():
    consecutive = learn([of(crossing)], Learning(gap=0.0)).context.training.same
    apart = learn([of(crossing)], Learning(gap=1.0)).context.training.same
    assert consecutive < apart <= 2 * consecutive


def test_a_fast_one_is_near_where_his_motion_carries_him():
    def fast(k: int) -> list[list[float]]:
        return [[8 * k, 20, 8 * k + 20, 100], [8 * k + 30, 20, 8 * k + 50, 100]]

    column = NAMES.index("displacement_2d")
    stays, goes = (learn([of(fast)], Learning(gap=0.0, carried=carried)).samples for carried in (0.0, 1.0))
    assert stays.similarities[stays.same, column] == pytest.approx(1 - 8 / (80 * 0.6))
    assert goes.similarities[goes.same, column].mean() > 0.93


def test_a_single_object_gives_displacement_alone_and_says_so():
    found = learn([of(lambda k: crossing(k)[:1], ids=(1,))])
    assert found.context.weights == {"displacement_2d": 1.0}
    assert "displacement alone" in found.context.training.notes[0]
    assert 0 < found.context.similar <= 1


def test_false_detections_are_different_from_everybody_but_not_from_one_another():
    ghosts = [[20, 30, 40, 100], [180, 10, 190, 30]]
    found = learn([of(crossing, detected=lambda k: [*crossing(k), *ghosts])], Learning(gap=0.0, gated=False))
    assert found.context.training.same == 38
    assert found.context.training.different == 19 * (16 - 4 - 2)
    assert found.context.measures.objects == 4.0


def test_what_the_truth_does_not_ask_for_is_left_out_and_unsure_detections_too():
    film = of(crossing, use={1: Use.SCORED, 2: Use.IGNORED}, detected=crossing)
    assert learn([film]).context.weights == {"displacement_2d": 1.0}  # one object is left
    assert learn([of(crossing, use={1: Use.SCORED, 2: Use.DISTRACTOR})]).context.measures.objects == 1.0
    unsure = of(crossing, detected=crossing)._replace(
        seen=[(Frame(k, k / 10), Regions.of(crossing(k), scores=[0.9, 0.2])) for k in range(20)]
    )
    assert learn([unsure], Learning(least_score=0.5)).context.measures.objects == 1.0


@pytest.mark.parametrize(
    "film",
    [
        of(crossing, count=1),
        of(lambda k: [], ids=()),
        of(crossing, detected=lambda k: []),
        of(crossing, detected=lambda k: [[190, 0, 199, 9]]),
        of(lambda k: [[5, 5, 5, 50]], ids=(1,)),  # without area
    ],
    ids=["one frame", "no truth", "no detections", "elsewhere", "no area"],
)
def test_without_a_pair_of_one_object_nothing_can_be_learnt(film):
    with pytest.raises(ParameterError, match=r"nothing can be learnt from film: .*; check that the truth"):
        learn([film])


def test_parameters_out_of_range_are_refused():
    with pytest.raises(ParameterError, match="rounds = 0 is out of range"):
        learn([of(crossing)], Learning(rounds=0))


def test_many_pairs_are_thinned_evenly_and_still_counted():
    many = learn([of(crossing, count=60)], Learning(most=100, gated=False))
    all_ = learn([of(crossing, count=60)], Learning(gated=False))
    assert len(many.samples.labels) <= 100 < len(all_.samples.labels)
    assert many.context.training.same == pytest.approx(all_.context.training.same, rel=0.1)
    assert many.context.training.different == pytest.approx(all_.context.training.different, rel=0.1)


def drawn(rng: np.random.Generator, count: int = 400) -> Samples:
    """Pairs of which area tells much, shape little and the rest nothing."""
    labels = np.where(rng.random(count) < 0.5, 1, -1).astype(np.int8)
    similarities = rng.random((count, len(NAMES)))
    for name, much in (("area", 0.3), ("shape_ratio", 0.1)):
        similarities[:, NAMES.index(name)] = np.clip(rng.normal(0.5 + much * labels, 0.2), 0, 1)
    return Samples(similarities, np.ones(similarities.shape, bool), labels, np.ones(count))


def test_a_feature_weighs_by_how_much_it_tells_and_levels_are_usual_similarities():
    samples = drawn(np.random.default_rng(2))
    context = context_of(samples, Learning(rounds=8), "drawn").context
    assert max(context.weights, key=context.weights.__getitem__) == "area"
    assert sum(context.weights.values()) == pytest.approx(1.0)
    low, high = context.levels["area"]
    column = samples.similarities[:, NAMES.index("area")]
    assert low == pytest.approx(np.quantile(column[~samples.same], 0.05))
    assert high == pytest.approx(np.quantile(column[samples.same], 0.95))
    assert context.training.alone["area"].separation > context.training.alone["shape_ratio"].separation > 0.5
    assert context.training.separation > context.training.alone["area"].separation - 0.02


def test_what_weighs_little_is_left_out():
    samples = drawn(np.random.default_rng(2))
    every = context_of(samples, Learning(least_weight=0.0), "x").context.weights
    least = sorted(every.values())[-2]
    few = context_of(samples, Learning(least_weight=min(least, 0.5)), "x").context.weights
    assert set(few) == {name for name, weight in every.items() if weight >= least}
    assert sum(few.values()) == pytest.approx(1.0)
    assert set(context_of(samples, Learning(rounds=1, least_weight=0.5), "x").context.weights) == {"area"}


def test_balance_and_the_paper_differ_where_most_pairs_are_different():
    rng = np.random.default_rng(5)
    samples = drawn(rng)
    few = Samples(
        samples.similarities, samples.known, samples.labels, np.where(samples.same, 1.0, 50.0)
    )  # each different pair stands for fifty
    balanced = context_of(few, Learning(rounds=1), "x").context.training.alone["area"]
    plain = context_of(few, Learning(rounds=1, balanced=False), "x").context.training.alone["area"]
    assert plain.threshold > balanced.threshold
    assert plain.error < balanced.error


def test_where_nothing_tells_pairs_apart_displacement_is_left():
    same = np.ones((4, len(NAMES)), bool)
    samples = Samples(np.full((4, len(NAMES)), 0.5), same, np.array([1, 1, -1, -1], np.int8), np.ones(4))
    context = context_of(samples, Learning(), "x").context
    assert set(context.weights) == {"displacement_3d"}
    assert context.training.notes == ("no feature tells the pairs apart: displacement alone",)
