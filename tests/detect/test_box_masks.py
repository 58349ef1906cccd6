"""Silhouettes for boxes."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import World, crossing, two_apart

import perdure
from perdure import states
from perdure.detect import Background, BoxMasks, Recorded
from perdure.detect.box_masks import nearest, whole_pixels
from perdure.errors import ParameterError
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks


def boxes_of(world: World, margin: float = 2.4) -> Recorded:
    """What a detector of boxes sees: boxes about the blocks, somewhat too large."""
    truth, by_frame = world.truth(), {}
    for k in range(world.count):
        boxes = truth.in_frame(k).boxes + np.float32([-margin, -margin, margin, margin])
        by_frame[k] = Regions.of(boxes, classes=["block"] * len(boxes))
    return Recorded(regions=by_frame)


def run(detector, world: World) -> list[Regions]:
    detector = detector.prepare(world.frames()[::2])
    state, found = detector.start(world.scene), []
    for frame in world.frames():
        state, regions = detector.step(state, frame)
        found.append(regions)
    return found


def block(world: World, k: int, number: int) -> set[tuple[int, int]]:
    """The pixels of a block that are seen, by its colour."""
    return set(zip(*np.nonzero((world.frames()[k].image == world.blocks[number].colour).all(axis=2)), strict=True))


def pixels(mask: Mask, world: World) -> set[tuple[int, int]]:
    return set(zip(*np.nonzero(mask.to_image(world.height, world.width)), strict=True))


@pytest.mark.parametrize("background", [Background(), None], ids=["background", "cut"])
def test_boxes_get_the_pixels_of_what_is_in_them_and_stay_as_they_are(background):
    world = two_apart()
    given = boxes_of(world)
    found = run(BoxMasks(given, background), world)
    for k in (10, 20, 30):
        assert np.array_equal(found[k].boxes, given.regions[k].boxes)
        assert found[k].classes.tolist() == ["block", "block"]
        for number, mask in enumerate(found[k].masks):
            there, said = block(world, k, number), pixels(mask, world)
            assert len(there & said) / len(there | said) > 0.9


@pytest.mark.parametrize("background", [Background(), None], ids=["background", "cut"])
def test_silhouettes_of_two_who_cross_share_no_pixel_and_lie_in_their_boxes(background):
    world = crossing()
    for regions in run(BoxMasks(boxes_of(world), background), world):
        pictures = [mask.to_image(world.height, world.width) for mask in regions.masks]
        assert not pictures or np.sum(pictures, axis=0).max() <= 1
        for mask, box in zip(regions.masks, regions.boxes, strict=True):
            if mask.area:
                assert (np.array(mask.box[:2]) >= box[:2]).all()
                assert (np.array(mask.box[2:]) <= box[2:]).all()


def test_a_box_over_bare_ground_stays_without_a_silhouette_and_one_that_has_one_keeps_it():
    world = two_apart()
    mine = Mask(30, 90, np.ones((5, 5), bool))
    ground, owned = [60.0, 5, 80, 25], [88.0, 28, 99, 39]
    regions = Regions.of([ground, owned], masks=[Mask.empty(), mine])
    found = run(BoxMasks(Recorded(regions=dict.fromkeys(range(40), regions)), Background()), world)
    assert found[0].masks == (Mask.empty(), mine)


def test_a_contested_pixel_is_that_of_the_box_to_whose_middle_it_is_nearest():
    boxes = np.float32([[0, 0, 10, 4], [6, 0, 16, 4]])
    parts = [whole_pixels(box, 4, 16) for box in boxes]
    assert nearest(boxes, parts, np.ones((4, 16), bool))[1].tolist() == [0] * 8 + [1] * 8
    assert nearest(boxes, parts, np.zeros((4, 16), bool)).max() == -1


@pytest.mark.parametrize(
    ("box", "pixels"),
    [
        ((1.5, 1.0, 4.5, 3.0), (2, 1, 4, 3)),
        ((-5.0, -5.0, 2.2, 2.0), (0, 0, 2, 2)),
        ((3.2, 0.0, 3.9, 9.0), (0, 0, 0, 0)),
        ((20.0, 0.0, 30.0, 9.0), (0, 0, 0, 0)),
    ],
)
def test_of_pixels_that_an_edge_cuts_none_are_taken(box, pixels):
    assert whole_pixels(np.float32(box), 10, 12).box == pixels


def test_it_resumes_heeds_the_tracker_and_says_nothing_of_frames_without_a_picture():
    world = two_apart()
    detector = BoxMasks(boxes_of(world), Background())
    state, found = detector.start(world.scene), []
    for frame in world.frames():
        state, regions = detector.step(state, frame)
        rows = Tracks.of(
            frames=frame.index, times=frame.time, ids=np.arange(len(regions)) + 1, boxes=regions.boxes
        )
        state = detector.heed(state, Report(rows))
        found.append(regions)
        if frame.index == 7:
            state = states.load(states.save(state), states.kind_of(detector))
    assert state.background.held.any()
    assert sum(mask.area > 100 for mask in found[20].masks) == 2
    cut = BoxMasks(boxes_of(world))
    _, regions = cut.step(cut.start(Scene(120, 80)), Frame(20, 2.0))
    assert [mask.area for mask in regions.masks] == [0, 0]


def test_the_plan_takes_it_as_an_option_with_the_models_parameters():
    film = [frame.image for frame in two_apart().frames()]
    see = lambda image: [[4.0, 4, 60, 40]]  # noqa: E731
    tracks = perdure.track(film, detector=see, box_masks="background", least_area=0.001, tracker="overlap", fps=10)
    assert any(mask.area for mask in tracks.masks)
    with pytest.raises(ParameterError, match="least_area"):
        perdure.plan(film, detector=see, parameters={"least_area": 0.1})
    with pytest.raises(ParameterError, match="gives silhouettes by itself"):
        perdure.plan(film, box_masks="cut")
    with pytest.raises(ParameterError, match="none or background or cut"):
        perdure.plan(film, detector=see, box_masks="cuts")
    assert perdure.plan(film, box_masks="none").detector == Background()
