"""Track and Cut among several: who has which region, who is hidden behind whom, who leaves with whose name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from films import HEIGHT, WIDTH, Thing, film, followed, overlap, seen, texture, walker

from perdure.scene.backdrop import Backdrop
from perdure.scene.whereabouts import Waiting
from perdure.scene.zones import Zones
from perdure.trackers.trackcut.births import Nursery, births
from perdure.trackers.trackcut.competing import apart, claims, divided
from perdure.trackers.trackcut.learning import LONG, pieces
from perdure.trackers.trackcut.likelihoods import learn_colours
from perdure.trackers.trackcut.parting import parted
from perdure.trackers.trackcut.placing import Company, placed
from perdure.trackers.trackcut.seeing import look_at
from perdure.trackers.trackcut.shapes import behind, of_size, over
from perdure.trackers.trackcut.targets import RECENT, Colours, Shape, Target
from perdure.types import Frame, Mask, Regions

RED, BLUE = (170, 60, 60), (60, 60, 170)


def block(x: int, y: int, width: int, height: int) -> Mask:
    return Mask(y, x, np.ones((height, width), np.bool_))


def looks(colour: tuple[int, int, int], ground: tuple[int, int, int] = (90, 110, 90)) -> Colours:
    """The looks of something of a colour before a ground; as pictures are looked at, in Lab."""
    picture = texture(3, ground, 40, 40)
    picture[10:30, 10:30] = texture(4, colour, 20, 20)
    inside = np.zeros((40, 40), np.bool_)
    inside[10:30, 10:30] = True
    return learn_colours(look_at(picture).colours.astype(np.float32), inside, np.ones_like(inside), 3)


def target(key: int, mask: Mask, colour: tuple[int, int, int] = RED, missed: float = 0.0) -> Target:
    own = looks(colour)
    shape = Shape(float(mask.y), float(mask.x), mask.bits.astype(np.float32))
    return Target(
        key=key,
        id=key,
        mask=Mask.empty() if missed else mask,
        shape=shape,
        first=own,
        last=own,
        motions=np.full((RECENT, 2), np.nan),
        mean=float(mask.area),
        variance=0.0,
        seen_frames=30,
        born=0.0,
        missed=missed,
        missing=missed,
        unseen=int(10 * missed),
        doubted=0.0,
        partly=False,
        small=0.0,
        together=False,
        company=(),
        alone=0,
        pieces=0.0,
        squeezed=0,
        score=1.0,
        class_="",
        links=(),
        marked=False,
    )


def test_a_region_that_one_object_claims_is_all_its_own():
    region = block(10, 10, 30, 40)
    ((claim,),) = claims([block(12, 12, 20, 30)], [True], [False], [region])
    assert (claim.number, claim.part, claim.alone) == (0, region, True)


def test_a_region_that_two_claim_is_divided_by_where_they_should_be():
    left, right = block(0, 0, 30, 40), block(30, 0, 30, 40)
    ((one,), (other,)) = claims([left, right], [True, True], [False, False], [block(0, 0, 60, 40)])
    assert not one.alone
    assert not other.alone
    assert one.part.area + other.part.area >= 60 * 40  # with a band that both may have
    assert one.part.box[2] < 40
    assert other.part.box[0] > 20


def test_who_was_not_seen_takes_nothing_from_who_was():
    there, hidden = block(0, 0, 30, 40), block(5, 0, 30, 40)
    ((one,), (other,)) = claims([there, hidden], [True, False], [False, False], [block(0, 0, 40, 40)])
    assert one.alone
    assert one.part.area == 40 * 40
    assert not other.alone


def test_a_region_that_only_a_hidden_one_claims_is_hers():
    ((claim,),) = claims([block(0, 0, 30, 40)], [False], [False], [block(0, 0, 28, 40)])
    assert claim.alone


def test_of_several_regions_an_object_keeps_those_that_are_near_its_main_one():
    predicted = block(0, 0, 80, 40)
    main, near, far = block(0, 0, 30, 40), block(34, 0, 10, 40), block(60, 0, 20, 40)
    ((*kept,),) = claims([predicted], [True], [False], [main, near, far])
    assert [one.number for one in kept] == [0, 1]


def test_who_has_held_two_large_regions_for_long_keeps_one():
    predicted, main, near = block(0, 0, 80, 40), block(0, 0, 30, 40), block(34, 0, 20, 40)
    ((*kept,),) = claims([predicted], [True], [True], [main, near])
    assert [one.number for one in kept] == [0]


def test_regions_are_counted_as_two_only_after_some_frames_of_both():
    one = target(1, block(0, 0, 54, 40))
    two = claims([one.mask], [True], [False], [block(0, 0, 30, 40), block(34, 0, 20, 40)])[0]
    whole = claims([one.mask], [True], [False], [block(0, 0, 54, 40)])[0]
    for _ in range(LONG):
        assert one.pieces < LONG
        one = replace(one, pieces=pieces(one, two))
    assert one.pieces >= LONG
    assert pieces(one, whole) < one.pieces
    assert pieces(one, []) == one.pieces  # a frame without an observation tells nothing


def test_parts_of_a_region_cover_it_and_overlap_by_a_band_only():
    region = block(0, 0, 60, 40)
    parts = divided(region, [block(0, 0, 30, 40), block(30, 0, 30, 40)])
    held = sum(part.to_image(40, 60).astype(int) for part in parts)
    assert held.min() == 1
    assert 0 < (held > 1).sum() < 0.25 * region.area


@pytest.mark.parametrize(("gap", "distance"), [(0, 1.0), (7, 8.0)])
def test_the_distance_of_silhouettes_is_that_of_their_nearest_pixels(gap: int, distance: float):
    assert apart(block(0, 0, 10, 10), block(10 + gap, 0, 10, 10)) == pytest.approx(distance, rel=0.06)


def test_who_is_not_seen_to_come_out_is_still_behind():
    bits = np.ones((40, 20), np.float32)
    before = block(100, 0, 30, 40)
    moved, covered = behind(Shape(0.0, 70.0, bits), [before], True)
    assert covered
    assert moved.x + 20 >= 100 + 8
    still, hidden = behind(Shape(0.0, 70.0, bits), [before], False)
    assert (still.x, hidden) == (70.0, False)


def test_a_silhouette_is_moved_as_little_as_it_takes_to_hold_a_piece():
    shape = Shape(10.0, 10.0, np.ones((40, 20), np.float32))
    assert over(shape, block(12, 15, 5, 5)).box == shape.box
    assert over(shape, block(40, 15, 5, 5)).box == (25.0, 10.0, 45.0, 50.0)


def test_a_silhouette_among_others_keeps_its_size():
    belief = np.zeros((30, 30), np.float32)
    belief[5:25, 5:25] = np.linspace(0.3, 0.9, 400).reshape(20, 20)
    assert (of_size(belief, 300, 350) > 0.5).sum() == pytest.approx(300, abs=2)
    assert (of_size(belief, 10, 100) > 0.5).sum() == pytest.approx(100, abs=2)
    assert of_size(belief, 0, 400) is belief


def test_a_silhouette_is_laid_where_its_colours_are():
    picture = texture(1, (90, 110, 90), 60, 100)
    picture[10:40, 44:64] = texture(4, RED, 30, 20)
    belief = np.zeros((60, 100), np.float32)
    belief[10:40, 40:60] = 1
    colours = look_at(picture).colours.astype(np.float32)
    nobody = np.zeros((60, 100), np.bool_)
    across, down = placed(belief, colours, looks(RED), Company([looks(BLUE)], [], []), None, nobody)
    assert (across, down) == (4, 0)


def test_who_left_with_another_name_gets_her_own_back():
    picture = np.concatenate([texture(4, BLUE, 40, 40), texture(5, RED, 40, 40)], axis=1)
    sight = look_at(picture).colours.astype(np.float32)
    one = replace(target(1, block(0, 0, 40, 40), RED), company=(2,), alone=3)
    other = replace(target(2, block(40, 0, 40, 40), BLUE), company=(1,), alone=3)
    held = {1: sight[:, :40].reshape(-1, 3), 2: sight[:, 40:].reshape(-1, 3)}
    (first, second), events = parted([one, other], held, Frame(7, 0.7, None))
    where = {asked.id: asked.mask.x for asked in (first, second)}
    assert where == {1: 40, 2: 0}
    assert [(event.kind, set(event.ids)) for event in events] == [("exchanged", {1, 2})]
    assert not first.company
    held = {1: sight[:, 40:].reshape(-1, 3)}
    assert parted([replace(one, mask=other.mask), other], held, Frame(7, 0.7, None))[1] == []


def test_a_lost_one_is_found_again_near_and_not_at_the_other_side():
    picture = texture(1, (90, 110, 90), HEIGHT, WIDTH)
    sight = look_at(picture)
    gone = target(1, block(20, 40, 20, 40), missed=0.3)
    nursery = Nursery(20.0, 20.0, 15000, 3, 0.8, 4.0, Backdrop.unknown(HEIGHT, WIDTH))
    for x, again in ((30, True), (170, False)):
        picture = texture(1, (90, 110, 90), HEIGHT, WIDTH)
        picture[40:80, x : x + 20] = texture(4, RED, 40, 20)
        sight = look_at(picture)
        mask = block(x, 40, 20, 40)
        regions = Regions.of([mask.box], masks=[mask])
        waiting = Waiting.first(Zones(), mask, 0.4)
        born = births(nursery, [gone], (waiting,), (2, 2), Frame(5, 0.5, picture), sight, regions, [mask])
        assert born.new == (0 if again else 1)
        assert (born.targets[0].missed == 0) is again


def test_two_who_come_in_as_one_region_are_two_when_they_part():
    one = Thing(lambda k: (30 + 4 * k, 60), RED)
    other = Thing(lambda k: (54 + (4 if k < 8 else 7) * k - (0 if k < 8 else 24), 60), BLUE)
    things = (one, other)
    frames = film(*things, count=24)
    tracks, _ = followed(frames, lambda k: seen(things, k), ring=30.0)
    for thing in things:
        bits = thing.bits(22)
        assert max(overlap(tracks, 22, int(name), bits) for name in tracks.in_frame(22).ids) > 0.7


def test_who_goes_behind_another_leaves_her_the_pixels_and_the_name():
    one = Thing(lambda k: (40 + 3 * k, 60), RED)
    other = Thing(lambda k: (160 - 3 * k if k < 20 else 100 + 3 * (k - 20), 60), BLUE)
    things = (one, other)
    frames = film(*things, count=34)
    tracks, _ = followed(frames, lambda k: seen(things, k), ring=30.0)
    assert set(tracks.ids.tolist()) == {1, 2}
    for identity, thing in ((1, one), (2, other)):
        assert overlap(tracks, 8, identity, thing.bits(8)) > 0.8
    assert overlap(tracks, 33, 2, other.bits(33)) > 0.7


def test_what_nothing_supports_while_others_are_seen_is_let_go():
    ghost = Mask(20, 150, np.ones((20, 20), np.bool_))
    thing = walker(x=30, step=2)

    def regions(k: int) -> Regions:
        masks = list(seen((thing,), k).masks) + ([ghost] if k < 3 else [])
        return Regions.of([mask.box for mask in masks], masks=masks)

    tracks, _ = followed(film(thing, count=60), regions, ring=30.0)
    last = tracks.in_frame(59).counted()
    assert len(last) == 1
    assert overlap(tracks, 59, int(last.ids[0]), thing.bits(59)) > 0.7
