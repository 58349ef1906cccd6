"""The laws of trackers hold where zones are drawn: resuming, mirroring, shifting."""

from __future__ import annotations

import typing
from dataclasses import replace

import numpy as np
import pytest
from worlds import Block, World, walk

from perdure import states
from perdure.fold import settle
from perdure.scene.zones import Rule, Zone, rectangle
from perdure.trackers import TRACKERS
from perdure.types import Frame, Regions, Report, Scene, Tracks

pytestmark = pytest.mark.parametrize("kind", TRACKERS.values(), ids=list(TRACKERS))
WIDTH, HEIGHT, DOWN = 120, 80, 7

ZONES = (
    Zone("entry", "west", rectangle(0, 0, 24, 70)),
    Zone("exit", "east", rectangle(100, 0, 120, 70), patience=0.3),
    Zone("occlusion", "post", rectangle(50, 0, 66, 70)),
    Zone("noise", "trees", rectangle(70, 0, 90, 16), evidence=0.4),
    Zone("ignore", "sky", rectangle(0, 0, 20, 12)),
    Zone("low-contrast", "shade", rectangle(26, 0, 46, 70)),
    Zone("ground", "street", rectangle(0, 10, 120, 70)),
)
RULES = (Rule("east", "west", after=1.0, within=3.0), Rule("trees", "*", never=True))


def film(kind) -> World:
    """Somebody walks in from the west, behind a post and out in the east; another flickers among the trees.

    For trackers of pixels, whose contours are not mirrored to the last digit behind a post, somebody walks by.
    """
    walker = Block(walk((5, 30), (4, 0), begin=2))
    leaf = Block(lambda k: (72, 2) if k % 7 < 5 else None, (10, 12), (40, 60, 220))
    post = Block(lambda k: (52, 20), (12, 50), (90, 90, 90))  # of the floor's colour
    blocks = (walker,) if kind.needs_pixels else (walker, leaf, post)
    return World(blocks, count=14 if kind.needs_pixels else 32, zones=ZONES, rules=RULES)


def run(tracker, seen: list[tuple[Frame, Regions]], scene: Scene) -> list[Report]:
    state, reports = tracker.start(scene), []
    for frame, regions in seen:
        state, report = tracker.step(state, frame, regions)
        reports.append(report)
    return [*reports, tracker.finish(state)]


def test_a_run_with_zones_resumed_from_a_saved_state_is_the_same_run(kind):
    tracker, world = kind(), film(kind)
    seen = world.seen()
    whole = run(tracker, seen, world.scene)
    assert any(event.zone for report in whole for event in report.events)
    state, after = tracker.start(world.scene), []
    for stop, (frame, regions) in enumerate(seen):
        if stop in (0, 3, 11, 16, 25):
            state = states.load(states.save(state), typing.get_type_hints(type(tracker).start)["return"])
        state, report = tracker.step(state, frame, regions)
        after.append(report)
    assert all(one.equals(other) for one, other in zip(whole, [*after, tracker.finish(state)], strict=True))


def test_a_mirrored_film_with_mirrored_zones_gives_mirrored_tracks_and_the_same_events(kind):
    world = film(kind)
    mirrored = [_mirrored(frame, regions) for frame, regions in bare(kind, world)]
    scene = replace(world.scene, zones=tuple(_moved(zone, lambda x, y: (WIDTH - x, y)) for zone in ZONES))
    one, other = (
        run(kind(), seen, place) for seen, place in ((bare(kind, world), world.scene), (mirrored, scene))
    )
    tracks = settle(other)
    boxes = tracks.boxes.copy()
    boxes[:, [0, 2]] = WIDTH - tracks.boxes[:, [2, 0]]
    assert paths(settle(one)) == paths(tracks.replace(boxes=boxes))
    assert happened(one) == happened(other)


def test_a_shifted_film_with_shifted_zones_gives_shifted_tracks_and_the_same_events(kind):
    world = film(kind)
    shifted = [(Frame(frame.index, frame.time), _down(regions)) for frame, regions in bare(kind, world)]
    scene = replace(world.scene, zones=tuple(_moved(zone, lambda x, y: (x, y + DOWN)) for zone in ZONES))
    plain = [(Frame(frame.index, frame.time), regions) for frame, regions in bare(kind, world)]
    one, other = run(kind(), plain, world.scene), run(kind(), shifted, scene)
    tracks = settle(other)
    assert paths(settle(one)) == paths(tracks.replace(boxes=tracks.boxes - np.float32([0, DOWN, 0, DOWN])))
    assert happened(one) == happened(other)


def bare(kind, world: World) -> list[tuple[Frame, Regions]]:
    """What is seen, as boxes alone where a tracker needs no pixels."""
    if kind.needs_pixels:
        return world.seen()
    return [(Frame(frame.index, frame.time), Regions.of(regions.boxes)) for frame, regions in world.seen()]


def happened(reports: list[Report]) -> list[tuple[str, int, str]]:
    return sorted((one.kind, one.begin, one.zone) for report in reports for one in report.events if one.zone)


def paths(tracks: Tracks) -> set:
    """The tracks as a set of paths, whatever their ids."""
    return {
        tuple((int(k), *np.round(box, 1).tolist()) for k, box in zip(one.frames, one.boxes, strict=True))
        for one in (tracks.of_id(identity) for identity in np.unique(tracks.ids))
    }


def _moved(zone: Zone, move) -> Zone:
    polygons = tuple(tuple(tuple(move(x, y) for x, y in ring) for ring in rings) for rings in zone.polygons)
    return replace(zone, polygons=polygons)


def _mirrored(frame: Frame, regions: Regions) -> tuple[Frame, Regions]:
    boxes = regions.boxes.copy()
    boxes[:, [0, 2]] = WIDTH - regions.boxes[:, [2, 0]]
    masks = [
        replace(mask, x=WIDTH - mask.x - mask.bits.shape[1], bits=mask.bits[:, ::-1]) for mask in regions.masks
    ]
    image = None if frame.image is None else frame.image[:, ::-1]
    return Frame(frame.index, frame.time, image), Regions.of(boxes, masks=masks)


def _down(regions: Regions) -> Regions:
    masks = [replace(mask, y=mask.y + DOWN) for mask in regions.masks]
    return Regions.of(regions.boxes + np.float32([0, DOWN, 0, DOWN]), masks=masks)
