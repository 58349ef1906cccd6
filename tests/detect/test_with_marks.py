"""Marks beside another detector's regions."""

from __future__ import annotations

import numpy as np
from worlds import two_apart

from perdure import states
from perdure.detect import Background, Mark, Recorded, WithMarks
from perdure.fold import detect
from perdure.types import Event, Frame, Mask, Regions, Report, Scene, Tracks

SCENE = Scene(64, 48, 10)
MARK = Mark(frame=3, id=7, area=Mask(10, 20, np.ones((16, 8), bool)))


def block(x: int, y: int, width: int, height: int) -> Mask:
    return Mask(y, x, np.ones((height, width), bool))


def seen(regions: Regions, *marks: Mark, frame: int = 3) -> Regions:
    detector = WithMarks(Recorded(regions={frame: regions}), marks=marks or (MARK,))
    return detector.step(detector.start(SCENE), Frame(frame, frame / 10))[1]


def of_masks(*masks: Mask, **columns) -> Regions:
    return Regions.of([mask.box for mask in masks], masks=masks, **columns)


def test_marks_go_before_what_the_detector_sees_and_bear_their_ids():
    found = seen(of_masks(block(40, 10, 9, 9), block(2, 2, 5, 5), scores=[0.5, 0.25], classes=["car", "dog"]))
    assert found.boxes[:, 0].tolist() == [20, 40, 2]
    assert found.data["mark"].tolist() == [7, 0, 0]
    assert found.scores.tolist() == [1.0, 0.5, 0.25]
    assert found.classes.tolist() == ["", "car", "dog"]
    assert found.masks[0] == MARK.area


def test_other_frames_are_the_detectors_own():
    regions = of_masks(block(40, 10, 9, 9))
    found = seen(regions, frame=4)
    assert found.equals(regions)
    assert "mark" not in found.data


def test_a_region_of_which_half_is_marked_is_the_marked_thing():
    half, less, larger = block(16, 10, 8, 16), block(15, 10, 8, 16), block(20, 10, 24, 16)
    for region, kept in ((half, 1), (less, 2), (larger, 2)):
        assert len(seen(of_masks(region))) == kept, region.box


def test_without_a_silhouette_the_boxes_are_compared():
    assert len(seen(Regions.of([[16, 10, 24, 26]]))) == 1
    assert len(seen(Regions.of([[15, 10, 23, 26]]))) == 2
    assert len(seen(Regions.of([[15, 10, 15, 10]]))) == 2  # a box without area is nobody's


def test_two_marks_together_do_not_make_a_region_one_of_them():
    other = Mark(frame=3, id=8, area=block(28, 10, 8, 16))
    across = block(20, 10, 24, 16)  # a third in each
    assert seen(of_masks(across), MARK, other).data["mark"].tolist() == [7, 8, 0]


def test_what_else_the_detector_said_is_kept():
    event = Event("light", 3, 3, ())
    regions = of_masks(block(40, 10, 9, 9), data={"speed": np.array([[1.5, 2.0]])})
    regions = Regions(
        *(getattr(regions, name) for name in ("boxes", "scores", "classes", "masks", "data")), (event,)
    )
    found = seen(regions)
    assert found.data["speed"].tolist() == [[0, 0], [1.5, 2.0]]
    assert found.events == (event,)


def test_a_blind_frame_stays_blind_and_its_marks_are_there():
    nothing = Regions.empty()
    blind = Regions(nothing.boxes, nothing.scores, nothing.classes, nothing.masks, blind=True)
    found = seen(blind)
    assert found.blind
    assert found.data["mark"].tolist() == [7]


def test_the_detector_goes_on_as_without_marks_and_heeds_the_tracker():
    world = two_apart()
    frames, marks = world.frames(), (Mark(frame=5, id=3, area=block(60, 30, 9, 9)),)
    alone = [regions for _, regions in detect(frames, Background(), world.scene)]
    beside = [regions for _, regions in detect(frames, WithMarks(Background(), marks), world.scene)]
    assert beside[5].take(np.arange(1, len(beside[5]))).equals(alone[5])
    assert all(one.equals(other) for k, (one, other) in enumerate(zip(alone, beside, strict=True)) if k != 5)
    detector = WithMarks(Background(), marks)
    state, _ = detector.step(detector.start(world.scene), frames[0])
    rows = Tracks.of(frames=0, times=0.0, ids=[1], boxes=[[10, 10, 20, 20]])
    state = detector.heed(state, Report(rows))
    assert state.other.held[10:20, 10:20].all()
    bare = WithMarks(Recorded(), marks)
    assert bare.heed(bare.start(world.scene), Report(rows)).other.next == -1


def test_it_needs_pictures_if_the_other_does():
    assert WithMarks(Background()).needs_pixels
    assert not WithMarks(Recorded()).needs_pixels


def test_it_goes_on_from_a_saved_state_with_the_other_detectors():
    world = two_apart()
    detector = WithMarks(Background(), marks=(Mark(frame=9, id=7, area=block(20, 10, 10, 16)),))
    state, found = detector.start(world.scene), {0: [], 12: []}
    for resumed, regions in found.items():
        for frame in world.frames():
            if resumed and frame.index == 0:
                state = detector.start(world.scene)
            if resumed and frame.index == resumed:
                state = states.load(states.save(state), states.kind_of(detector))
            state, seen_here = detector.step(state, frame)
            regions.append(seen_here)
    assert all(one.equals(other) for one, other in zip(found[0], found[12], strict=True))
    assert sum(len(one) for one in found[12]) > 20
