"""What the multi-feature tracker does, told as stories; and its equations, by hand."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import Block, World, crossing, flicker, walk

import perdure
from perdure.errors import ParameterError
from perdure.features.area import Area
from perdure.fold import settle
from perdure.scene.context import Context
from perdure.scene.measuring import Measures
from perdure.trackers.multifeature import MultiFeature
from perdure.trackers.multifeature.explaining import restated
from perdure.trackers.multifeature.fathers import greedy, once, optimal
from perdure.trackers.multifeature.links import Links, global_similarity, long_term, weighted
from perdure.trackers.multifeature.targets import newborn
from perdure.types import Explanation, Frame, Regions, Report, Scene, Status, Tracks

RED, BLUE, GREEN = (200, 40, 40), (40, 60, 220), (40, 190, 60)


def reported(seen, scene: Scene, **parameters) -> list[Report]:
    tracker = MultiFeature(**parameters)
    state, reports = tracker.start(scene), []
    for frame, regions in seen:
        state, report = tracker.step(state, frame, regions)
        reports.append(report)
    return [*reports, tracker.finish(state)]


def said(seen, scene: Scene, **parameters) -> Tracks:
    return settle(reported(seen, scene, **parameters))


def boxed(world: World) -> list[tuple[Frame, Regions]]:
    """The pictures of a world, with a box for each block that is there."""
    return [
        (frame, Regions.of([world._box(one, frame.index) for one in world.blocks if one.path(frame.index)] or np.zeros((0, 4))))
        for frame in world.frames()
    ]  # fmt: skip


def kinds(reports: list[Report]) -> list[str]:
    return [event.kind for report in reports for event in report.events]


def at(tracks: Tracks, k: int, world: World, block: int) -> int:
    """The id of the row on a block in a frame."""
    rows = tracks.in_frame(k)
    box = np.array(world._box(world.blocks[block], k))
    return int(rows.ids[np.abs(rows.boxes - box).sum(axis=1).argmin()])


def alone(count: int = 40, gone: range = range(0)) -> list[tuple[Frame, Regions]]:
    """Boxes of one who goes right by 3 px a frame, not seen for a while; no pictures."""
    return [
        (Frame(k, k / 10), Regions.empty() if k in gone else Regions.of([[10 + 3 * k, 20, 30 + 3 * k, 70]]))
        for k in range(count)
    ]


SCENE = Scene(200, 100, 10.0)


def test_a_missed_detection_is_bridged_by_rows_on_the_line_between():
    tracks = said(alone(gone=range(15, 19)), SCENE)
    assert set(tracks.ids.tolist()) == {1}
    gap = tracks.take((tracks.frames >= 15) & (tracks.frames < 19))
    assert gap.frames.tolist() == [15, 16, 17, 18]
    assert gap.inferred.all()
    assert (gap.status == Status.OCCLUDED).all()
    np.testing.assert_allclose(gap.boxes[:, 0], 10 + 3 * gap.frames, atol=1e-3)
    assert not tracks.inferred[tracks.frames < 15].any()


def test_one_not_seen_for_longer_than_the_window_comes_back_as_another():
    tracks = said(alone(gone=range(15, 25)), SCENE, window=0.5)
    assert set(tracks.ids.tolist()) == {1, 2}


@pytest.mark.parametrize("back", [True, False], ids=["turn back", "walk on"])
def test_two_of_different_colours_keep_their_ids_when_they_meet(back: bool):
    def path(start: int, step: int):
        turn = 2 * 18 if back else 10**6
        return lambda k: (start + step * (k if k < turn / 2 else turn - k), 30)

    world = World((Block(path(20, 3), colour=RED), Block(path(128, -3), colour=BLUE)), count=56, width=160)
    reports = reported(boxed(world), world.scene)
    tracks = settle(reports)
    assert (
        [at(tracks, 50, world, one) for one in (0, 1)] == [at(tracks, 5, world, one) for one in (0, 1)] == [1, 2]
    )
    assert len(set(tracks.ids.tolist())) == 2


def test_two_who_were_mistaken_for_each_other_change_their_ids_back_by_their_looks():
    def path(start: int, step: int):
        return lambda k: (start + step * (k if k < 18 else 36 - k), 30)

    world = World((Block(path(20, 3), colour=RED), Block(path(128, -3), colour=BLUE)), count=56, width=160)
    weights = "displacement_2d=1"  # which believes that they walk on
    reports = reported(boxed(world), world.scene, weights=weights)
    assert "exchanged" in kinds(reports)
    assert at(settle(reports), 50, world, 0) == 1
    without = said(boxed(world), world.scene, weights=weights, exchange=100.0)
    assert at(without, 50, world, 0) == 2, "else nothing was to be put right"
    exchanged = next(event for report in reports for event in report.events if event.kind == "exchanged")
    after = reports[exchanged.end]
    named = {one.id: one.figures["region"] for one in after.explanations}
    rows = {int(one): links[0] for one, links in zip(after.rows.ids, after.rows.links, strict=True) if links}
    assert named == rows, "reasons are told under the ids that the rows of their report have"


TURNING = {  # pixels a frame, frame of turning, upper side, left side at first: of each who walks there and back
    "three": [(3, 23, 38, 11), (-3, 24, 34, 149), (2, 17, 37, 35)],
    "four, two by two": [(-2, 20, 34, 117), (-3, 19, 30, 135), (2, 26, 34, 26), (-2, 19, 28, 119)],
    "four, one after another": [(-3, 24, 39, 143), (3, 22, 33, 7), (-4, 21, 39, 160), (-3, 20, 35, 129)],
    "three, one after another": [(-4, 20, 40, 156), (2, 20, 36, 38), (-3, 22, 35, 135)],
}


@pytest.mark.parametrize("walks", TURNING.values(), ids=list(TURNING))
def test_of_several_who_change_their_ids_no_two_become_one_in_any_frame(walks: list[tuple[int, int, int, int]]):
    def there_and_back(step: int, turn: int, top: int, left: int):
        return lambda k: (left + step * (k if k < turn else 2 * turn - k), top)

    colours = (RED, BLUE, GREEN, (220, 200, 40))
    blocks = tuple(Block(there_and_back(*one), colour=colour) for one, colour in zip(walks, colours, strict=False))
    world = World(blocks, count=60, width=170)
    reports = reported(boxed(world), world.scene, weights="displacement_2d=1")
    assert "exchanged" in kinds(reports)
    seen = sum(int((~report.rows.inferred).sum()) for report in reports)
    assert int((~settle(reports).inferred).sum()) == seen


def lost_for_five_seconds(colour: tuple[int, int, int]) -> World:
    """One red, lost inside the picture for 5 s; then one of a colour nearby, and another all the time."""
    return World(
        (
            Block(walk((20, 20), (1, 0), end=25), colour=RED),
            Block(walk((50, 22), (1, 0), begin=75), colour=colour),
            Block(walk((100, 50), (-1, 0)), colour=GREEN),
        ),
        count=96,
    )


def test_one_lost_for_five_seconds_in_the_picture_gets_back_her_id_by_her_looks():
    world = lost_for_five_seconds(RED)
    reports = reported(boxed(world), world.scene)
    assert at(settle(reports), 94, world, 1) == at(settle(reports), 10, world, 0)
    assert "found_again" in kinds(reports)
    found = next(event for report in reports for event in report.events if event.kind == "found_again")
    assert "by its looks, after 5.1 s" in found.why


def test_a_stranger_of_other_colours_does_not_get_the_id_of_who_was_lost():
    world = lost_for_five_seconds(BLUE)
    reports = reported(boxed(world), world.scene)
    tracks = settle(reports)
    assert at(tracks, 94, world, 1) not in (at(tracks, 10, world, 0), at(tracks, 10, world, 2))
    assert "found_again" not in kinds(reports)


def test_a_flicker_shorter_than_th5_is_never_said():
    world = flicker()
    assert set(said(world.seen(), world.scene).ids.tolist()) == {1}


def test_one_that_does_not_move_is_not_said_where_a_way_is_asked_for():
    seen = [
        (Frame(k, k / 10), Regions.of([[10 + 3 * k, 20, 30 + 3 * k, 70], [150, 10, 170, 60]])) for k in range(30)
    ]
    assert set(said(seen, SCENE).ids.tolist()) == {1, 2}
    tracks = said(seen, SCENE, least_way=1.0)
    assert set(tracks.ids.tolist()) == {1}
    assert tracks.boxes[tracks.frames == 29, 0].tolist() == pytest.approx([97], abs=1.0)
    assert 0 in tracks.frames, "and is said from the first on"


def test_fathers_are_chosen_once_or_until_nothing_changes_or_for_the_highest_total():
    score = np.array([[0.9, 0.8, -np.inf], [0.7, 0.6, -np.inf], [-np.inf, -np.inf, 0.5]], np.float32)
    assert once(score).tolist() == [[0, 0], [2, 2]]
    assert greedy(score).tolist() == [[0, 0], [1, 1], [2, 2]]
    rather = np.array([[0.9, 0.8], [0.7, 0.1]], np.float32)
    assert greedy(rather).tolist() == [[0, 0], [1, 1]]
    assert optimal(rather).tolist() == [[0, 1], [1, 0]]
    for choose in (once, greedy, optimal):
        for shape in ((0, 3), (3, 0), (0, 0)):
            assert choose(np.zeros(shape, np.float32)).shape == (0, 2)
        assert choose(np.full((2, 2), -np.inf, np.float32)).shape == (0, 2)


tables = st.tuples(st.integers(1, 4), st.integers(1, 4)).flatmap(
    lambda shape: st.lists(
        st.one_of(st.just(-np.inf), st.integers(0, 20).map(lambda one: one / 20)),
        min_size=shape[0] * shape[1],
        max_size=shape[0] * shape[1],
    ).map(lambda flat: np.array(flat, np.float32).reshape(shape))
)


@given(tables)
def test_official_links_are_a_partition_and_the_optimal_ones_of_the_highest_total(score: np.ndarray):
    rows, columns = score.shape
    padded = np.full((max(score.shape),) * 2, -np.inf)
    padded[:rows, :columns] = score
    best = max(
        sum(padded[row, column] for row, column in enumerate(order) if np.isfinite(padded[row, column]))
        for order in permutations(range(len(padded)))
    )
    totals = {}
    for choose in (once, greedy, optimal):
        pairs = choose(score)
        assert len(set(pairs[:, 0].tolist())) == len(set(pairs[:, 1].tolist())) == len(pairs)
        assert np.isfinite(score[pairs[:, 0], pairs[:, 1]]).all()
        totals[choose] = float(score[pairs[:, 0], pairs[:, 1]].sum())
    assert totals[optimal] == pytest.approx(best, abs=1e-5)
    assert totals[once] <= totals[greedy] + 1e-6


def trajectory(values: list[float], count: int):
    """One trajectory of so many objects, with the given areas, the newest last."""
    first = newborn(Frame(0, 0.0), Regions.of([[0, 0, 4, 4]]), {"area": np.float32([[16.0]])}, [Area()], {}, 1, len(values))  # fmt: skip
    return first.replace(values={"area": np.float32([values])}, count=np.array([count]))


def test_the_long_term_similarity_is_a_normal_density_times_how_full_the_trajectory_is():
    one = np.array([0])
    full = long_term(trajectory([10.0, 12.0, 14.0], 3), one, "area", np.float32([[14.0]]), np.float32([0.6]))
    assert full[0] == pytest.approx(np.exp(-0.5 * 2**2 / (8 / 3)), abs=1e-5)  # mean 12, variance 8/3, T = Q
    short = long_term(trajectory([0.0, 0.0, 14.0], 1), one, "area", np.float32([[14.0]]), np.float32([0.6]))
    assert short[0] == pytest.approx(1 / 3)  # T / Q; exactly on the mean
    steady = long_term(trajectory([10.0, 10.0, 10.0], 3), one, "area", np.float32([[11.0]]), np.float32([0.6]))
    assert steady[0] == pytest.approx(np.exp(-0.5))  # no deviation below a tenth of the mean is believed


def test_the_global_similarity_weighs_the_long_term_one_by_beta_and_leaves_out_what_is_not_known():
    names, one = ("area", "overlap"), np.array([0])
    link = dict(zip(names, (np.float32([0.6]), np.float32([0.2])), strict=True))
    links = Links(one, one, np.ones(1), link, dict.fromkeys(names, np.array([True])), {"area": np.float32([0.4])}, np.float32([0.3]))  # fmt: skip
    whole = global_similarity(links)
    assert whole["area"][0] == pytest.approx(0.7 * 0.6 + 0.3 * 0.4)  # eq. 17, with β = 0.3 of eq. 18
    assert whole["overlap"][0] == pytest.approx(0.2)
    weights = {"area": 3.0, "overlap": 1.0}
    assert weighted(whole, links.known, weights)[0] == pytest.approx((3 * 0.54 + 0.2) / 4)  # eq. 16
    assert weighted(whole, {**links.known, "area": np.array([False])}, weights)[0] == pytest.approx(0.2)
    assert weighted(whole, dict.fromkeys(names, np.array([False])), weights)[0] == 0


@pytest.mark.parametrize(
    ("weights", "wrong"),
    [("area=0,overlap=0", "all are 0"), ("aera=1", "did you mean 'area'"), ("area=-1", "≥ 0"), ("area=x", "≥ 0"), ("area=1,area=2", "twice"), ("area", "≥ 0")],
)  # fmt: skip
def test_weights_that_cannot_be_are_refused(weights: str, wrong: str):
    with pytest.raises(ParameterError, match=wrong):
        MultiFeature(weights=weights)


def test_weights_may_name_the_embedding_of_a_network():
    class Mean:
        height, width, size = 8, 4, 3

        def __call__(self, crops):
            return crops.mean(axis=(1, 2))

    world = World((Block(walk((20, 20), (1, 0)), colour=RED), Block(walk((50, 50), (1, 0)), colour=BLUE)), count=8)
    reports = reported(boxed(world), world.scene, weights="embedding=1", network=Mean())
    figures = reports[7].explanations[0].figures
    assert figures["link:embedding"] == pytest.approx(1.0, abs=1e-3)
    assert "link:area" not in figures, "what weighs nothing is not computed"


@pytest.mark.parametrize("pictures", [True, False], ids=["pictures", "boxes alone"])
def test_a_box_of_no_area_and_one_outside_the_picture_harm_nobody(pictures: bool):
    image = np.full((100, 200, 3), 90, np.uint8)
    odd = [[50, 50, 50, 50], [60, 10, 60, 40], [-90, -90, -50, -50], [400, 300, 420, 340]]
    seen = [
        (Frame(k, k / 10, image if pictures else None), Regions.of([[10 + 3 * k, 20, 30 + 3 * k, 70], *odd]))
        for k in range(12)
    ]
    weights = "overlap=1,displacement_2d=1,area=1,shape_ratio=1,histogram=1,hog=1,covariance=1,dominant=1"
    tracks = said(seen, SCENE, weights=weights)
    walker = tracks.take(np.array([links == (0,) for links in tracks.links]))
    assert set(walker.ids.tolist()) == {1}
    assert len(walker) == 12
    assert np.isfinite(tracks.boxes).all()
    assert np.isfinite(tracks.confidence).all()


def test_when_the_scene_becomes_another_its_context_is_chosen_and_told_and_ids_are_kept():
    contexts = (
        Context("few", {"overlap": 1.0}, similar=0.3, measures=Measures(objects=1.0)),
        Context("many", {"area": 1.0, "displacement_2d": 1.0}, similar=0.3, measures=Measures(objects=16.0)),
    )

    def boxes(k: int) -> list[list[int]]:
        others = [[20 + 22 * (n % 8), 5 + 50 * (n // 8), 32 + 22 * (n % 8), 30 + 50 * (n // 8)] for n in range(16)]
        return [[10 + k, 60, 26 + k, 98], *(others if k >= 30 else [])]

    seen = [(Frame(k, k / 10), Regions.of(boxes(k))) for k in range(70)]
    reports = reported(seen, Scene(200, 100, 10.0), contexts=contexts, recheck=1.0)
    told = [
        (event.begin, event.why.partition(":")[0])
        for one in reports
        for event in one.events
        if event.kind == "context"
    ]
    assert [name for _, name in told] == ["few", "many"]
    assert told[0][0] == 20
    tracks = settle(reports)
    first = tracks.take(np.array([links == (0,) for links in tracks.links]))
    assert set(first.ids.tolist()) == {1}
    assert len(first) == 70
    assert len(set(tracks.ids.tolist())) == 17
    whys = [one.explanations[0].why.split()[-1] for one in reports[:-1] if one.explanations]
    assert list(dict.fromkeys(whys)) == ["'default'", "'few'", "'many'"]


def test_step_by_step_and_over_a_whole_film_the_same_is_settled():
    world = crossing()
    images = [frame.image for frame in world.frames()]
    options = {"tracker": "multifeature", "fps": world.fps}
    whole = perdure.track(images, **options)
    loop, steps = perdure.Online("multifeature", fps=world.fps), []
    for step in perdure.follow(images, **options):
        if step.frame is not None:
            loop.update(step.regions, step.frame.image, step.frame.time)
            steps.append(loop.report)
    assert len(whole)
    assert settle(steps).equals(whole)


def test_reasons_are_renamed_and_their_regions_numbered_among_all():
    figures = {"score": 0.5, "region": 1.0, "runner_up:4": 0.3, "other_region:0": 0.2}
    (one,) = restated([Explanation(3, "why", figures)], {3: 8, 4: 3}, np.array([2, 5]))
    assert one == Explanation(8, "why", {"score": 0.5, "region": 5.0, "runner_up:3": 0.3, "other_region:2": 0.2})
    assert restated([Explanation(3, "why", figures)], {1: 1}) == (Explanation(3, "why", figures),)
    assert restated([Explanation(3, "why", figures)], {3: 0}) == ()
    assert "runner_up:0" not in restated([Explanation(3, "why", figures)], {4: 0})[0].figures
