"""Parts of a film that were tracked by themselves, made one: in drawn worlds, of which the truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import Block, World, crossing, two_apart, walk

from perdure.fold import Corrections, settle_by_frame, track
from perdure.looks import Album, looked_at, portraits
from perdure.stitching import Join, Life, Part, Stitched, names, stitch
from perdure.stitching.joining import Chains
from perdure.trackers import TRACKERS
from perdure.trackers.multifeature.weights import looks_for
from perdure.types import Report, Tracks

RED, BLUE, GREEN = (200, 40, 40), (40, 60, 220), (30, 160, 60)


def tracked(
    world: World, begin: int, end: int, shared: list[tuple[int, int]], tracker: str
) -> tuple[Part, Tracks]:
    """A part of a world, tracked as if nothing else had ever been."""
    album = Album.empty(looks_for(world.scene))
    reports: list[Report] = []
    for step in track(world.seen()[begin:end], TRACKERS[tracker](), world.scene):
        if step.frame is not None:
            album = looked_at(album, step.frame, len(reports), step.report.rows)
        reports.append(step.report)
    looks = portraits(album, Corrections.of(reports).identity)
    settled = [rows for _, rows in settle_by_frame(lambda: reports)]
    return Part.of(begin, end, settled, shared, looks), Tracks.join(settled)


def stitched(world: World, spans: list[tuple[int, int]], tracker: str = "multifeature") -> tuple[Tracks, Stitched]:
    """The tracks of a world that was tracked in parts, by the names that identities have in the end."""
    shared = [(spans[k + 1][0], spans[k][1]) for k in range(len(spans) - 1)]
    both = [
        tracked(world, *span, [*shared[max(k - 1, 0) : k], *shared[k : k + 1]], tracker)
        for k, span in enumerate(spans)
    ]
    parts = [part for part, _ in both]
    found = stitch(parts, world.scene, looks_for(world.scene))
    told = []
    for number, (_, rows) in enumerate(both):
        first, behind = found.span(parts, number)
        told.append(rows.take((rows.frames >= first) & (rows.frames < behind)))
    firsts = [{one: int(rows.frames[rows.ids == one].min()) for one in set(rows.ids.tolist())} for rows in told]
    _, final = names(firsts, found.joins)
    named = [
        rows.replace(ids=np.array([name[one] for one in rows.ids.tolist()], np.int64))
        for rows, name in zip(told, final, strict=True)
    ]
    return Tracks.join(named), found


def ids_of(tracks: Tracks, world: World, block: int) -> list[int]:
    """The identities in the places of one block of a world, in the order in which they came, groups left out."""
    truth, found = world.truth().of_id(block), []
    single = tracks.take(~tracks.inferred & (tracks.groups == 0) & ~tracks.is_group)
    for frame, box in zip(truth.frames.tolist(), truth.boxes, strict=True):
        rows = single.in_frame(frame)
        near = np.abs(rows.boxes - box).max(axis=1) < 4
        found += [one for one in rows.ids[near].tolist() if one not in found]
    return found


@pytest.mark.parametrize("tracker", ["compound", "multifeature"])
def test_a_person_who_crosses_a_border_keeps_her_id(tracker: str):
    world = two_apart()
    tracks, found = stitched(world, [(0, 24), (14, 34), (26, 40)], tracker)
    assert ids_of(tracks, world, 1) == [1]
    assert ids_of(tracks, world, 2) == [2]
    assert [one.frames > 4 and one.score > 0.8 for one in found.joins] == [True] * 4


@pytest.mark.parametrize("spans", [[(0, 32), (20, 55)], [(0, 30), (22, 55)], [(0, 36), (28, 55)]])
def test_two_who_meet_at_a_border_do_not_exchange(spans: list[tuple[int, int]]):
    world = crossing()
    tracks, _ = stitched(world, spans)
    one, other = ids_of(tracks, world, 1), ids_of(tracks, world, 2)
    assert one[-1] == one[0]
    assert other[-1] == other[0]
    assert one[0] != other[0]


def hidden_over_a_border(colour: tuple[int, int, int]) -> World:
    """One stands still, is not seen from frame 25 to 60, and somebody of a colour is seen beside the place again."""
    first = Block(lambda k: (50, 30) if k < 25 else None, size=(12, 20), colour=RED)
    again = Block(lambda k: (58, 30) if k >= 60 else None, size=(12, 20), colour=colour)
    beside = Block(walk((5, 4), (1, 0)), size=(12, 18), colour=BLUE)
    return World((first, again, beside), count=90)


def test_who_is_hidden_over_two_borders_is_found_again_by_looks():
    world = hidden_over_a_border(RED)
    tracks, found = stitched(world, [(0, 36), (28, 52), (44, 90)])
    assert ids_of(tracks, world, 2) == ids_of(tracks, world, 1)
    assert len(set(tracks.ids.tolist())) == 2
    (join,) = (one for one in found.joins if np.isnan(one.score))
    assert (join.earlier[0], join.later[0]) == (0, 2)
    assert 3.4 < join.gap < 3.8
    assert join.odds >= 2


def test_who_looks_different_is_not_taken_for_who_was_hidden_over_a_border():
    world = hidden_over_a_border(GREEN)
    tracks, _ = stitched(world, [(0, 36), (28, 52), (44, 90)])
    assert not set(ids_of(tracks, world, 1)) & set(ids_of(tracks, world, 2))


def life(first: int, last: int, at: int) -> Life:
    box = (float(at), 10.0, float(at + 10), 30.0)
    return Life(first, first / 10, box, last, last / 10, box, "", False)


def standing(places: dict[int, int], frames: range) -> Tracks:
    """Rows of identities that stand at places (x)."""
    rows = [(frame, one, at) for frame in frames for one, at in places.items()]
    return Tracks.of(
        frames=[frame for frame, _, _ in rows],
        times=[frame / 10 for frame, _, _ in rows],
        ids=[one for _, one, _ in rows],
        boxes=[[at, 10, at + 10, 30] for _, _, at in rows],
    )


def test_two_who_were_seen_together_are_never_one_by_whatever_chain():
    """Part 1 takes two for one whom parts 0 and 2 tell apart: only one of them goes on."""
    part = [
        Part(
            0, 20, {1: life(0, 19, 50), 2: life(0, 9, 50)}, standing({1: 50}, range(10, 20)), frozenset({(1, 2)})
        ),
        Part(10, 40, {1: life(10, 39, 50)}, standing({1: 50}, range(10, 40)), frozenset()),
    ]
    scene = World((), width=120).scene
    twice = [*part, Part(30, 50, {7: life(30, 49, 50)}, standing({7: 50}, range(30, 40)), frozenset())]
    assert [(one.earlier, one.later) for one in stitch(twice, scene, ()).joins] == [
        ((0, 1), (1, 1)), ((1, 1), (2, 7)),
    ]  # fmt: skip

    chains = Chains(twice)
    assert all(chains.join(one) for one in stitch(twice, scene, ()).joins)
    assert not chains.join(Join((0, 2), (2, 7), 9, 30, 0, float("nan"), 6.0, 2.0, 6.0))


def test_a_group_is_never_one_of_its_members():
    alone, group = life(0, 19, 50), life(10, 39, 50)._replace(group=True)
    parts = [
        Part(0, 20, {1: alone}, standing({1: 50}, range(10, 20)), frozenset()),
        Part(10, 40, {1: group}, standing({1: 50}, range(10, 20)), frozenset()),
    ]
    assert stitch(parts, World((), width=120).scene, ()).joins == ()


def test_the_handover_is_where_both_parts_agree_and_else_at_three_quarters():
    quiet = Part(0, 40, {}, Tracks.empty(), frozenset()), Part(20, 60, {}, Tracks.empty(), frozenset())
    scene = World((), width=120).scene
    assert stitch(quiet, scene, ()).handovers == (35,)
    seen = standing({1: 50}, range(20, 40))
    missed = seen.take((seen.frames < 33) | (seen.frames >= 37))
    missed = Tracks.join([missed, standing({2: 90}, range(33, 37))])
    lives = {1: life(20, 39, 50), 2: life(33, 36, 90)}
    parts = [Part(0, 40, {1: life(0, 39, 50)}, seen, frozenset()), Part(20, 60, lives, missed, frozenset())]
    assert stitch(parts, scene, ()).handovers == (32,)


def test_names_count_in_the_order_in_which_identities_appear():
    said, final = names(
        [{4: 0, 2: 5}, {1: 20, 3: 25}], [Join((0, 2), (1, 3), 20, 24, 5, 0.9, float("nan"), 0.0, 9.0)]
    )
    assert final == [{4: 1, 2: 2}, {1: 3, 3: 2}]
    assert said == [{4: 1, 2: 2}, {1: 3, 3: 4}]
