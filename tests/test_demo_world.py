import dataclasses

import numpy as np
import pytest

from perdure.demo import Occluder, Walker, World, demo_world
from perdure.demo.figures import Clothes
from perdure.errors import ParameterError
from perdure.types import Status, Tracks

RED, BLUE = Clothes((220, 40, 40)), Clothes((40, 60, 220))


def two_boxes_that_cross(**changes) -> World:
    """64 x 48, 30 frames: 1 walks right, 2 walks left and passes in front of it.

    | 1 >        |
    |        < 2 |
    """
    walkers = (
        Walker("box", ((0.0, 5, 30), (2.9, 63, 30)), 8, 12, RED),
        Walker("box", ((0.0, 60, 33), (2.9, 2, 33)), 8, 12, BLUE),
    )
    return dataclasses.replace(World(64, 48, fps=10, count=30, walkers=walkers), **changes)


def behind_a_wall(look: str = "box") -> World:
    """One that walks behind a wall: 1 > |#####|"""
    walker = Walker(look, ((0.0, -10, 30), (2.9, 74, 30)), 8, 12, RED)
    return World(64, 48, fps=10, count=30, walkers=(walker,), occluders=(Occluder("box", 32, 40, 20, 40),))


def seen_by_colour(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.asarray(np.abs(image.astype(int) - colour).max(axis=2) < 60)


def test_a_box_is_where_its_path_says():
    world = World(64, 48, fps=10, count=3, walkers=(Walker("box", ((0.0, 20, 30), (1.0, 30, 30)), 8, 12, RED),))
    assert world.truth().boxes.tolist() == [[16, 18, 24, 30], [17, 18, 25, 30], [18, 18, 26, 30]]
    picture = next(iter(world.frames())).image
    assert seen_by_colour(picture, RED.top)[18:30, 16:24].all()
    assert int(seen_by_colour(picture, RED.top).sum()) == 8 * 12


def test_the_truth_is_what_the_picture_shows():
    world = two_boxes_that_cross()
    truth = world.truth()
    for frame in world.frames():
        rows = truth.in_frame(frame.index)
        for identity, mask in zip(rows.ids, rows.masks, strict=True):
            shown = seen_by_colour(frame.image, (RED if identity == 1 else BLUE).top)
            assert np.count_nonzero(shown ^ mask.to_image(48, 64)) <= 24  # soft left and right edges


@pytest.mark.parametrize("look", ["box", "ellipse", "person", "cyclist", "dog"])
def test_seen_pixels_are_disjoint_inside_the_picture_and_part_of_what_is_believed(look):
    walkers = (
        Walker(look, ((0.0, -20, 40), (2.9, 80, 40)), 20, 30, RED),
        Walker(look, ((0.0, 80, 44), (2.9, -20, 44)), 20, 30, BLUE),
    )
    truth = World(64, 48, fps=10, count=30, walkers=walkers).truth()
    for index in range(30):
        rows = truth.in_frame(index)
        seen = [mask.to_image(48, 64) for mask in rows.masks]
        assert sum((one.astype(int) for one in seen), np.zeros((48, 64), int)).max() <= 1
        for one, mask, whole, box in zip(seen, rows.masks, rows.believed, rows.boxes, strict=True):
            assert mask.area == np.count_nonzero(one)
            assert not (one & ~whole.to_image(48, 64)).any()
            assert tuple(box) == whole.box


def test_the_lower_foot_is_in_front():
    truth = two_boxes_that_cross().truth().in_frame(14)
    assert truth.status.tolist() == [Status.PARTLY_OCCLUDED, Status.VISIBLE]
    assert truth.masks[1].area == 96


def test_one_who_goes_behind_a_wall_is_partly_then_wholly_hidden_and_comes_back():
    rows = behind_a_wall().truth()
    words = [Status(value).word for value in rows.status]
    story = [word for index, word in enumerate(words) if index == 0 or words[index - 1] != word]
    assert story[-6:-1] == ["visible", "partly_occluded", "occluded", "partly_occluded", "visible"]
    hidden = rows.take(rows.status == Status.OCCLUDED)
    assert (hidden.boxes[:, 2] - hidden.boxes[:, 0]).min() >= 8  # the box stays whole
    assert rows.hidden_side[words.index("partly_occluded", words.index("visible"))] == "right"


def test_what_is_outside_the_picture_has_no_row_and_a_half_outside_keeps_its_box():
    rows = behind_a_wall().truth()
    assert rows.frames[0] > 0
    assert rows.boxes[0, 0] < 0
    assert rows.masks[0].x == 0
    assert rows.hidden_side[0] == "left"


def test_a_film_can_be_drawn_again_and_is_the_same():
    world = two_boxes_that_cross(noise=2.0, flicker=0.01, shadows=True)
    for one, other in zip(world.frames(), world.frames(), strict=True):
        assert np.array_equal(one.image, other.image)
        assert (one.index, one.time) == (other.index, other.time)
    assert world.truth().equals(world.truth())


def test_another_seed_is_other_noise():
    one, other = (next(two_boxes_that_cross(noise=2.0, seed=seed).frames()).image for seed in (1, 2))
    assert not np.array_equal(one, other)
    spread = float((one.astype(float) - next(two_boxes_that_cross().frames()).image).std())
    assert 1.5 < spread < 2.5


def test_noise_and_flicker_change_the_picture_and_not_the_truth():
    assert two_boxes_that_cross().truth().equals(two_boxes_that_cross(noise=3.0, flicker=0.02).truth())


def test_a_mirrored_world_has_mirrored_pictures_and_a_mirrored_truth():
    world = behind_a_wall("person")
    for one, other in zip(world.frames(), world.mirrored().frames(), strict=True):
        assert np.array_equal(one.image[:, ::-1], other.image)
    truth, mirrored = world.truth(), world.mirrored().truth()
    assert np.array_equal(64 - truth.boxes[:, [2, 1, 0, 3]] * [1, -1, 1, -1] - [0, 64, 0, 64], mirrored.boxes)
    for one, other in zip(truth.masks, mirrored.masks, strict=True):
        assert np.array_equal(one.to_image(48, 64)[:, ::-1], other.to_image(48, 64))
    assert mirrored.hidden_side[0] == "right"
    assert world.mirrored().mirrored() == world


def test_a_shifted_world_is_the_same_elsewhere():
    world = two_boxes_that_cross()
    truth, shifted = world.truth(), world.shifted(3, -4).truth()
    both = np.isin(truth.frames, np.intersect1d(truth.frames, shifted.frames))
    assert np.array_equal(truth.boxes[both] + [3, -4, 3, -4], shifted.boxes)


def test_a_shifted_mirrored_world_moves_as_it_is_seen():
    world = two_boxes_that_cross().mirrored()
    moved = np.array([3, 0, 3, 0])
    assert np.array_equal(world.truth().boxes[:20] + moved, world.shifted(3, 0).truth().boxes[:20])


def test_a_walker_who_stands_does_not_move_a_limb():
    stands = Walker("person", ((0.0, 20, 40), (1.0, 30, 40), (3.0, 30, 40), (4.0, 40, 40)), 14, 36)
    rows = World(64, 48, fps=10, count=40, walkers=(stands,)).truth()
    assert all(rows.believed[index] == rows.believed[12] for index in range(12, 29))
    assert rows.believed[5] != rows.believed[12]


def test_a_walker_is_there_only_from_its_first_waypoint_to_its_last():
    rows = World(
        64, 48, fps=10, count=30, walkers=(Walker("ellipse", ((1.0, 20, 40), (2.0, 30, 40)), 9, 9),)
    ).truth()
    assert (rows.frames.min(), rows.frames.max()) == (10, 20)


def test_walkers_grow_as_they_come_nearer():
    walker = Walker("box", ((0.0, 32, 12), (2.9, 32, 48)), 16, 24)
    boxes = World(64, 48, fps=10, count=30, walkers=(walker,), horizon=2.0).truth().boxes
    heights = boxes[:, 3] - boxes[:, 1]
    assert heights[-1] == pytest.approx(24, abs=1)
    assert heights[0] < 7


def test_an_empty_world_is_a_film_without_truth():
    world = World(64, 48, count=2)
    assert [frame.image.mean() for frame in world.frames()] == [120, 120]
    assert world.truth().equals(Tracks.empty())
    assert list(World(64, 48, count=0).frames()) == []


@pytest.mark.parametrize(
    "make",
    [
        lambda: Walker("unicorn", ((0.0, 1, 1),), 5, 5),
        lambda: Walker("box", (), 5, 5),
        lambda: Walker("box", ((1.0, 1, 1), (1.0, 2, 2)), 5, 5),
        lambda: Occluder("cloud", 1, 1, 5, 5),
        lambda: World(64, 48, backdrop="sea"),
    ],
)
def test_what_cannot_be_drawn_is_refused(make):
    with pytest.raises(ParameterError, match="must"):
        make()


@pytest.fixture(scope="module")
def demo() -> tuple[World, Tracks]:
    world = demo_world()
    return world, world.truth()


def test_the_demo_begins_empty_and_tells_all_it_should(demo):
    world, truth = demo
    assert (world.width, world.height) == (640, 480)
    assert 12 <= world.count / world.fps <= 15
    assert truth.frames.min() >= world.fps
    assert sorted(set(truth.ids.tolist())) == list(range(1, 10))
    assert {"person", "dog", "bicycle"} == set(truth.classes.tolist())


def test_in_the_demo_some_are_hidden_wholly_and_come_back(demo):
    _, truth = demo
    for identity in (5, 6, 8):
        rows = truth.of_id(identity)
        hidden = np.flatnonzero([mask.area == 0 for mask in rows.masks])
        assert hidden.size >= 5
        assert (rows.status[: hidden[0]] == Status.VISIBLE).any()
    for identity in (5, 6):
        rows = truth.of_id(identity)
        hidden = np.flatnonzero(rows.status == Status.OCCLUDED)
        assert (rows.status[hidden[-20] :] == Status.VISIBLE).any()


def test_in_the_demo_two_cross_and_two_meet_and_pass_each_other(demo):
    _, truth = demo
    for one, other in ((1, 2), (3, 4)):
        left, right = truth.of_id(one), truth.of_id(other)
        both, i, j = np.intersect1d(left.frames, right.frames, return_indices=True)
        order = np.sign(left.boxes[i, 0] - right.boxes[j, 0])
        assert order[0] != order[-1]
        assert len(both) > 100


def test_the_demo_has_bright_and_dark_places(demo):
    world, _ = demo
    picture = next(world.frames()).image.mean(axis=2)
    assert np.percentile(picture, 5) < 70
    assert np.percentile(picture, 95) > 180
