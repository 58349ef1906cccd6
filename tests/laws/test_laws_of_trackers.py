"""The laws of the house, on every tracker."""

from __future__ import annotations

import dataclasses
import functools
import typing
from typing import NamedTuple

import numpy as np
import pytest
from worlds import WORLDS, World

from perdure import params, states
from perdure.errors import ParameterError
from perdure.fold import settle
from perdure.trackers import TRACKERS
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks

pytestmark = pytest.mark.parametrize("kind", TRACKERS.values(), ids=list(TRACKERS))
DRAWN = {name: make() for name, make in WORLDS.items()}
every_world = pytest.mark.parametrize("world", DRAWN.values(), ids=list(DRAWN))


def run(tracker, seen, scene) -> list[Report]:
    state = tracker.start(scene)
    reports = []
    for frame, regions in seen:
        state, report = tracker.step(state, frame, regions)
        reports.append(report)
    return [*reports, tracker.finish(state)]


_ON = 5  # frames after which a resumed run is compared with the one that went on


class Whole(NamedTuple):
    """A tracker's run over a world: reports are never changed, so that one run serves every law."""

    reports: list[Report]
    kept: dict[int, bytes]  # its state before some of the frames, saved
    changed: list[int]  # frames of which a step changed the picture or the regions


def stops(world: World) -> tuple[int, ...]:
    """Where runs are resumed."""
    return 0, 1, 7, world.count // 2, world.count


@functools.cache
def whole(kind, name: str) -> Whole:
    """Follow a world once, and look on."""
    world, tracker = DRAWN[name], kind()
    at = {stop + on for stop in stops(world) for on in (0, _ON)}
    state, told = tracker.start(world.scene), Whole([], {}, [])
    for number, (frame, regions) in enumerate(world.seen()):
        if number in at:
            told.kept[number] = states.save(state)
        before = frame.image.copy(), regions.boxes.copy(), regions.scores.copy(), masks_of(regions)
        state, report = tracker.step(state, frame, regions)
        after = frame.image, regions.boxes, regions.scores, list(regions.masks)
        if not all(map(equal, before, after)):
            told.changed.append(number)
        told.reports.append(report)
    told.kept[world.count] = states.save(state)
    told.reports.append(tracker.finish(state))
    return told


def masks_of(regions: Regions) -> list[Mask]:
    return [Mask(mask.y, mask.x, mask.bits.copy()) for mask in regions.masks]


def equal(one, other) -> bool:
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


def told(kind, world: World) -> list[Report]:
    """What a tracker reports of a world."""
    return whole(kind, name_of(world)).reports


def name_of(world: World) -> str:
    return next(name for name, one in DRAWN.items() if one is world)


def state_kind(tracker) -> type:
    return typing.get_type_hints(type(tracker).start)["return"]


def same(left: list[Report], right: list[Report]) -> bool:
    return len(left) == len(right) and all(one.equals(other) for one, other in zip(left, right, strict=True))


@every_world
def test_a_run_resumed_from_a_saved_state_is_the_same_run(kind, world: World):
    tracker, seen, unbroken = kind(), world.seen(), whole(kind, name_of(world))
    for stop in stops(world):
        state = states.load(unbroken.kept[stop], state_kind(tracker))
        after = []
        for number, (frame, regions) in enumerate(seen[stop:], stop):
            if number == stop + _ON and states.save(state) == unbroken.kept[number]:
                break  # from equal states on, all is equal: the rest is one run
            state, report = tracker.step(state, frame, regions)
            after.append(report)
        else:
            after.append(tracker.finish(state))
        assert same(unbroken.reports[stop : stop + len(after)], after), f"resumed at frame {stop}"


@every_world
def test_equal_states_are_saved_as_equal_bytes_and_survive_what_comes_after(kind, world: World):
    tracker, seen = kind(), world.seen()
    kept = whole(kind, name_of(world)).kept[world.count // 2]
    state, again = (states.load(kept, state_kind(tracker)) for _ in range(2))
    for frame, regions in seen[world.count // 2 :]:
        state, _ = tracker.step(state, frame, regions)
    assert states.save(again) == kept


def test_videos_woven_in_one_process_do_not_see_each_other(kind):
    one, other = DRAWN["lone walker"], DRAWN["two apart"]
    tracker = kind()
    apart = [told(kind, world) for world in (one, other)]
    state_of = [tracker.start(world.scene) for world in (one, other)]
    woven: list[list[Report]] = [[], []]
    for pair in zip(one.seen(), other.seen(), strict=True):
        for number, (frame, regions) in enumerate(pair):
            state_of[number], report = tracker.step(state_of[number], frame, regions)
            woven[number].append(report)
    for number in (0, 1):
        assert same(apart[number], [*woven[number], tracker.finish(state_of[number])])


@every_world
def test_an_id_is_at_least_one_and_said_at_most_once_a_frame(kind, world: World):
    for report in told(kind, world):
        said = list(zip(report.rows.frames.tolist(), report.rows.ids.tolist(), strict=True))
        assert len(said) == len(set(said))
        assert (report.rows.ids >= 1).all()


def test_an_id_is_never_reused(kind):
    """Three walk through one after the other, with long pauses: three ids."""
    from worlds import Block, walk

    pause = 120  # longer than anybody is remembered
    world = World(
        tuple(Block(walk((5, 30), (3, 0), pause * n, pause * n + 20)) for n in range(3)), count=pause * 3
    )
    assert len(set(settle(run(kind(), world.seen(), world.scene)).counted().ids.tolist())) == 3


@every_world
def test_settling_leaves_one_row_per_frame_and_id_and_twice_changes_nothing(kind, world: World):
    once = settle(told(kind, world))
    pairs = list(zip(once.frames.tolist(), once.ids.tolist(), strict=True))
    assert pairs == sorted(set(pairs))
    assert settle([Report(once)]).equals(once)


@every_world
def test_no_correction_makes_two_seen_rows_of_a_frame_one(kind, world: World):
    reports = told(kind, world)
    dropped = any(report.dropped for report in reports)
    seen = sum(int((~report.rows.inferred).sum()) for report in reports)
    assert dropped or int((~settle(reports).inferred).sum()) == seen


@every_world
def test_step_changes_neither_frame_nor_regions(kind, world: World):
    assert whole(kind, name_of(world)).changed == []


@every_world
def test_masks_of_a_frame_share_no_pixel_and_lie_in_their_boxes(kind, world: World):
    settled = settle(told(kind, world))
    for index in np.unique(settled.frames):
        rows = settled.in_frame(index)
        rows = rows.take(~rows.is_group)
        pictures = [mask.to_image(world.height, world.width) for mask in rows.masks]
        assert not len(rows) or np.sum(pictures, axis=0).max() <= 1
        for mask, picture, box, visible in zip(rows.masks, pictures, rows.boxes, rows.visible_boxes, strict=True):
            assert picture.sum() == mask.area, "a mask leaves the frame"
            if mask.area:
                assert Mask.of_image(picture).box == tuple(visible)
                assert (box[:2] <= visible[:2]).all()
                assert (box[2:] >= visible[2:]).all()


def test_overlapping_masks_of_a_detector_are_said_disjoint(kind):
    masks = [Mask(10, 10, np.ones((20, 20), bool)), Mask(10, 20, np.ones((20, 20), bool))]
    regions = Regions.of([[10, 10, 30, 30], [20, 10, 40, 30]], masks=masks)
    seen = [(Frame(k, k / 10, np.zeros((60, 60, 3), np.uint8)), regions) for k in range(12)]
    last = settle(run(kind(), seen, Scene(60, 60, 10))).in_frame(11)
    assert sum(mask.area for mask in last.masks) <= 20 * 30


@pytest.mark.parametrize("name", ["lone walker", "two apart"])
def test_a_mirrored_film_gives_mirrored_tracks(kind, name):
    world = DRAWN[name]
    mirrored = [_mirrored(frame, regions) for frame, regions in world.seen()]
    one = settle(told(kind, world))
    other = settle(run(kind(), mirrored, world.scene))
    flipped = other.replace(boxes=(world.width - other.boxes[:, [2, 1, 0, 3]]) * _X + other.boxes * _Y)
    assert rows_up_to_ids(one) == rows_up_to_ids(flipped)


@pytest.mark.parametrize("name", ["lone walker", "two apart"])
def test_a_shifted_film_gives_shifted_tracks(kind, name):
    world = DRAWN[name]
    shifted = [
        (
            frame,
            Regions.of(
                regions.boxes + np.float32([0, 7, 0, 7]),
                masks=[dataclasses.replace(mask, y=mask.y + 7) for mask in regions.masks],
            ),
        )
        for frame, regions in world.seen()
    ]
    bare = [(Frame(frame.index, frame.time), regions) for frame, regions in shifted]
    plain = [(Frame(frame.index, frame.time), regions) for frame, regions in world.seen()]
    one = settle(run(kind(), plain, world.scene))
    other = settle(run(kind(), bare, world.scene))
    assert rows_up_to_ids(one) == rows_up_to_ids(other.replace(boxes=other.boxes - np.float32([0, 7, 0, 7])))


def test_no_region_no_target_no_frame_are_values(kind):
    tracker, scene = kind(), Scene(64, 48)
    assert len(tracker.finish(tracker.start(scene)).rows) == 0
    state = tracker.start(scene)
    for k in range(5):
        state, report = tracker.step(state, Frame(k, k / 10), Regions.empty())
        assert len(report.rows) == 0
    assert len(tracker.finish(state).rows) == 0


def test_the_state_stays_bounded_on_an_endless_film(kind):
    """Somebody walks to and fro for ever: after the first minute the state grows no more."""
    tracker, scene = kind(), Scene(200, 60, 10)
    state = tracker.start(scene)
    sizes = {}
    for k in range(900):
        x = 20 + abs((k * 2) % 240 - 120)
        regions = Regions.of([[x, 20, x + 12, 44]])
        state, _ = tracker.step(state, Frame(k, k / 10), regions)
        if k in (599, 899):
            sizes[k] = len(states.save(state))
    assert sizes[899] <= sizes[599] * 1.05 + 64


def test_a_parameter_out_of_range_is_refused_by_name_value_and_range(kind):
    for declared in params.describe(kind):
        for wrong in (declared.low - 1, declared.high + 1, float("nan")):
            if declared.kind in (int, float) and wrong == wrong + 0 and np.isfinite(wrong):
                with pytest.raises(ParameterError, match=declared.name):
                    params.build(kind, {declared.name: declared.kind(wrong)})
        with pytest.raises(ParameterError, match=declared.name):
            params.build(kind, {declared.name: "nonsense" if declared.kind is not str else 3})


def test_a_tracker_is_its_own_configuration(kind):
    assert kind() == params.build(kind, params.values(kind()))
    assert repr(kind()).startswith(kind.__name__)


def rows_up_to_ids(tracks: Tracks) -> set:
    """The tracks as a set of paths, whatever their ids."""
    return {
        tuple((int(k), *np.round(box, 2).tolist()) for k, box in zip(one.frames, one.boxes, strict=True))
        for one in (tracks.of_id(identity) for identity in np.unique(tracks.ids))
    }


def _mirrored(frame: Frame, regions: Regions) -> tuple[Frame, Regions]:
    width = frame.image.shape[1]
    masks = [Mask(mask.y, width - mask.x - mask.bits.shape[1], mask.bits[:, ::-1]) for mask in regions.masks]
    boxes = regions.boxes.copy()
    boxes[:, [0, 2]] = width - regions.boxes[:, [2, 0]]
    return Frame(frame.index, frame.time, frame.image[:, ::-1]), Regions.of(boxes, masks=masks)


_X, _Y = np.float32([1, 0, 1, 0]), np.float32([0, 1, 0, 1])
