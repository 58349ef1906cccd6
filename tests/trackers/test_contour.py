"""The contour observer: its energy and gradients, how its errors decay, and what it follows on drawn films."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from perdure import states
from perdure.fold import settle
from perdure.maths import levelset, lie
from perdure.trackers.contour import Contour, ContourState, recalling
from perdure.trackers.contour import observer as paper
from perdure.trackers.contour.measuring import Measured, measured, of_distance, of_evidence, of_shape
from perdure.trackers.contour.observer import Gains, State
from perdure.trackers.contour.seeing import Window
from perdure.types import Frame, Mask, Regions, Report, Scene, Status, Tracks

HEIGHT, WIDTH = 120, 200
DEFAULTS = Contour()
GROUPS = pytest.mark.parametrize("group", lie.GROUPS.values(), ids=list(lie.GROUPS))


# The paper's mathematics ------------------------------------------------------------------------------------------


def egg(x: float, y: float, turned: float = 0.0, height: int = 160, width: int = 240) -> np.ndarray:
    """A shape (height, width) bool that no turn brings onto itself."""
    rows, columns = np.mgrid[:height, :width]
    across, down = columns - x, rows - y
    along = across * np.cos(turned) + down * np.sin(turned)
    away = down * np.cos(turned) - across * np.sin(turned)
    return (along / 20) ** 2 + (away / 32) ** 2 + 0.3 * (along / 20) * (away / 32) ** 2 < 1


def soft(shape: np.ndarray) -> Measured:
    """A measurement without a sharp edge, for differences of energies."""
    return measured(cv2.GaussianBlur(1.0 - 2.0 * shape, (0, 0), 4), 0)


def a_window(group: lie.Group) -> tuple[State, np.ndarray, list[Measured]]:
    """A shape, three velocities, and what was measured near where they lead."""
    state = paper.initial(egg(80, 80), 0, 0, group)
    rng = np.random.default_rng(0)
    velocities = rng.normal(0, 1, (3, 6)) * (2, 2, 0.05, 0.02, 0.02, 0.02)
    return state, velocities[:, : group.dimension], [soft(egg(82 + 3 * k, 81, 0.1 * k)) for k in range(3)]


def centroid(state: State) -> np.ndarray:
    """Where the middle of the contour is in the picture."""
    middle = (np.array(state.shape.shape[::-1]) - 1) / 2
    return lie.act(paper.pose_of(state, lie.SE2), (levelset.moments(state.shape).centroid - middle)[None])[0]


def follow_shapes(
    path: Callable[[int], tuple[float, float]], count: int, gains: Gains, motion: str = "velocity"
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of place and velocity (count,) of a shape that moves on a path."""
    group = lie.SE2
    state = paper.initial(egg(*path(0)), 0, 0, group)
    places, speeds = [], []
    for k in range(1, count):
        shape = egg(*path(k))
        state = paper.updated(
            state, of_shape(shape), gains, group,
            window=DEFAULTS.window, steps=DEFAULTS.iterations, motion=paper.MOTIONS[motion],
            reach=DEFAULTS.reach, curvature=DEFAULTS.curvature,
        )  # fmt: skip
        there = levelset.moments(levelset.signed_distance(shape)).centroid
        places.append(np.hypot(*(centroid(state) - there)))
        speeds.append(np.hypot(*(state.velocity[:2] - np.subtract(path(k), path(k - 1)))))
    return np.array(places), np.array(speeds)


@GROUPS
def test_the_velocity_gradient_is_that_of_the_energy(group: lie.Group):
    state, velocities, seen = a_window(group)
    found = paper.velocity_gradient(paper.edges_of(state.shape), state.base, velocities, seen, group)
    for i in range(len(velocities)):
        for d in range(group.dimension):
            step = np.zeros_like(velocities)
            step[i, d] = 0.2 if d < 2 else 0.005
            ahead, back = (
                paper.energy(state.shape, state.base, velocities + sign * step, seen, group) for sign in (1, -1)
            )
            slope = (ahead - back) / (2 * step[i, d])
            assert found[i, d] == pytest.approx(slope, rel=0.05, abs=30 if d > 1 else 3)


def test_the_shape_gradient_is_that_of_the_energy():
    group = lie.SIMILARITY
    state, velocities, seen = a_window(group)
    field = paper.shape_gradient(state.shape, paper.poses(state.base, velocities, group), seen)
    rows, columns = np.mgrid[: state.shape.shape[0], : state.shape.shape[1]]
    for x, y in ((20, 25), (40, 60), (30, 90)):
        bump = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 200)  # by which the contour moves outwards
        ahead, back = (
            paper.energy(state.shape - 0.3 * sign * bump, state.base, velocities, seen, group) for sign in (1, -1)
        )
        near = np.clip(1 - np.abs(state.shape), 0, 1)  # a unit of contour for a unit of its length
        assert (field * bump * near).sum() == pytest.approx((ahead - back) / 0.6, rel=0.1, abs=3)


def test_the_energy_is_the_area_between_two_binary_shapes_and_least_at_the_truth():
    group, truth = lie.SE2, of_shape(egg(90, 80))
    state = paper.initial(egg(90, 80), 0, 0, group)

    def at(*velocity: float) -> float:
        return paper.energy(state.shape, state.base, np.array([velocity]), [truth], group)

    best = at(0, 0, 0)
    assert 0 <= best < 100  # the smooth step of the contour alone
    assert at(10, 0, 0) == pytest.approx(float((egg(90, 80) ^ egg(100, 80)).sum()), rel=0.05)
    assert all(
        at(*off) > best for off in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 0.05), (0, 0, -0.05))
    )


@pytest.mark.parametrize("gain", [0.1, 0.3, 0.5, 0.8])
def test_the_error_of_a_target_of_constant_velocity_decays_for_every_gain(gain: float):
    places, speeds = follow_shapes(lambda k: (60 + 3.3 * k, 70 + 0.6 * k), 36, Gains(0.3, gain))
    assert places[24:].max() < max(0.3 * places[:3].max(), 0.2)
    assert speeds[24:].max() < 0.05


def test_with_the_defaults_a_constant_velocity_is_known_within_fifteen_frames():
    gains = Gains(DEFAULTS.shape_gain.at(0), DEFAULTS.motion_gain.at(0))
    places, speeds = follow_shapes(lambda k: (60 + 3.3 * k, 70 + 0.6 * k), 36, gains)
    assert places[14:].max() < 0.2
    assert speeds[14:].max() < 0.05


@pytest.mark.slow
def test_nothing_diverges_in_a_thousand_frames():
    def orbit(k: int) -> tuple[float, float]:
        return 120 + 60 * np.sin(k / 30), 80 + 30 * np.cos(k / 30)

    places, _ = follow_shapes(orbit, 1000, Gains(0.8, 0.6), "acceleration")
    assert places.max() < 1.0


def test_each_motion_model_predicts_what_it_holds_constant():
    steady = np.array([[2.0, 1.0, 0.0]] * 4)
    faster = np.array([[float(k), 0.0, 0.1] for k in range(4)])
    assert paper.constant_position(faster).tolist() == [0, 0, 0]
    assert paper.constant_velocity(steady).tolist() == [2, 1, 0]
    assert paper.constant_acceleration(faster) == pytest.approx([4.0, 0.0, 0.1])
    assert paper.constant_acceleration(faster[:1]).tolist() == [0, 0, 0.1]


def test_what_is_not_seen_coasts_with_a_rigid_shape():
    group = lie.SE2
    state = paper.initial(egg(80, 80), 0, 0, group)
    state = paper.towards(state, np.array([[1.0, 0, 84], [0, 1, 81], [0, 0, 1]]), group)
    goal = paper.pose_of(state, group)[:2, 2] + 8 * state.velocity[:2]
    for _ in range(8):
        after = paper.coasted(state, measured(np.zeros((1, 1)), 0), group, window=4)
        assert after.shape is state.shape
        state = after
    assert paper.pose_of(state, group)[:2, 2] == pytest.approx(goal)


def test_in_the_initialisation_phase_a_rough_shape_settles_on_what_is_there():
    group, there = lie.SE2, egg(80, 80)
    rough = np.zeros_like(there)
    rough[52:108, 62:98] = True
    state = paper.settled_shape(paper.initial(rough, 0, 0, group), of_shape(there), 0.02, group)
    pose = paper.pose_of(state, group)
    assert paper.discrepancy(state.shape, pose, of_shape(there)) < 0.06 * there.sum()


def test_the_gauge_moves_no_contour():
    group = lie.AFFINE
    state, velocities, seen = a_window(group)
    shape = levelset.redistance(np.roll(state.shape, (3, 4), axis=(0, 1)))
    state = State(shape, state.base, velocities, tuple(seen), velocities[-1], 0 * velocities[-1])
    after = paper.gauged(state, group=group)
    off = levelset.moments(after.shape).centroid - (np.array(after.shape.shape[::-1]) - 1) / 2
    assert np.abs(off).max() < 0.1
    for one, other in zip(
        paper.poses(state.base, state.velocities, group),
        paper.poses(after.base, after.velocities, group),
        strict=True,
    ):
        assert paper.discrepancy(after.shape, other, seen[0]) == pytest.approx(
            paper.discrepancy(shape, one, seen[0]), rel=0.01
        )


def test_every_measurement_says_inside_where_the_object_is():
    shape = egg(80, 80)
    binary = of_shape(shape, reach=0)
    assert np.array_equal(binary.loss_inside(), 1.0 - shape)
    assert np.array_equal(binary.loss_outside(), 1.0 * shape)
    distance = of_distance(levelset.signed_distance(shape), reach=4)
    assert np.array_equal(distance.pull < 0, shape)
    assert np.abs(distance.pull).max() == 1
    likely = of_evidence(np.where(shape, 3.0, -3.0), np.ones(shape.shape, bool), reach=0)
    assert np.array_equal(likely.pull < 0, shape)
    assert not of_evidence(np.where(shape, 3.0, -3.0), np.zeros(shape.shape, bool), reach=0).pull.any()


def walking(frame: int) -> np.ndarray:
    """μ (61, 61) of a body that leans to and fro, the same again after 12 frames."""
    y, x = np.mgrid[-30:31, -30:31]
    lean = 12 * np.sin(frame * np.pi / 6)
    return levelset.signed_distance((x - lean * y / 30) ** 2 / 64 + y**2 / 484 < 1)


def walked(shape: Callable[[int], np.ndarray], count: int) -> tuple[recalling.Shape, ...]:
    past: tuple[recalling.Shape, ...] = ()
    for frame in range(count):
        past = recalling.kept(past, shape(frame), frame, np.array([3.0 * frame + frame % 12, 5.0]))
    return past


def test_a_gait_is_recalled_and_what_came_after():
    past = walked(walking, 40)
    again = recalling.recalled(past)
    assert again is not None
    assert (39 - past[again].age) % 12 == 0
    age = past[again].age
    for frame in range(40, 60):
        age = recalling.following(past, age)
        shape = recalling.drawn(past[recalling.nearest(past, age)])
        assert ((shape < 0) ^ (walking(frame) < 0)).sum() < 0.02 * (walking(frame) < 0).sum()
        place = recalling.place(past, frame, age, 1)
        assert place == pytest.approx([3.0 * frame + frame % 12, 5.0])


def test_what_does_not_come_back_is_not_recalled():
    still = walked(lambda _: walking(1), 40)
    assert recalling.recalled(still) is None
    assert recalling.recalled(walked(walking, 8)) is None
    assert recalling.following(still, 39) == 39
    straight_on = walked(lambda _: walking(1), 12)
    assert recalling.place(straight_on, 14, -1, 1) == pytest.approx([56.0, 5.0])
    assert recalling.place(straight_on, 14, -1, 0) == pytest.approx([44.0, 5.0])
    assert len(walked(lambda _: walking(1), 100)) == recalling.MOST


def test_parts_may_vanish_and_appear_where_the_energy_is_least():
    group, there = lie.SE2, egg(80, 80)
    ring = there & ~cv2.erode(there.astype(np.uint8), np.ones((13, 13), np.uint8)).astype(bool)
    state = paper.initial(there, 0, 0, group)
    pose = paper.pose_of(state, group)
    one = of_shape(ring)
    found = paper.towards_least(state.shape, pose[None], [one], 1.0, 8)
    assert paper.discrepancy(found, pose, one) < 0.12 * ring.sum()
    assert paper.towards_least(state.shape, pose[None], [one], 0.0, 8) is state.shape
    nothing = of_shape(np.zeros_like(there))
    assert paper.towards_least(state.shape, pose[None], [nothing], 1.0, 8) is state.shape


@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("x", [-90, -22, -5, 3, 26, 70])
@pytest.mark.parametrize("y", [-60, 4, 40])
def test_a_window_may_lie_anywhere_about_the_picture(x: int, y: int, step: int):
    picture = np.random.default_rng(0).integers(0, 255, (30, 40, 3), np.uint8)
    window = Window(x, y, step, 9, 11)
    wide = np.pad(picture, ((100, 100), (100, 100), (0, 0)), mode="edge")
    there = wide[y + 100 : y + 100 + 9 * step, x + 100 : x + 100 + 11 * step]
    means = there.reshape(9, step, 11, step, 3).mean(axis=(1, 3))
    assert np.abs(window.cut(picture) - means).max() <= 0.5


# Films --------------------------------------------------------------------------------------------------------------


def texture(seed: int, colour: tuple[int, int, int], contrast: float = 25.0) -> np.ndarray:
    """A picture with something on it that flow can hold on to."""
    rough = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (HEIGHT, WIDTH)), (0, 0), 1.5)
    return np.clip(np.array(colour) + contrast * (rough / rough.std())[..., None], 0, 255).astype(np.uint8)


GROUND, SKIN = texture(1, (90, 110, 90)), texture(7, (170, 60, 60))
Path = Callable[[int], "tuple[int, int] | None"]


def bits(path: Path, k: int) -> np.ndarray:
    found = np.zeros((HEIGHT, WIDTH), np.uint8)
    if path(k) is not None:
        cv2.ellipse(found, path(k), (14, 22), 0, 0, 360, 1, -1)
    return found > 0


def film(path: Path, count: int, post: tuple[int, int] | None = None) -> list[Frame]:
    """Frames of an ellipse that moves on a path, and a post before it."""
    frames = []
    for k in range(count):
        picture = GROUND.copy()
        if path(k) is not None:
            x, y = path(k)
            picture[bits(path, k)] = np.roll(SKIN, (y - 60, x - 100), axis=(0, 1))[bits(path, k)]
        if post:
            picture[:, post[0] : post[1]] = (235, 235, 235)
        frames.append(Frame(k, k / 10, picture))
    return frames


def marked(path: Path) -> Callable[[int], Regions]:
    """What a user marks in the first frame."""
    mask = Mask.of_image(bits(path, 0))
    first = Regions.of([mask.box], masks=[mask], data={"mark": np.array([1])})
    return lambda k: first if k == 0 else Regions.empty()


def found_by_a_detector(path: Path) -> Callable[[int], Regions]:
    def seen(k: int) -> Regions:
        mask = Mask.of_image(bits(path, k))
        return Regions.of([mask.box], masks=[mask]) if mask.area else Regions.empty()

    return seen


def followed(
    frames: list[Frame], regions: Callable[[int], Regions], **parameters: object
) -> tuple[Tracks, list[Report]]:
    tracker = Contour(**parameters)
    state, reports = tracker.start(Scene(WIDTH, HEIGHT, 10.0)), []
    for frame in frames:
        state, report = tracker.step(state, frame, regions(frame.index))
        reports.append(report)
    return settle([*reports, tracker.finish(state)]), reports


def overlap(mask: Mask | None, there: np.ndarray) -> float:
    said = mask.to_image(HEIGHT, WIDTH) if mask is not None else np.zeros_like(there)
    return float((said & there).sum() / max((said | there).sum(), 1))


def straight(k: int) -> tuple[int, int]:
    return 34 + 3 * k, 60


@pytest.mark.parametrize("group", list(lie.GROUPS))
def test_what_is_marked_is_followed_without_a_detector(group: str):
    tracks, _ = followed(film(straight, 25), marked(straight), group=group)
    assert np.unique(tracks.ids).tolist() == [1]
    assert min(overlap(tracks.in_frame(k).masks[0], bits(straight, k)) for k in range(25)) > 0.85
    assert min(overlap(tracks.in_frame(k).believed[0], bits(straight, k)) for k in range(25)) > 0.85


def test_what_a_detector_sees_for_two_frames_is_somebody():
    tracks, _ = followed(film(straight, 12), found_by_a_detector(straight))
    assert np.unique(tracks.ids).tolist() == [1]
    assert tracks.frames.min() <= 1
    assert overlap(tracks.in_frame(11).believed[0], bits(straight, 11)) > 0.85


def test_the_whole_silhouette_is_believed_behind_a_post():
    tracks, reports = followed(film(straight, 42, post=(92, 104)), marked(straight))
    for k in range(42):
        row = tracks.in_frame(k)
        assert overlap(row.believed[0], bits(straight, k)) > 0.75, k
        if 19 <= k <= 22:
            assert row.visibility[0] < 0.75
            assert row.masks[0].to_image(HEIGHT, WIDTH)[:, 93:103].sum() < 30, "the post is not seen as her"
    told = [event.kind for report in reports for event in report.events]
    assert "partly_occluded" in told
    assert "occluded" not in told


def test_who_is_hidden_altogether_coasts_and_is_found_again_with_her_id():
    tracks, reports = followed(film(straight, 42, post=(82, 122)), marked(straight))
    told = [event.kind for report in reports for event in report.events]
    assert told.count("occluded") == told.count("found_again") == 1
    hidden = tracks.in_frame(22)
    assert hidden.status.tolist() == [Status.OCCLUDED]
    assert hidden.inferred.all()
    assert overlap(hidden.believed[0], bits(straight, 22)) > 0.5
    assert np.unique(tracks.ids).tolist() == [1]
    assert overlap(tracks.in_frame(41).believed[0], bits(straight, 41)) > 0.75


def test_with_constant_gains_nothing_holds_the_shape_behind_a_post():
    frames = film(straight, 30, post=(92, 122))
    kept, _ = followed(frames, marked(straight))
    lost, _ = followed(frames, marked(straight), gains="constant", giving=1.0)

    def mean(tracks: Tracks) -> float:
        shares = [overlap(one, bits(straight, k)) for k in range(18, 26) for one in tracks.in_frame(k).believed]
        return float(np.sum(shares) / 8)

    assert mean(kept) > mean(lost) + 0.1


def test_who_is_not_found_again_is_lost_when_patience_ends():
    def path(k: int) -> tuple[int, int] | None:
        return (100, 60) if k < 10 else None

    tracks, reports = followed(film(path, 40), marked(path), patience=1.0)
    assert [event.kind for report in reports for event in report.events] == ["entered", "occluded", "lost"]
    assert tracks.frames.max() < 22


def test_who_goes_over_the_border_has_left():
    def path(k: int) -> tuple[int, int]:
        return 140 + 5 * k, 60

    _, reports = followed(film(path, 30), marked(path))
    assert [event.kind for report in reports for event in report.events][-1] == "left"


def test_a_users_own_motion_is_what_predicts():
    asked = []

    def still(velocities: np.ndarray) -> np.ndarray:
        asked.append(len(velocities))
        return np.zeros(velocities.shape[1])

    followed(film(straight, 8), marked(straight), moved=still)
    assert max(asked) == Contour().window


def test_gains_may_follow_a_schedule_or_a_function_of_the_user():
    frames = film(straight, 14)
    tight = Mask.of_image(cv2.erode(bits(straight, 0).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0)
    first = Regions.of([tight.box], masks=[tight], data={"mark": np.array([1])})

    def shapes(**parameters: object) -> list[np.ndarray]:
        tracks, _ = followed(frames, lambda k: first if k == 0 else Regions.empty(), **parameters)
        return [tracks.in_frame(k).believed[0].to_image(HEIGHT, WIDTH) for k in range(14)]

    rising, low = shapes(shape_gain="0,0.8@8"), shapes(shape_gain=0)
    asked = shapes(gained=lambda k: Gains(0.0 if k < 8 else 0.8, 0.6))
    assert np.array_equal(rising[:8], low[:8])
    assert not np.array_equal(rising[13], low[13])
    assert np.array_equal(rising, asked)


def test_grey_films_are_followed():
    frames = [Frame(one.index, one.time, np.repeat(one.image[..., :1], 3, axis=2)) for one in film(straight, 20)]
    tracks, _ = followed(frames, marked(straight))
    assert min(overlap(tracks.in_frame(k).believed[0], bits(straight, k)) for k in range(20)) > 0.8


def test_a_new_mark_puts_a_contour_right():
    first, again = marked(straight), Mask.of_image(bits(straight, 9))
    second = Regions.of([again.box], masks=[again], data={"mark": np.array([1])})
    tracks, _ = followed(film(straight, 14), lambda k: second if k == 9 else first(k))
    assert np.unique(tracks.ids).tolist() == [1]
    assert overlap(tracks.in_frame(9).believed[0], bits(straight, 9)) > 0.95


def test_a_state_in_the_middle_of_a_hiding_is_saved_and_loaded():
    tracker, frames, regions = Contour(), film(straight, 26, post=(82, 122)), marked(straight)
    state = tracker.start(Scene(WIDTH, HEIGHT, 10.0))
    for frame in frames[:22]:
        state, _ = tracker.step(state, frame, regions(frame.index))
    again = states.load(states.save(state), ContourState)
    for frame in frames[22:]:
        state, one = tracker.step(state, frame, Regions.empty())
        again, other = tracker.step(again, frame, Regions.empty())
        assert one.equals(other)
