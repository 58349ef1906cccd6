import warnings

import numpy as np
import pytest

from perdure.draw import Trails, colour_of, paint
from perdure.types import Frame, Ground, Mask, Outline, Scene, Status, Tracks

SCENE = Scene(160, 120)


def ground(grey: int, width: int = 160, height: int = 120) -> np.ndarray:
    return np.full((height, width, 3), grey, np.uint8)


def rows_of(boxes, frame: int = 0, **columns) -> Tracks:
    ids = columns.pop("ids", range(1, len(boxes) + 1))
    return Tracks.of(frames=frame, times=frame / 10, ids=list(ids), boxes=boxes, **columns)


def changed(picture: np.ndarray, grey: int) -> np.ndarray:
    return (picture != grey).any(axis=2)


def test_the_frame_stays_as_it_was_and_the_picture_is_new():
    image = ground(90)
    frame = Frame(3, 0.3, image)
    picture = paint(frame, rows_of([[40, 30, 80, 90]]), Trails.empty(), SCENE)
    assert (image == 90).all()
    assert picture.shape == image.shape
    assert picture.dtype == np.uint8
    assert not np.shares_memory(picture, image)


@pytest.mark.parametrize("grey", [0, 70, 128, 190, 255])
def test_a_box_stands_out_from_any_ground(grey):
    picture = paint(Frame(0, 0.0, ground(grey)), rows_of([[40, 30, 120, 90]]), Trails.empty(), SCENE).astype(int)
    across_the_left_edge = picture[60, 36:45]
    assert np.abs(across_the_left_edge - grey).max() > 80


def test_the_same_input_gives_the_same_picture():
    rows = rows_of([[10, 10, 50, 100], [30, 20, 90, 80]], status=[Status.PARTLY_OCCLUDED, Status.LOST])
    trails = Trails.empty().extended(rows, 0.0).extended(rows_of([[15, 10, 55, 100]]), 0.1)
    one, other = (paint(Frame(1, 0.1, ground(120)), rows, trails, SCENE) for _ in range(2))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("status", list(Status))
def test_every_status_is_drawn_and_a_hidden_one_with_less_ink(status):
    def ink(one: Status) -> int:
        rows = rows_of([[40, 30, 120, 100]], status=[one])
        return int(
            changed(paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE), 128)[32:98, 35:125].sum()
        )

    assert 0 < ink(status) <= ink(Status.VISIBLE)
    if status in (Status.LOST, Status.OCCLUDED, Status.AMBIGUOUS):
        assert ink(status) < ink(Status.VISIBLE)


def test_a_lost_one_is_sparser_than_an_occluded_one():
    def drawn(status: Status) -> int:
        rows = rows_of([[20, 20, 140, 110]], status=[status])
        picture = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE)
        return int((picture[45:85, 20] != 128).any(axis=1).sum())

    assert drawn(Status.LOST) < drawn(Status.OCCLUDED)


def test_only_the_hidden_side_of_a_partly_occluded_box_is_dashed():
    rows = rows_of([[40, 20, 120, 100]], status=[Status.PARTLY_OCCLUDED], hidden_side=["right"])
    picture = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE)
    colour = np.array(colour_of(1))

    def share_of(column: int) -> float:
        return float((np.abs(picture[30:90, column] - colour).max(axis=1) < 12).mean())

    assert share_of(40) == 1.0
    assert 0.3 < share_of(119) < 0.9


def test_a_silhouette_is_tinted_inside_and_left_out_on_demand():
    bits = np.ones((30, 20), bool)
    rows = rows_of([[60, 40, 80, 70]], masks=[Mask(40, 60, bits)])
    frame = Frame(0, 0.0, ground(128))
    assert changed(paint(frame, rows, Trails.empty(), SCENE), 128)[45:65, 65:75].all()
    assert not changed(paint(frame, rows, Trails.empty(), SCENE, masks=False), 128)[45:65, 65:75].any()


def block(x: int, y: int, width: int, height: int) -> Mask:
    return Mask(y, x, np.ones((height, width), bool))


def blended(identity: int, grey: int) -> np.ndarray:
    """What a pixel of a silhouette looks like: three quarters of the picture, one of the id's colour."""
    return 0.74 * grey + 0.26 * np.array(colour_of(identity))


def painted(rows: Tracks, grey: int = 128) -> np.ndarray:
    return paint(Frame(0, 0.0, ground(grey)), rows, Trails.empty(), SCENE)


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_pixels_of_a_silhouette_are_blended_with_the_colour_of_its_id(grey):
    masks = [block(20, 40, 24, 40), block(100, 40, 24, 40)]
    picture = painted(rows_of([[10, 30, 54, 90], [90, 30, 134, 90]], ids=[3, 8], masks=masks), grey)
    for identity, mask in zip((3, 8), masks, strict=True):
        x1, y1, x2, y2 = mask.box
        inside = picture[y1 + 3 : y2 - 3, x1 + 3 : x2 - 3].reshape(-1, 3)
        assert np.abs(inside - blended(identity, grey)).max() <= 1
    assert (picture[45:85, 60:85] == grey).all()  # between the two
    assert (picture[50:80, 46:50] == grey).all()  # in the box and not of the silhouette


def test_an_outline_runs_round_a_silhouette_and_round_a_hole_in_it():
    bits = np.ones((50, 50), bool)
    bits[20:34, 18:32] = False
    picture = painted(rows_of([[40, 20, 110, 100]], ids=[5], masks=[Mask(35, 50, bits)]))
    colour = np.array(colour_of(5))
    for y, x in ((60, 50), (60, 99), (35, 75), (84, 75)):  # its left, right, upper and lower edge
        assert np.abs(picture[y, x] - colour).max() <= 12, (y, x)
    assert np.abs(picture[62, 67] - colour).max() <= 20  # left of the hole
    assert (picture[58:66, 71:79] == 128).all()  # the hole itself


def test_a_row_without_a_silhouette_looks_as_if_no_other_had_one():
    boxes = [[10, 30, 50, 90], [100, 30, 140, 90]]
    both = painted(rows_of(boxes, masks=[Mask.empty(), block(105, 40, 20, 40)]))
    bare = painted(rows_of(boxes))
    assert np.array_equal(both[:, :80], bare[:, :80])
    assert not np.array_equal(both[:, 80:], bare[:, 80:])


@pytest.mark.parametrize("box", [(-12, 40, 30, 40), (140, 40, 40, 40), (60, -9, 30, 30), (60, 100, 30, 50)])
def test_a_silhouette_that_leaves_the_picture_is_cut_at_its_edge(box):
    x, y, width, height = box
    picture = painted(rows_of([[x, y, x + width, y + height]], ids=[4], masks=[block(*box)]))
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + width, 160), min(y + height, 120)
    middle = picture[(top + bottom) // 2, (left + right) // 2]
    assert np.abs(middle - blended(4, 128)).max() <= 1
    across = (slice(None), slice(0, 30)) if x > 100 else (slice(None), slice(120, 160))
    marks = changed(picture, 128)
    marks[100:, :60] = False  # the clock
    assert not marks[across].any()  # nothing comes in again on the other side


def test_a_silhouette_wholly_outside_changes_nothing():
    boxes = [[10, 30, 50, 90]]
    bare = painted(rows_of(boxes))
    for place in ((-40, 10), (170, 10), (60, -50), (60, 130), (10**6, 0)):
        assert np.array_equal(painted(rows_of(boxes, masks=[block(*place, 20, 30)])), bare)


def test_who_is_hidden_has_a_dotted_outline_and_no_fill():
    rows = rows_of([[40, 20, 120, 100]], status=[Status.OCCLUDED], believed=[block(55, 35, 50, 50)])
    picture = painted(rows)
    assert (picture[45:75, 65:95] == 128).all()
    along = changed(picture, 128)[40:80, 55]
    assert 0.2 < along.mean() < 0.9


def test_a_hidden_half_that_is_believed_is_dotted():
    seen, whole = Mask(40, 60, np.ones((40, 20), bool)), Mask(40, 60, np.ones((40, 60), bool))
    columns = {"status": [Status.PARTLY_OCCLUDED], "masks": [seen]}
    frame = Frame(0, 0.0, ground(128))
    with_belief = paint(frame, rows_of([[50, 30, 130, 90]], believed=[whole], **columns), Trails.empty(), SCENE)
    without = paint(frame, rows_of([[50, 30, 130, 90]], **columns), Trails.empty(), SCENE)
    assert changed(with_belief, 128)[45:75, 119].any()
    assert not changed(without, 128)[45:75, 119].any()


def test_boxes_and_silhouettes_outside_the_picture_do_no_harm():
    boxes = [
        [-500, -500, -400, -400],
        [-30, 50, 20, 200],
        [150, 110, 5e8, 9e8],
        [1e6, 0, 1e6 + 5, 9],
        [30, 30, 30, 30],
    ]
    masks = [Mask(-5, -20, np.ones((40, 60), bool)), Mask(100, 140, np.ones((60, 60), bool))]
    rows = rows_of(boxes, masks=[Mask.empty(), *masks, Mask(900, 900, np.ones((2, 2), bool)), Mask.empty()])
    trails = Trails.empty().extended(rows, 0.0).extended(rows, 0.1)
    for image in (ground(128), None):
        assert paint(Frame(1, 0.2, image), rows, trails, SCENE).shape == (120, 160, 3)


def test_a_row_outside_the_picture_leaves_no_mark():
    frame = Frame(0, 0.0, ground(128))
    nothing = paint(frame, Tracks.empty(), Trails.empty(), SCENE)
    assert np.array_equal(paint(frame, rows_of([[-60, 10, -1, 40]]), Trails.empty(), SCENE), nothing)


def test_without_an_image_the_boxes_are_filled_on_a_dark_canvas():
    rows = rows_of([[40, 30, 80, 90]])
    picture = paint(Frame(0, 0.0), rows, Trails.empty(), SCENE)
    assert picture.shape == (120, 160, 3)
    assert picture.mean() < 60
    assert (picture[60, 60] > picture[60, 120]).any()


@pytest.mark.parametrize("size", [(1, 1), (16, 16), (3, 200), (200, 3), (1080, 1920)])
def test_pictures_of_any_size_are_painted(size):
    height, width = size
    scene = Scene(width, height)
    rows = rows_of([[0, 0, width, height], [width / 4, height / 4, width / 2, height / 2]], groups=[2, 0])
    trails = Trails.empty().extended(rows, 0.0).extended(rows, 0.1)
    for image in (ground(100, width, height), None):
        assert paint(Frame(9, 0.1, image), rows, trails, scene).shape == (height, width, 3)


def test_no_rows_leave_only_the_clock():
    picture = paint(Frame(12, 0.5, ground(128)), Tracks.empty(), Trails.empty(), SCENE)
    marks = changed(picture, 128)
    assert marks[90:, :110].any()
    assert not marks[:90].any()
    assert not marks[:, 110:].any()


def test_a_group_is_bracketed_and_names_its_members():
    # 7 is the group of 3 and 4; the middle of its edges stays open
    rows = rows_of([[60, 40, 75, 80], [80, 40, 95, 80], [55, 30, 100, 85]], ids=[3, 4, 7], groups=[7, 7, 0])
    picture = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE)
    marks = changed(picture, 128)
    assert marks[28:34, 50:58].any()
    assert not marks[55:60, 49:54].any()
    alone = paint(Frame(0, 0.0, ground(128)), rows.take([2]), Trails.empty(), SCENE)
    assert changed(alone, 128)[55:60, 54:57].any()  # without members it is a box like others


def test_labels_of_two_who_stand_together_do_not_cover_one_another():
    apart = rows_of([[40, 40, 60, 100], [100, 40, 120, 100]])
    together = rows_of([[60, 40, 80, 100], [61, 40, 81, 100]])

    def chips(rows: Tracks) -> list[int]:
        picture = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE)
        paper = [np.array(colour_of(identity)) * 0.92 + 128 * 0.08 for identity in (1, 2)]
        return [int((np.abs(picture - colour).max(axis=2) <= 2).sum()) for colour in paper]

    assert all(count > 20 for count in chips(together))
    assert chips(together) == pytest.approx(chips(apart), abs=12)


def test_a_label_stays_in_the_picture():
    for box in ([-20, -20, 6, 6], [150, -5, 190, 20], [-9, 112, 5, 150], [155, 115, 170, 140]):
        picture = paint(Frame(0, 0.0, ground(128)), rows_of([box]), Trails.empty(), SCENE)
        paper = np.array(colour_of(1)) * 0.92 + 128 * 0.08
        assert int((np.abs(picture - paper).max(axis=2) <= 2).sum()) > 40


def test_a_trail_is_the_way_of_the_feet_and_forgets_what_is_old():
    trails = Trails.empty()
    for frame in range(60):
        trails = trails.extended(rows_of([[frame, 10, frame + 10, 40]], frame), frame / 10, keep=2.0)
    assert trails.points[-1].tolist() == [64.0, 40.0]
    assert 3.85 < trails.times.min() < 4.05
    assert len(trails.ids) in (20, 21)


def test_a_trail_is_not_changed_by_seeing_a_frame_twice_or_by_winding_back():
    first = Trails.empty().extended(rows_of([[0, 0, 10, 20]]), 0.0)
    twice = first.extended(rows_of([[4, 0, 14, 20]]), 0.1).extended(rows_of([[4, 0, 14, 20]]), 0.1)
    assert twice.points.tolist() == [[5.0, 20.0], [9.0, 20.0]]
    assert twice.extended(rows_of([[0, 0, 10, 20]]), 0.0).times.tolist() == [0.0]
    assert first.times.tolist() == [0.0]


def test_groups_and_the_lost_leave_no_trail():
    rows = rows_of([[0, 0, 9, 9]] * 3, ids=[1, 2, 9], groups=[9, 0, 0], status=[0, Status.LOST, 0])
    assert Trails.empty().extended(rows, 0.0).ids.tolist() == [1]


def test_a_trail_fades_from_the_feet_backwards():
    trails = Trails.empty()
    for frame in range(31):
        trails = trails.extended(rows_of([[3 * frame, 30, 3 * frame + 40, 70]], frame), frame / 10)
    picture = paint(Frame(30, 3.0, ground(20)), Tracks.empty(), trails, SCENE).astype(int)
    along = picture[70, 20:110].max(axis=1)
    assert along[-6:].mean() > along[45:50].mean() > along[2:8].mean() > 20


def test_neighbouring_ids_have_colours_far_apart_and_none_is_too_dark():
    colours = np.array([colour_of(identity) for identity in range(1, 200)], float)
    assert np.linalg.norm(np.diff(colours, axis=0), axis=1).min() > 60
    assert np.linalg.norm(colours[2:] - colours[:-2], axis=1).min() > 40
    assert (colours @ (0.299, 0.587, 0.114)).min() > 90
    assert colour_of(10**9) == colour_of(10**9)


def test_painting_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paint(Frame(0, 0.0, ground(0)), rows_of([[1, 1, 30, 30]]), Trails.empty(), SCENE)


def test_a_contour_is_solid_where_it_is_seen_and_dashed_where_it_is_believed():
    scene = Scene(320, 240)
    outline = Outline.of([[[30, 30], [290, 30], [290, 200], [30, 200]]])
    seen = Mask(30, 30, np.ones((170, 100), bool))
    rows = rows_of([[30, 30, 130, 200]], masks=[seen], outlines=[outline])
    picture = paint(Frame(0, 0.0, ground(128, 320, 240)), rows, Trails.empty(), scene)

    def coloured(part: np.ndarray, along: int) -> np.ndarray:
        return (np.abs(part.astype(int) - colour_of(1)).max(axis=2) < 40).any(axis=1 - along)

    assert coloured(picture[198:202, 40:120], 1).all()
    dashed = coloured(picture[40:190, 287:292], 0)
    assert 0.3 < dashed.mean() < 0.8
    assert np.diff(np.flatnonzero(dashed)).max() < 12
    assert not changed(picture, 128)[40:190, 140:280].any()  # nothing inside


def test_a_contour_of_which_nothing_is_seen_is_dashed_all_round_and_may_leave_the_picture():
    outline = Outline.of([[[-40, 20], [60, 20], [60, 90], [-40, 90]], [[900, 0], [990, 0], [990, 90]]])
    rows = rows_of([[-40, 20, 60, 90]], status=[Status.OCCLUDED], outlines=[outline])
    picture = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE)
    hidden = paint(Frame(0, 0.0, ground(128)), rows, Trails.empty(), SCENE, masks=False)
    assert (picture != hidden).any()


def test_a_known_speed_is_written_beside_the_id():
    def picture(*ground):
        return paint(
            Frame(0, 0.0, np.zeros((120, 160, 3), np.uint8)),
            rows_of([[40, 50, 80, 110]], ground=ground),
            Trails.empty(),
            SCENE,
        )

    plain = picture(None)
    assert np.array_equal(picture(Ground(3.0, 4.0)), plain)  # a place alone is not drawn
    assert changed(picture(Ground(3.0, 4.0, 1.4)), 0).sum() > changed(plain, 0).sum() + 50
