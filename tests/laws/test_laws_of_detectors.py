"""The laws of the house, on every detector."""

from __future__ import annotations

import typing
from dataclasses import replace

import numpy as np
import pytest
from worlds import WORLDS, World, lone_walker, two_apart

from perdure import params, states
from perdure.detect import DETECTORS, Called, Mark, Network, People
from perdure.detect.components import components
from perdure.detect.layouts import Found, Layout
from perdure.detect.letterbox import Fit
from perdure.detect.network import Model
from perdure.errors import ParameterError
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks

pytestmark = pytest.mark.parametrize("kind", DETECTORS.values(), ids=list(DETECTORS))
every_world = pytest.mark.parametrize("world", [make() for make in WORLDS.values()], ids=list(WORLDS))


def detector_for(kind, world: World):
    """A detector that can work in this world: a recorded one gets the world's own regions, a marked one marks of them."""
    if "regions" in kind.__dataclass_fields__:
        return kind(regions={frame.index: regions for frame, regions in world.seen()})
    if "marks" in kind.__dataclass_fields__:
        return kind(marks=tuple(marks(world)))
    if kind is People:
        return kind(least_height=96.0)  # no picture is enlarged
    if kind is Network:
        return kind(model=block_network(world))
    if kind is Called:
        return kind(function=lambda image: components(blocks(image), least_area=4))
    return kind()


def blocks(image: np.ndarray) -> np.ndarray:
    return np.uint8(255) * (np.abs(image.astype(float) - 90) > 1).any(axis=2)


def block_network(world: World) -> Model:
    """A network that sees blocks, and every block twice."""

    def run(picture):
        boxes = components(blocks(picture * 255), least_area=4).boxes
        return [np.concatenate([boxes, boxes])]

    def decode(answer):
        scores = np.linspace(0.9, 0.5, len(answer[0])).astype(np.float32)
        return Found(answer[0], scores, np.zeros(len(scores), int))

    return Model("blocks", Layout("drawn", Fit(world.height, world.width), decode, 1), ("block",), run)


def skip_where_blocks_are_nothing(kind) -> None:
    if kind is People:
        pytest.skip("blocks are no people: its boxes are tested in tests/detect/test_people.py")


def marks(world: World) -> list[Mark]:
    """Silhouettes in every fourth frame, boxes around them in every fourth, nothing in the others."""
    return [
        Mark(
            frame.index,
            number,
            mask if frame.index % 4 else replace(mask, bits=mask.bits | True),
            frame.index % 4 == 0,
        )
        for frame, regions in world.seen()
        if frame.index % 2 == 0
        for number, mask in enumerate(regions.masks, 1)
    ]


def run(detector, frames, scene, state=None) -> tuple[object, list[Regions]]:
    state = detector.start(scene) if state is None else state
    found = []
    for frame in frames:
        state, regions = detector.step(state, frame)
        found.append(regions)
    return state, found


def same(left: list[Regions], right: list[Regions]) -> bool:
    return len(left) == len(right) and all(one.equals(other) for one, other in zip(left, right, strict=True))


_ON = 5  # frames after which a resumed run is compared with the one that went on


@every_world
def test_a_run_resumed_from_a_saved_state_is_the_same_run(kind, world: World):
    detector, frames = detector_for(kind, world), world.frames()
    state_kind = typing.get_type_hints(kind.start)["return"]
    stops = (0, 1, 7, world.count // 2)
    state, kept, whole = detector.start(world.scene), {}, []
    for number, frame in enumerate(frames):
        if number in stops or number - _ON in stops:
            kept[number] = states.save(state)
        state, regions = detector.step(state, frame)
        whole.append(regions)
    for stop in stops:
        state, after = states.load(kept[stop], state_kind), []
        for number, frame in enumerate(frames[stop:], stop):
            if number == stop + _ON and states.save(state) == kept[number]:
                break  # from equal states on, all is equal: the rest is one run
            state, regions = detector.step(state, frame)
            after.append(regions)
        assert same(whole[stop : stop + len(after)], after), f"resumed at frame {stop}"


def test_a_run_in_which_the_tracker_is_heeded_resumes_from_a_saved_state(kind):
    world = two_apart()
    detector, frames = detector_for(kind, world), world.frames()
    if not hasattr(detector, "heed"):
        pytest.skip("heeds no tracker")
    state_kind = typing.get_type_hints(kind.start)["return"]

    def heeded(stop: int) -> list[Regions]:
        state, found = detector.start(world.scene), []
        for frame in frames:
            state, regions = detector.step(state, frame)
            ids = np.arange(1, len(regions) + 1)
            rows = Tracks.of(frames=frame.index, times=frame.time, ids=ids, boxes=regions.boxes)
            state = detector.heed(state, Report(rows))
            found.append(regions)
            if frame.index == stop:
                state = states.load(states.save(state), state_kind)
        return found

    assert same(heeded(-1), heeded(3))
    assert same(heeded(-1), heeded(world.count // 2))


def test_videos_woven_in_one_process_do_not_see_each_other(kind):
    worlds = (lone_walker(), two_apart())
    detectors = [detector_for(kind, world) for world in worlds]
    apart = [
        run(detector, world.frames(), world.scene)[1] for detector, world in zip(detectors, worlds, strict=True)
    ]
    state_of = [detector.start(world.scene) for detector, world in zip(detectors, worlds, strict=True)]
    woven: list[list[Regions]] = [[], []]
    for pair in zip(*(world.frames() for world in worlds), strict=True):
        for number, frame in enumerate(pair):
            state_of[number], regions = detectors[number].step(state_of[number], frame)
            woven[number].append(regions)
    assert same(apart[0], woven[0])
    assert same(apart[1], woven[1])


@every_world
def test_step_does_not_change_the_frame(kind, world: World):
    detector = detector_for(kind, world)
    state = detector.start(world.scene)
    for frame in world.frames():
        before = frame.image.copy()
        state, _ = detector.step(state, frame)
        assert np.array_equal(frame.image, before)


@every_world
def test_masks_are_disjoint_tight_and_in_their_boxes(kind, world: World):
    skip_where_blocks_are_nothing(kind)
    if kind is Network:
        pytest.skip("gives boxes: silhouettes of boxes are tested in tests/detect/test_box_masks.py")
    _, found = run(detector_for(kind, world), world.frames(), world.scene)
    assert any(len(regions) for regions in found)
    for regions in found:
        pictures = [mask.to_image(world.height, world.width) for mask in regions.masks]
        assert not len(regions) or np.sum(pictures, axis=0).max() <= 1
        for picture, box in zip(pictures, regions.boxes, strict=True):
            assert Mask.of_image(picture).box == tuple(box)


def test_nothing_is_seen_outside_the_roi(kind):
    skip_where_blocks_are_nothing(kind)
    world = two_apart()
    roi = np.zeros((world.height, world.width), bool)
    roi[: world.height // 2] = True
    _, found = run(detector_for(kind, world), world.frames(), Scene(world.width, world.height, world.fps, roi=roi))
    assert any(len(regions) for regions in found)
    for regions in found:
        assert (regions.boxes[:, 3] <= world.height // 2).all()


def test_a_mirrored_film_gives_mirrored_regions(kind):
    skip_where_blocks_are_nothing(kind)
    world = two_apart()
    detector = detector_for(kind, world)
    if not detector.needs_pixels:
        pytest.skip("looks at no pixels: there is nothing to mirror")
    _, plain = run(detector, world.frames(), world.scene)
    flipped = [Frame(frame.index, frame.time, frame.image[:, ::-1].copy()) for frame in world.frames()]
    _, mirrored = run(detector, flipped, world.scene)
    for one, other in zip(plain, mirrored, strict=True):
        back = {(world.width - b[2], b[1], world.width - b[0], b[3]) for b in other.boxes.tolist()}
        assert {tuple(box) for box in one.boxes.tolist()} == back


def test_the_state_stays_bounded_on_an_endless_film(kind):
    world = lone_walker()
    detector = detector_for(kind, world)
    frames = world.frames()
    state, _ = run(detector, frames, world.scene)
    early = len(states.save(state))
    later = [Frame(40 + k, (40 + k) / 10, frames[k % 40].image) for k in range(160)]
    state, _ = run(detector, later, world.scene, state)
    assert len(states.save(state)) <= early + 64


def test_a_parameter_out_of_range_is_refused_by_name_value_and_range(kind):
    for declared in params.describe(kind):
        for wrong in (declared.low - 1, declared.high + 1):
            if declared.kind in (int, float) and np.isfinite(wrong):
                with pytest.raises(ParameterError, match=declared.name):
                    params.build(kind, {declared.name: declared.kind(wrong)})
        with pytest.raises(ParameterError, match=declared.name):
            params.build(kind, {declared.name: "nonsense" if declared.kind is not str else 3})
