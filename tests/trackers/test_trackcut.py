"""Track and Cut on drawn films: what is marked is followed, cut out, hidden, found again; then its parts."""

from __future__ import annotations

import numpy as np
import pytest
from films import (
    HEIGHT,
    WIDTH,
    Thing,
    film,
    followed,
    only_first,
    overlap,
    seen,
    walker,
)

from perdure.trackers.trackcut.cutting import contrast, touching
from perdure.trackers.trackcut.likelihoods import of_motions
from perdure.trackers.trackcut.moving import similarity
from perdure.trackers.trackcut.places import vote
from perdure.trackers.trackcut.separating import clusters
from perdure.trackers.trackcut.shapes import depth, in_window, to_shape
from perdure.trackers.trackcut.windows import Window, around
from perdure.types import Frame, Mask, Regions, Status


def test_what_is_marked_is_followed_without_a_detector():
    thing = walker()
    tracks, _ = followed(film(thing, count=30), only_first(thing))
    assert np.unique(tracks.ids).tolist() == [1]
    assert min(overlap(tracks, k, 1, thing.bits(k)) for k in range(30)) > 0.85


def test_the_camera_may_move():
    thing = walker(x=90, step=0)
    tracks, _ = followed(film(thing, count=30, pan=4), only_first(thing))
    assert min(overlap(tracks, k, 1, thing.bits(k)) for k in range(30)) > 0.85


def test_an_object_much_like_the_ground_is_held_by_its_motion():
    thing = walker(colour=(112, 124, 108))
    tracks, _ = followed(film(thing, count=25), only_first(thing))
    assert np.mean([overlap(tracks, k, 1, thing.bits(k)) for k in range(25)]) > 0.6


def test_who_passes_behind_a_post_is_found_again_with_her_id():
    thing = walker(x=30)
    post = (90, 130)
    tracks, reports = followed(film(thing, count=42, post=post), only_first(thing))
    told = [event.kind for report in reports for event in report.events]
    assert told.count("occluded") == told.count("found_again") == 1
    hidden = tracks.in_frame(27)
    assert hidden.status.tolist() == [Status.OCCLUDED]
    assert hidden.inferred.all()
    for k in (*range(12), *range(39, 42)):
        bits = thing.bits(k)
        bits[:, post[0] : post[1]] = False
        assert overlap(tracks, k, 1, bits) > 0.75


def test_who_is_not_found_again_is_lost_when_patience_ends():
    thing = Thing(lambda k: (60, 60) if k < 10 else None, (170, 60, 60))
    tracks, reports = followed(film(thing, count=40), only_first(thing), hidden_for=1.0)
    assert [event.kind for report in reports for event in report.events] == ["entered", "occluded", "lost"]
    assert tracks.frames.max() < 22


def test_whom_a_detector_sees_for_two_frames_is_somebody():
    thing = walker()
    tracks, _ = followed(film(thing, count=12), lambda k: seen((thing,), k) if k != 3 else Regions.empty())
    assert np.unique(tracks.ids).tolist() == [1]
    assert tracks.frames.min() <= 1
    assert len(tracks.in_frame(3)) == 1, "the frame without observations"


def test_observations_in_one_frame_of_three_are_enough():
    thing = walker()
    tracks, _ = followed(film(thing, count=20), lambda k: seen((thing,), k) if k % 3 == 1 else Regions.empty())
    assert np.unique(tracks.ids).tolist() == [1]
    assert min(overlap(tracks, k, 1, thing.bits(k)) for k in range(5, 20)) > 0.8


def test_the_row_names_the_observations_that_the_cut_matched():
    thing = walker()
    tracks, _ = followed(film(thing, count=12), lambda k: seen((thing,), k))
    assert tracks.in_frame(8).links == ((0,),)


def test_two_who_cross_keep_their_ids_and_share_no_pixel():
    red = Thing(lambda k: (30 + 4 * k, 52), (180, 60, 60))
    blue = Thing(lambda k: (170 - 4 * k, 68), (60, 70, 190))
    things = (red, blue)
    tracks, _ = followed(film(*things, count=36), lambda k: seen(things, k))
    for k in (5, 34):
        assert overlap(tracks, k, 1, red.bits(k) & ~blue.bits(k)) > 0.75
        assert overlap(tracks, k, 2, blue.bits(k)) > 0.75
    for k in range(36):
        masks = tracks.in_frame(k).masks
        assert (
            sum(mask.area for mask in masks)
            == np.sum([mask.to_image(HEIGHT, WIDTH) for mask in masks], axis=0).astype(bool).sum()
        )


def test_a_blind_frame_keeps_only_the_prediction():
    thing = walker()
    frames = film(thing, count=14)
    dark = Frame(8, 0.8, (frames[8].image // 4).astype(np.uint8))
    frames[8] = dark
    blind = Regions(
        *(getattr(Regions.empty(), name) for name in ("boxes", "scores", "classes", "masks")), blind=True
    )
    tracks, _ = followed(frames, lambda k: blind if k == 8 else seen((thing,), k))
    assert np.unique(tracks.ids).tolist() == [1]
    assert overlap(tracks, 13, 1, thing.bits(13)) > 0.8


@pytest.mark.parametrize("cover", ["everything", "one pixel", "one colour"])
def test_strange_marks_and_pictures_are_borne(cover: str):
    bits = np.zeros((HEIGHT, WIDTH), bool)
    bits[(slice(None),) if cover == "everything" else (slice(60, 61), slice(60, 61))] = True
    mask = Mask.of_image(bits)
    mark = Regions.of([mask.box], masks=[mask], data={"mark": np.array([4])})
    frames = film(count=6)
    if cover == "one colour":
        frames = [Frame(k, k / 10, np.full((HEIGHT, WIDTH, 3), 80, np.uint8)) for k in range(6)]
    tracks, _ = followed(frames, lambda k: mark if k == 0 else Regions.empty())
    assert set(tracks.ids.tolist()) <= {4}


@pytest.mark.parametrize("silhouettes", [True, False], ids=["silhouettes", "boxes"])
@pytest.mark.parametrize("smallest", [0.0004, 0.0])
def test_observations_that_leave_the_picture_are_cut_at_its_edge(silhouettes: bool, smallest: float):
    thing = walker(x=150, step=4)  # goes out on the right in frame 10
    wide = [(150, 30, 4000, 90), (-300, 20, -200, 60), (20, 20, 20, 20), (-1e6, -1e6, 1e6, 1e6)]

    def observed(k: int) -> Regions:
        if k < 5:
            return seen((thing,), k)
        if not silhouettes:
            return Regions.of(wide)
        masks = [Mask(30, 150, np.ones((60, 900), bool)), Mask(20, -300, np.ones((40, 100), bool))]
        return Regions.of([mask.box for mask in masks], masks=masks)

    tracks, _ = followed(film(thing, count=20), observed, smallest=smallest)
    assert 1 in tracks.ids
    assert all(mask.box[2] <= WIDTH and mask.box[0] >= 0 for mask in tracks.masks if mask.area)


def test_a_mark_says_the_id_and_marking_again_corrects_the_mask():
    thing = walker()
    wrong = Thing(lambda k: (150, 60), (170, 60, 60))

    def marks(k: int) -> Regions:
        if k not in (0, 5):
            return Regions.empty()
        mask = Mask.of_image((wrong if k == 0 else thing).bits(k))
        return Regions.of([mask.box], masks=[mask], data={"mark": np.array([9])})

    tracks, _ = followed(film(thing, count=12), marks)
    assert np.unique(tracks.ids).tolist() == [9]
    assert overlap(tracks, 11, 9, thing.bits(11)) > 0.8


def beside(things: tuple[Thing, ...], k: int, frame: int, identity: int = 3) -> Regions:
    """What a detector sees; in one frame the last thing is marked, and goes before the others."""
    if k != frame:
        return seen(things, k)
    masks = [Mask.of_image(thing.bits(k)) for thing in things[::-1]]
    marks = np.array([identity, *[0] * (len(masks) - 1)])
    return Regions.of([mask.box for mask in masks], masks=masks, data={"mark": marks})


def test_what_is_marked_beside_a_detector_is_followed_and_the_others_are_found():
    red, blue = walker(y=30), walker(y=90, colour=(60, 70, 190))
    tracks, _ = followed(film(red, blue, count=14), lambda k: beside((red, blue), k, 0), reserved=3)
    assert overlap(tracks, 13, 3, blue.bits(13)) > 0.8
    assert overlap(tracks, 13, 4, red.bits(13)) > 0.8
    assert np.unique(tracks.ids).tolist() == [3, 4]


def test_who_is_marked_late_gets_the_marks_id_and_nobody_has_had_it():
    red, blue = walker(y=30), walker(y=90, colour=(60, 70, 190))
    tracks, reports = followed(film(red, blue, count=16), lambda k: beside((red, blue), k, 8), reserved=3)
    assert 3 not in tracks.ids[tracks.frames < 8]
    assert [len(tracks.in_frame(k)) for k in (7, 8, 15)] == [2, 2, 2]
    assert overlap(tracks, 15, 3, blue.bits(15)) > 0.8
    red_one = next(int(one) for one in tracks.in_frame(7).ids if overlap(tracks, 7, int(one), red.bits(7)) > 0.8)
    assert overlap(tracks, 15, red_one, red.bits(15)) > 0.8
    told = [(event.kind, event.ids) for report in reports for event in report.events]
    assert told.count(("entered", (3,))) == 1


# ---- parts ------------------------------------------------------------------------------------------------------


def test_a_window_of_cells_gives_back_the_mask():
    mask = Mask.of_image(walker().bits(0))
    for cells in (10**6, 3000, 900):
        window = around([mask.box], 10, cells, (HEIGHT, WIDTH))
        assert np.prod(window.shape) <= 1.4 * cells
        again = window.to_mask(window.of_mask(mask) > 0.5, HEIGHT, WIDTH)
        one, other = mask.to_image(HEIGHT, WIDTH), again.to_image(HEIGHT, WIDTH)
        assert (one & other).sum() / (one | other).sum() >= 1 - 0.08 * (window.step - 1)


def test_contrast_costs_less_where_colours_differ_and_diagonals_less_than_sides():
    colours = np.zeros((6, 8, 3), np.float32)
    colours[:, 4:] = 100.0
    costs, sigma = contrast(colours, 10.0)
    assert sigma > 0
    assert costs[0, 2, 3] < 0.5 * costs[0, 2, 1] == pytest.approx(5.0)
    assert costs[2, 2, 1] == pytest.approx(10.0 / np.sqrt(2))


def test_a_similarity_is_found_though_a_third_moves_otherwise():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, 50, 300).astype(np.float32), rng.uniform(0, 80, 300).astype(np.float32)
    flow = np.stack(
        [3 + 0.02 * (x - x.mean()) - 0.01 * (y - y.mean()), -1 + 0.01 * (x - x.mean()) + 0.02 * (y - y.mean())], 1
    )
    flow[::3] = (-6, 8)
    found, middle = similarity(x, y, flow.astype(np.float32))
    np.testing.assert_allclose(found, [3, -1, 0.02, 0.01], atol=0.15)
    assert middle == pytest.approx((x.mean(), y.mean()))


def test_a_shape_is_carried_by_its_similarity():
    window = Window(0, 0, 60, 60, 1)
    inside = np.zeros((60, 60), np.float32)
    inside[20:40, 10:30] = 1.0
    moved = in_window(to_shape(inside, window), window, (np.array([5.0, -3.0, 0.0, 0.0]), (30.0, 30.0)))
    np.testing.assert_array_equal(moved > 0.5, np.roll(inside, (-3, 5), (0, 1)) > 0.5)


def test_motion_speaks_for_what_moves_with_the_object_and_against_what_rests():
    flow = np.zeros((4, 6, 2), np.float32)
    flow[:, 3:] = (4.0, 0.0)
    sure = np.zeros((4, 6), bool)
    sure[1:3, 4] = True
    said = of_motions(flow, sure, 4.0)
    assert said[0, 5] > 2 > -2 > said[0, 0]
    np.testing.assert_array_equal(of_motions(flow, np.zeros_like(sure), 4.0), 0)


def test_colours_speak_where_they_were():
    before = np.zeros((64, 64, 3), np.uint8)
    before[:, 32:] = 200
    own = np.zeros((64, 64), bool)
    own[:, 32:] = True
    said = vote(before, own, before, 4.0)
    assert said[10, 60] > 1 > -1 > said[10, 5]
    unseen = np.full((64, 64, 3), 100, np.uint8)
    np.testing.assert_allclose(vote(before, own, unseen, 4.0), 0, atol=1e-6)


def test_masks_hang_together_by_common_pixels():
    one, other, third = (Mask(0, x, np.ones((4, 4), bool)) for x in (0, 3, 20))
    assert clusters([one, other, third]) == [[0, 1]]
    assert clusters([one, third]) == []


def test_parts_that_touch_nothing_that_was_expected_are_left_out():
    cells = np.zeros((5, 9), bool)
    cells[1:3, 1:3] = cells[1:3, 6:8] = True
    anchors = np.zeros_like(cells)
    anchors[2, 2] = True
    assert touching(cells, anchors).sum() == 4


def test_depth_is_positive_inside_and_far_where_there_is_nothing():
    inside = np.zeros((9, 9), bool)
    assert (depth(inside) < 0).all()
    inside[3:6, 3:6] = True
    assert depth(inside)[4, 4] > 1 > -1 > depth(inside)[0, 0]


def test_what_shines_through_a_hole_that_the_detector_filled_is_not_the_objects():
    disc = Thing(lambda k: (-30 + 4 * k, 60), (170, 60, 60), (40, 60))
    hole = disc._replace(size=(18, 28))
    frames = [
        Frame(one.index, one.time, np.where(hole.bits(one.index)[..., None], ground.image, one.image))
        for one, ground in zip(film(disc, count=45), film(count=45), strict=True)
    ]
    means = []
    for weight in (0.0, 2.0):
        tracks, _ = followed(frames, lambda k: seen((disc,), k), backdrop=weight)
        assert set(tracks.ids.tolist()) == {1}
        means.append(np.mean([overlap(tracks, k, 1, disc.bits(k) & ~hole.bits(k)) for k in range(20, 45)]))
    assert means[0] < 0.95 < means[1], means
