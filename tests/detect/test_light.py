"""Sudden light, blindness, and what the tracker believes meanwhile, in a drawn room."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perdure import fold
from perdure.detect import Background
from perdure.detect.light import relit
from perdure.trackers.overlap import Overlap
from perdure.types import Event, Frame, Regions, Scene

SCENE = Scene(160, 120, 10)
_RNG = np.random.default_rng(5)
ROOM = 110 + cv2.GaussianBlur(_RNG.normal(0, 60, (120, 160, 3)).astype(np.float32), (0, 0), 1.5)


def film(light, count: int = 60, who=lambda k: 20 + 2 * k) -> list[Frame]:
    """Somebody walks through the room; `light(k)` multiplies the picture, a number or (H, W)."""
    rng = np.random.default_rng(1)
    frames = []
    for k in range(count):
        image = ROOM.copy()
        if (x := who(k)) is not None:
            image[40:90, x : x + 20] = (200, 40, 40)
        lit = np.broadcast_to(np.float32(light(k)), (120, 160))[..., None]
        image = image * lit + rng.normal(0, 1.0, image.shape)
        frames.append(Frame(k, k / 10, image.clip(0, 255).astype(np.uint8)))
    return frames


def steps(frames: list[Frame], detector: Background | None = None) -> list[fold.Step]:
    return list(fold.run(frames, detector or Background(), Overlap(), SCENE))[:-1]


def later_half(share: float):
    """From frame 20 on the right two thirds of the room are lit differently, with a soft edge."""
    field = np.ones((120, 160), np.float32)
    field[:, 50:] = share
    field = cv2.GaussianBlur(field, (0, 0), 6)
    return lambda k: field if k >= 20 else 1.0


def events(said: list[fold.Step], kind: str) -> list[Event]:
    return [event for step in said for event in step.report.events if event.kind == kind]


@pytest.mark.parametrize("share", [0.6, 1.5])
def test_a_light_switched_for_all_is_told_and_hides_nobody(share):
    said = steps(film(lambda k: share if k >= 20 else 1.0, who=lambda k: k * 2 if k > 2 else None))
    assert [event.begin for event in events(said, "light")] == [20]
    assert all(len(step.regions) == 1 for step in said[4:])


@pytest.mark.parametrize("share", [0.5, 1.6])
def test_a_light_switched_for_a_part_of_the_room_is_told_and_the_model_brought_to_it(share):
    said = steps(film(later_half(share), who=lambda k: 4 + 2 * k if k > 2 else None))
    (event,) = events(said, "light")
    assert event.begin == 20
    assert not any(step.regions.blind for step in said)
    assert all(len(step.regions) <= 3 for step in said[20:24])
    assert all(len(step.regions) == 1 for step in said[30:]), "the walker, and no shred of the old light"


def test_a_flash_is_waited_for_and_nobody_forgotten():
    noise = np.random.default_rng(9).uniform(0, 3, (120, 160)).astype(np.float32)
    said = steps(film(lambda k: noise if k == 30 else 1.0, who=lambda k: 2 * k if k > 2 else None))
    assert [k for k, step in enumerate(said) if step.regions.blind] == [30]
    assert {identity for step in said for identity in step.report.rows.ids.tolist()} == {1}
    assert [len(step.regions) for step in said[31:]] == [1] * 29


def test_another_picture_altogether_is_learnt_anew_within_half_a_second_and_said_so():
    frames = film(lambda k: 1.0, who=lambda k: None)
    elsewhere = np.random.default_rng(2).uniform(0, 255, (120, 160, 3)).astype(np.uint8)
    frames = [frame if frame.index < 20 else Frame(frame.index, frame.time, elsewhere) for frame in frames]
    said = steps(frames)
    assert [k for k, step in enumerate(said) if step.regions.blind] == [20, 21]
    assert [(event.begin, event.end) for event in events(said, "light")] == [(20, 20), (20, 22)]
    assert not any(len(step.regions) for step in said)


@pytest.mark.parametrize("grey", [0, 128, 255])
@pytest.mark.parametrize("long", [1, 15])
@pytest.mark.parametrize("looked", [False, True])
def test_an_empty_picture_blinds_and_the_room_is_known_when_it_is_back(grey, long, looked):
    frames = film(lambda k: 1.0, count=80, who=lambda k: 2 * k if k > 2 else None)
    empty = np.full((120, 160, 3), grey, np.uint8)
    frames = [Frame(f.index, f.time, empty) if 30 <= f.index < 30 + long else f for f in frames]
    said = steps(frames, Background().prepare(frames[::4]) if looked else None)
    assert [k for k, step in enumerate(said) if step.regions.blind] == list(range(30, 30 + long))
    assert [len(step.regions) for step in said[30 + long : 66]] == [1] * (36 - long)


@pytest.mark.parametrize("share", [0.1, 0.25])
def test_somebody_is_still_seen_in_the_dark_and_after_it(share):
    said = steps(film(lambda k: share if 30 <= k < 45 else 1.0, who=lambda k: 2 * k if k > 2 else None))
    assert all(len(step.regions) == 1 for step in said[50:])


def test_patience_does_not_run_out_while_nothing_can_be_seen():
    tracker, state = Overlap(patience=0.3), None
    state = tracker.start(SCENE)
    said = {}
    for k in range(40):
        blind = 10 <= k < 30
        regions = Regions(*vars(Regions.empty()).values()) if blind else Regions.of([[50 + k, 40, 70 + k, 90]])
        if blind:
            object.__setattr__(regions, "blind", True)
        state, report = tracker.step(state, Frame(k, k / 10), regions)
        said[k] = report.rows.in_frame(k)
    assert said[29].ids.tolist() == [1], "still expected"
    assert said[39].ids.tolist() == [1], "and found again"


def test_a_model_in_another_light_is_the_picture_in_that_light():
    field = np.linspace(0.5, 1.5, 160, dtype=np.float32)[None, :, None] * np.ones((120, 1, 1), np.float32)
    image = (ROOM * field).clip(0, 255).astype(np.uint8)
    image[40:90, 30:60] = (200, 40, 40)  # a thing; it is in the picture only
    held = np.zeros((120, 160), np.uint8)
    held[38:92, 28:62] = 1
    brought = relit(image, np.ones(3, np.float32), ROOM, held)
    assert np.abs(brought - ROOM * field).mean() < 3
    assert np.abs(brought - ROOM * field)[40:90, 30:60].mean() < 10


def standing(count: int) -> list[Frame]:
    """A suitcase is left in frame 5, beside somebody who stands and shifts her weight."""
    rng = np.random.default_rng(3)
    frames = []
    for frame in film(lambda k: 1.0, count=count, who=lambda k: None):
        image = frame.image.copy()
        if frame.index >= 5:
            image[60:80, 20:40] = (30, 60, 200)
            sway = int(rng.integers(-2, 3))
            image[30:90, 100 + sway : 120 + sway] = (200, 40, 40)
            image[30:90, 108 + sway : 112 + sway] = (240, 220, 60)
            image[40:60, 100 + sway : 104 + sway : 2] = 20
        frames.append(Frame(frame.index, frame.time, image))
    return frames


def test_the_model_does_not_learn_where_a_target_is_believed():
    detector = Background(absorb=4.0)
    believed = [step.regions for step in steps(standing(100), detector)]
    alone = [regions for _, regions in fold.detect(standing(100), detector, SCENE)]
    areas = [
        [sum(mask.area for mask in regions.masks[-1:]) for regions in seen[80:]] for seen in (believed, alone)
    ]
    assert min(areas[0]) > 0.95 * 20 * 60
    assert max(areas[1]) < 0.9 * 20 * 60, "what nobody believes sinks in"


def test_a_suitcase_is_told_from_somebody_who_stands():
    said = steps(standing(150), Background(absorb=4.0))
    (event,) = events(said, "abandoned")
    assert 44 <= event.begin <= 50
    assert event.why.startswith("at 20,60,20,20")
    assert all(len(step.regions) == 1 for step in said[60:]), "the one who stands is still seen"


def test_what_is_taken_away_is_told():
    frames = film(lambda k: 1.0, count=40, who=lambda k: 60 if k < 25 else None)
    said = steps(frames)
    (event,) = events(said, "removed")
    assert 27 <= event.begin <= 29
