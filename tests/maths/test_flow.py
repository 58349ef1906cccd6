"""Flow and the camera's motion, on pictures whose motion is known."""

import cv2
import numpy as np
import pytest

from perdure.errors import ParameterError
from perdure.maths.flow import dense, global_motion, sparse, warp


def textured(seed: int = 0, shape: tuple[int, int] = (180, 240), fine: float = 2.0) -> np.ndarray:
    """Blobs of several sizes, as pictures have: coarse ones lead the way on the pyramid."""
    rng = np.random.default_rng(seed)
    blurred = [cv2.GaussianBlur(rng.normal(0, 1, shape), (0, 0), fine * 3**k) * 2**k for k in range(3)]
    return cv2.normalize(sum(blurred), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def about(angle: float, scale: float, dx: float = 0.0, dy: float = 0.0) -> np.ndarray:
    """A turn and a zoom about the middle of a picture of 240x180, then a shift."""
    affine = cv2.getRotationMatrix2D((120, 90), angle, scale)
    affine[:, 2] += dx, dy
    return affine


def displaced(affine: np.ndarray, shape: tuple[int, int] = (180, 240)) -> np.ndarray:
    """By how much (H, W, 2) what is now at a pixel was displaced."""
    back = cv2.invertAffineTransform(affine)
    now = np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), axis=-1)
    return now - (now @ back[:, :2].T + back[:, 2])


MOTIONS = [about(0, 1, 5, -3), about(0, 1, 0.4, 0.7), about(3, 1), about(0, 1.04), about(-2, 0.97, -6, 2)]
flows = pytest.mark.parametrize("flow", [sparse, dense], ids=["sparse", "dense"])


@flows
@pytest.mark.parametrize("affine", MOTIONS)
def test_vectors_are_how_far_what_is_now_there_has_come(flow, affine):
    picture = textured()
    found = flow(picture, warp(picture, affine))
    middle = np.s_[20:-20, 20:-20]
    off = np.linalg.norm(found.vectors - displaced(affine), axis=-1)[middle]
    assert found.valid[middle].mean() > 0.7
    assert np.median(off[found.valid[middle]]) < 0.3
    assert found.vectors.dtype == np.float32
    assert not found.vectors[~found.valid].any()


@flows
def test_what_has_just_come_into_sight_has_no_past(flow):
    """A square moves right by 12 pixels over ground that stands still, and uncovers a strip of it."""
    ground, square = textured(1), textured(2, (70, 70))
    before, now = ground.copy(), ground.copy()
    before[50:120, 80:150] = square
    now[50:120, 92:162] = square
    found = flow(before, now)
    uncovered, on_it, far = np.s_[60:110, 82:90], np.s_[60:110, 102:152], np.s_[140:170, 30:200]
    assert found.valid[uncovered].mean() < 0.4
    assert found.valid[on_it].mean() > 0.6
    np.testing.assert_allclose(np.median(found.vectors[on_it][found.valid[on_it]], axis=0), [12, 0], atol=0.2)
    assert found.valid[far].mean() > 0.6
    np.testing.assert_allclose(np.median(found.vectors[far][found.valid[far]], axis=0), [0, 0], atol=0.05)


@flows
def test_of_flat_pictures_nothing_is_known(flow):
    for shape in ((60, 80), (12, 12), (1, 1), (3, 0), (0, 0)):
        flat = np.full(shape, 99, np.uint8)
        found = flow(flat, flat)
        assert found.vectors.shape == (*shape, 2)
        assert not found.valid.any()


@flows
def test_a_picture_that_stands_still_has_vectors_of_no_length(flow):
    picture = textured()
    found = flow(picture, picture)
    assert found.valid.mean() > 0.7
    assert np.abs(found.vectors).max() < 0.02


@flows
def test_pictures_stay_as_they_are_and_give_the_same_bytes_with_any_number_of_threads(flow):
    before, now = textured(), warp(textured(), about(2, 1.02, 3, 1))
    kept, threads = (before.copy(), now.copy()), cv2.getNumThreads()
    said = []
    for number in (1, 2, 3):
        cv2.setNumThreads(number)
        found = flow(before, now)
        said.append(found.vectors.tobytes() + found.valid.tobytes() + global_motion(before, now).tobytes())
    cv2.setNumThreads(threads)
    assert said[0] == said[1] == said[2]
    np.testing.assert_array_equal((before, now), kept)


def test_sparse_vectors_are_where_the_contrast_is():
    ground = np.full((120, 160), 90, np.uint8)
    before, now = ground.copy(), ground.copy()
    before[40:80, 40:80] = textured(3, (40, 40))
    now[42:82, 43:83] = textured(3, (40, 40))
    found = sparse(before, now, step=2)
    assert found.valid[50:75, 50:75].mean() > 0.8
    assert not found.valid[:, 100:].any()


def test_without_a_way_back_valid_is_what_comes_from_inside_the_picture():
    before, now = textured(), warp(textured(), about(2, 1.02, 3, 1))
    one, other = dense(before, now, astray=np.inf), dense(before, now, astray=1e6)
    np.testing.assert_array_equal(one.vectors, other.vectors)
    np.testing.assert_array_equal(one.valid, other.valid)
    assert 0.9 < one.valid.mean() < 1.0


def test_along_a_straight_edge_nothing_is_claimed():
    before, now = np.zeros((2, 120, 160), np.uint8)
    before[:, 80:] = 200
    now[:, 82:] = 200
    assert not sparse(before, now).valid.any()


@pytest.mark.parametrize("step", [1, 2, 3, 4])
def test_each_point_of_the_lattice_speaks_for_its_square(step):
    picture = textured(shape=(61, 83))
    found = sparse(picture, warp(picture, about(0, 1, 2, 1)), step=step)
    for y in range(10, 40, step):
        for x in range(10, 40, step):
            square = np.s_[y // step * step : (y // step + 1) * step, x // step * step : (x // step + 1) * step]
            assert (found.vectors[square] == found.vectors[square][:1, :1]).all()


def test_where_no_flow_is_wanted_there_is_none():
    picture, wanted = textured(), np.zeros((180, 240), bool)
    wanted[40:100, 60:130] = True
    now = warp(picture, about(0, 1, 2, 1))
    everywhere, there = sparse(picture, now, contrast=0.0), sparse(picture, now, contrast=0.0, where=wanted)
    assert not there.valid[~wanted].any()
    assert there.valid[wanted].mean() > 0.9
    np.testing.assert_array_equal(there.vectors[there.valid], everywhere.vectors[there.valid])


@pytest.mark.parametrize("affine", MOTIONS)
def test_the_camera_s_motion_is_found_in_spite_of_what_moves_by_itself(affine):
    previous, stranger = textured(4), textured(5, (90, 110))
    current = warp(previous, affine)
    previous[60:150, 20:130] = stranger  # a quarter of the picture goes its own way
    current[50:140, 40:150] = stranger
    found = global_motion(previous, current)
    corners = np.array([[0, 0, 1], [239, 0, 1], [0, 179, 1], [239, 179, 1]])
    assert np.abs(corners @ (found - affine).T).max() < 0.5


def test_what_is_excluded_may_be_most_of_the_picture():
    previous, stranger = textured(4), textured(5, (180, 160))
    current = warp(previous, about(0, 1, 4, 1))
    previous[:, :160], current[:, 20:180] = stranger, stranger
    moving = np.zeros((180, 240), bool)
    moving[:, :160] = True
    np.testing.assert_allclose(global_motion(previous, current, moving), about(0, 1, 4, 1), atol=0.1)


def test_a_camera_that_stands_still_has_exactly_the_identity():
    picture = textured()
    noisy = cv2.add(picture, np.random.default_rng(0).integers(0, 6, picture.shape, dtype=np.uint8))
    for current in (picture, noisy):
        np.testing.assert_array_equal(global_motion(picture, current), np.eye(2, 3))


def test_without_corners_the_camera_stands_still():
    flat, dark = np.full((60, 80), 99, np.uint8), np.zeros((60, 80), np.uint8)
    np.testing.assert_array_equal(global_motion(flat, dark), np.eye(2, 3))
    picture = textured()
    everything = np.ones(picture.shape, bool)
    np.testing.assert_array_equal(global_motion(picture, np.roll(picture, 5, 1), everything), np.eye(2, 3))
    one, other = textured(7), textured(8)  # nothing in common
    found = global_motion(one, other)
    assert np.isfinite(found).all()
    for shape in ((0, 0), (1, 1), (5, 7)):
        empty = np.zeros(shape, np.uint8)
        np.testing.assert_array_equal(global_motion(empty, empty + 1), np.eye(2, 3))


def test_few_corners_in_one_spot_tell_a_shift_and_no_more():
    previous = np.full((180, 240), 90, np.uint8)
    current = previous.copy()
    previous[80:104, 100:124] = current[83:107, 105:129] = textured(3, (24, 24), 1.0)
    found = global_motion(previous, current)
    np.testing.assert_allclose(found[:, :2], np.eye(2), atol=0.1)
    np.testing.assert_allclose(found @ [112, 92, 1], [117, 95], atol=0.3)


def test_masks_and_pictures_go_where_the_map_takes_them():
    mask = np.zeros((9, 12), bool)
    mask[2:5, 3:6] = True
    moved = warp(mask, about(0, 1, 4, 1))
    assert moved.dtype == np.bool_
    np.testing.assert_array_equal(np.argwhere(moved), np.argwhere(mask) + np.array([1, 4]))
    colours = np.random.default_rng(0).integers(0, 256, (9, 12, 3), dtype=np.uint8)
    np.testing.assert_array_equal(warp(colours, about(0, 1, 4, 1))[1:, 4:], colours[:-1, :-4])
    assert warp(mask[:0], np.eye(2, 3)).shape == (0, 12)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: sparse(np.zeros((4, 4), np.uint8), np.zeros((4, 5), np.uint8)), "one size"),
        (lambda: dense(np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4), np.uint8)), "previous"),
        (lambda: global_motion(np.zeros((4, 4)), np.zeros((4, 4), np.uint8)), "previous"),
        (lambda: sparse(*np.zeros((2, 4, 4), np.uint8), step=0), "step"),
        (lambda: sparse(*np.zeros((2, 4, 4), np.uint8), contrast=2.0), "contrast"),
        (lambda: sparse(*np.zeros((2, 4, 4), np.uint8), where=np.zeros((5, 4), bool)), "mask"),
        (lambda: dense(*np.zeros((2, 4, 4), np.uint8), preset="best"), "preset"),
    ],
)
def test_what_cannot_be_is_refused_by_name(call, name):
    with pytest.raises(ParameterError, match=name):
        call()
