"""The plain background model: one running Gaussian per pixel, and the camera's exposure.

Wren, Azarbayejani, Darrell, Pentland, *Pfinder* (1997): each pixel keeps a mean colour and a variance;
what lies further from the mean than some multiples of the noise is foreground. Departures:
the model may take a first look over a whole file (`prepare`: median and quiet deviation of pictures of one exposure,
so that a clip that begins with people in it leaves no ghosts); each frame is first brought to the model's exposure by one
factor per channel (automatic gain, lights), and at a jump the model to the new light, place by place; foreground sinks in
more slowly than background adapts, and not at all where a target is believed; where a thing of the model is gone, which
its edges tell, or one has long lain still as nobody stands, the model takes that in at once.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.detect.components import Stage, regions_of
from perdure.detect.first_look import Early, FirstLook, exposure, has_colour, look_over
from perdure.detect.ghosts import ghosts
from perdure.detect.light import Light, busier, followed, is_empty, is_sudden, relit, texture
from perdure.detect.marks import Ground, take_off_halo, take_out_shadows
from perdure.detect.occluders import Occluder, Passages, no_passages, note, occluders
from perdure.detect.steady import blank, moved, shift, steadied
from perdure.detect.stillness import Stillness, is_gone, no_stillness, rested, watch
from perdure.errors import ParameterError
from perdure.params import parameter
from perdure.types import Event, Frame, Image, Mask, Regions, Report, Scene, Status

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class BackgroundState:
    """The model of every pixel and its age; arrays of pixels are (0, 0) before the first frame."""

    mean: Single  # (H, W, 3)
    variance: Single  # (H, W)
    held: NDArray[np.uint8]  # (H, W), not 0 where a target is believed
    early: Early
    still: Stillness
    passages: Passages
    light: Light
    age: float  # seconds learnt so far
    time: float  # of the last frame
    roi: NDArray[np.bool_] | None
    height: int
    fps: float


@dataclass(frozen=True)
class Background:
    """Regions of whatever differs from the learnt background.

    >>> detector = Background(threshold=4.0)
    >>> state = detector.start(Scene(64, 48))
    >>> state, regions = detector.step(state, Frame(0, 0.0, np.zeros((48, 64, 3), np.uint8)))
    >>> len(regions)
    0
    """

    threshold: float = parameter(
        3.0, "how far from the background a pixel is foreground", unit="noise deviations", low=0.5, high=50.0
    )
    least_noise: float = parameter(
        5.0, "noise assumed where less is measured", unit="grey levels", low=0.5, high=100.0
    )
    darkest_shadow: float = parameter(
        0.4,
        "down to this share of its brightness the ground is taken for shadow where it keeps colour and texture; 1: never",
        unit="of its brightness",
        low=0.0,
        high=1.0,
    )
    memory: float = parameter(
        30.0, "time over which the background adapts to slow changes", unit="s", low=0.1, high=86400.0
    )
    absorb: float = parameter(
        120.0,
        "time over which a thing that stands still sinks into the background",
        unit="s",
        low=0.1,
        high=86400.0,
    )
    least_area: float = parameter(0.0002, "smallest region", unit="of the frame's area", low=0.0, high=1.0)
    closing: float = parameter(
        0.005, "gaps closed within a region", unit="of the frame's height", low=0.0, high=0.1
    )
    neck: float = parameter(
        0.3,
        "a region is taken apart where it is narrower than this share of both its parts; 0: never",
        unit="of their thickness",
        low=0.0,
        high=1.0,
    )
    steady: bool = parameter(True, "whether a camera that shakes, by up to 1.5 % of the height, is held still")
    first_look: FirstLook | None = field(default=None, repr=False, compare=False)

    needs_pixels = True

    def prepare(self, frames: Sequence[Frame]) -> Background:
        """Return this detector with a first look over a file, from frames spread over all of it."""
        images = [frame.image for frame in frames if frame.image is not None]
        if len(images) < _LEAST_LOOKS:
            return self
        return dataclasses.replace(self, first_look=look_over(np.stack(images)))

    def start(self, scene: Scene) -> BackgroundState:
        """Return the state before the first frame: nothing learnt, or the first look."""
        pixels, look = np.zeros((0, 0), np.float32), self.first_look
        state = BackgroundState(
            mean=np.zeros((0, 0, 3), np.float32),
            variance=pixels,
            held=pixels.astype(np.uint8),
            early=Early.none_yet(0, 0),
            still=no_stillness(0, 0),
            passages=no_passages(0, 0),
            light=Light(),
            age=0.0,
            time=-1.0 / scene.fps,
            roi=scene.roi,
            height=scene.height,
            fps=scene.fps,
        )
        if look is None:
            return state
        state = _placed(state, look.mean.copy(), look.variance.copy())
        return dataclasses.replace(state, early=Early.no_more(*look.variance.shape), age=self.absorb)

    def step(self, state: BackgroundState, frame: Frame) -> tuple[BackgroundState, Regions]:
        """Return the regions of one frame, with what was noticed of light and left things; the model learns from it.

        Raises
        ------
        ParameterError
            If the frame has no picture.
        """
        state, seen = self._see(state, frame)
        if state.light.blind >= 0:
            return state, dataclasses.replace(Regions.empty(), events=seen.events, blind=True)
        stage = self.stage(state.height, seen.foreground.size)
        found = regions_of(seen.foreground, stage, state.roi, state.mean)
        note(state.passages, found, seen.elapsed)
        events = (*seen.events, *self._tend(state, found, seen, frame))
        found = moved(found, *seen.place, *seen.foreground.shape)
        return state, dataclasses.replace(found, events=events)

    def heed(self, state: BackgroundState, report: Report) -> BackgroundState:
        """Learn nothing, from the next frame on, where the tracker believes that a target was seen in this one."""
        if state.light.blind >= 0 or not state.held.size:
            return state
        state.held.fill(0)
        rows = report.rows.in_frame(int(report.rows.frames.max(initial=-1)))
        height, width = state.held.shape
        for status, mask, box in zip(rows.status, rows.masks, rows.boxes, strict=True):
            if status in _SEEN and mask.area:
                x1, y1, x2, y2 = mask.box
                state.held[y1:y2, x1:x2][mask.bits] = 1
            elif status in _SEEN:
                x1, y1, x2, y2 = np.clip(np.rint(box), 0, (width, height, width, height)).astype(int)
                state.held[y1:y2, x1:x2] = 1
        return state

    def occluders(self, state: BackgroundState) -> tuple[Occluder, ...]:
        """Return what, by all that has passed so far, stands in front of things: posts, signs, trunks; surest first."""
        return occluders(state.passages, state.mean) if state.mean.size else ()

    def stage(self, height: int, pixels: int) -> Stage:
        """Return how the foreground of a picture of this size becomes regions."""
        return Stage(round(self.closing * height), self.least_area * pixels, self.neck, _HOLE)

    def foreground(self, state: BackgroundState, frame: Frame) -> tuple[BackgroundState, NDArray[np.uint8]]:
        """Return the raw foreground of one frame, (H, W): 255 moving, 0 not, else doubtful; the model learns."""
        state, seen = self._see(state, frame)
        x, y = seen.place
        return state, steadied(seen.foreground, -round(x), -round(y)) if round(x) or round(y) else seen.foreground

    def _see(self, state: BackgroundState, frame: Frame) -> tuple[BackgroundState, _Seen]:
        if frame.image is None:
            raise ParameterError("the background detector needs pictures; give --detector a file of detections")
        image, place = np.ascontiguousarray(frame.image), (0.0, 0.0)
        if not state.mean.size:
            noise = np.full(image.shape[:2], self.least_noise**2, np.float32)
            state = _placed(state, image.astype(np.float32), noise)
        begun = state.time >= 0  # a film that is entered late tells nothing of the time before
        elapsed = max(frame.time - state.time, 0.1 / state.fps) if begun else 1.0 / state.fps
        factor = exposure(image, state.mean)
        if self.steady:
            place = shift(image, state.mean, factor)
        if place != (0.0, 0.0):
            image = steadied(image, *place)
        foreground = self._compare_and_learn(state, image, factor, elapsed)
        blank(foreground, *place)
        light, events = followed(state.light, factor, frame.index, frame.time, elapsed)
        state = dataclasses.replace(state, light=light, age=state.age + elapsed, time=frame.time)
        seen = _Seen(image, factor, place, foreground, elapsed, events if state.age > _SETTLED else ())
        busy = _moving(foreground)
        if state.age > _SETTLED and is_empty(image, state.mean):
            return self._blinded(state, seen, frame, busy, _COVERED)
        if light.blind >= 0 or (state.age > _SETTLED and is_sudden(light, busy, jumped=bool(events))):
            return self._in_new_light(state, seen, frame, busy)
        state = dataclasses.replace(state, light=busier(light, busy, elapsed))
        return self._with_early_look(state, image), seen

    def _compare_and_learn(
        self, state: BackgroundState, image: Image, factor: Single, elapsed: float
    ) -> NDArray[np.uint8]:
        """Return the marks of a picture, (H, W); mean and variance of the state learn."""
        from perdure.maths.kernels.gaussian import compare_and_learn

        foreground, contrast = (np.empty(image.shape[:2], np.uint8) for _ in range(2))
        darkest = self.darkest_shadow if has_colour(image) else 1.0
        young = elapsed / (state.age + elapsed)  # a plain mean as long as little is known
        compare_and_learn(
            image,
            factor,
            state.mean,
            state.variance,
            state.held,
            foreground,
            contrast,
            np.float32(self.threshold**2),
            np.float32(self.least_noise**2),
            np.float32(max(darkest, _FAINT)),
            np.float32(darkest),
            np.float32(max(_share(elapsed, self.memory), young)),
            np.float32(_share(elapsed, self.absorb)),
        )
        take_out_shadows(foreground, image, factor, Ground(state.mean, state.variance, self.least_noise))
        take_off_halo(foreground, contrast)
        return foreground

    def _is_told(self, state: BackgroundState, mask: Mask, time: float) -> bool:
        """Whether a thing is told to be gone: for some while, not tiny, and not at the border, where things pass."""
        (x1, y1, x2, y2), (height, width) = mask.box, state.held.shape
        inside = x1 > 0 and y1 > 0 and x2 < width and y2 < height
        return is_gone(state.still, mask, time) and inside and mask.area >= 2.0 * self.least_area * height * width

    def _with_early_look(self, state: BackgroundState, image: Image) -> BackgroundState:
        """Look over the first seconds as they go by: what stood in the first picture may have moved on.

        Where a target is believed the ground is as the model has it.
        """
        if state.early.is_over or state.time < state.early.due:
            return state
        believed = state.held != 0
        ground = np.where(believed[..., None], np.rint(state.mean / exposure(image, state.mean)), image)
        early, look = state.early.with_picture(ground.clip(0, 255).astype(np.uint8), state.time)
        if look is None:
            return dataclasses.replace(state, early=early)
        np.copyto(look.mean, state.mean, where=believed[..., None])
        np.copyto(look.variance, state.variance, where=believed)
        light = dataclasses.replace(state.light, level=-float(np.log(exposure(image, look.mean)).mean()))
        return dataclasses.replace(state, mean=look.mean, variance=look.variance, light=light, early=early)

    def _in_new_light(
        self, state: BackgroundState, seen: _Seen, frame: Frame, busy: float
    ) -> tuple[BackgroundState, _Seen]:
        """Most of the picture has changed at once: bring the model to the new light, or wait and learn it anew."""
        light, begun = state.light, state.light.blind
        sees = dataclasses.replace(light, blind=-1)
        if begun >= 0 and not is_sudden(light, busy):
            return dataclasses.replace(state, light=sees), self._told(
                seen, begun, frame, "sight is back, and the picture as it was"
            )
        mean = relit(seen.image, seen.factor, state.mean, state.held)
        trial = dataclasses.replace(state, mean=mean, variance=state.variance.copy())
        foreground = self._compare_and_learn(trial, seen.image, seen.factor, seen.elapsed)
        shows = texture(seen.image, seen.factor, mean)
        if not is_sudden(light, _moving(foreground)) and _moving(foreground) < busy / 2 and shows > _SHOWN:
            why = f"{busy:.0%} of the picture changed at once; the model was brought to the new light"
            seen = self._told(seen._replace(foreground=foreground), begun, frame, why)
            early = state.early if state.early.is_over else Early.none_yet(*state.held.shape)
            return dataclasses.replace(trial, light=sees, early=early), seen
        if not is_sudden(light, busy):
            return dataclasses.replace(state, light=busier(light, busy, seen.elapsed)), seen
        return self._blinded(state, seen, frame, busy, _WAIT)

    def _blinded(
        self, state: BackgroundState, seen: _Seen, frame: Frame, busy: float, wait: float
    ) -> tuple[BackgroundState, _Seen]:
        """Nothing explains the picture: wait so many seconds for one that something does, then learn it anew."""
        light, begun = state.light, state.light.blind
        if begun < 0:
            light = dataclasses.replace(light, blind=frame.index, since=frame.time)
            why = f"{busy:.0%} of the picture changed at once; blind until it settles"
            if wait == _COVERED:
                why = "there is nothing in the picture; blind until there is"
            return dataclasses.replace(state, light=light), self._told(seen, frame.index, frame, why)
        if frame.time - light.since < wait:
            return dataclasses.replace(state, light=light), seen._replace(events=())
        mean = relit(seen.image, seen.factor, state.mean, state.held)
        fresh = np.where(state.held[..., None] != 0, mean, seen.image * seen.factor).astype(np.float32)
        noise = np.full(fresh.shape[:2], self.least_noise**2, np.float32)
        early, light = Early.none_yet(*state.held.shape), dataclasses.replace(light, blind=-1)
        state = dataclasses.replace(state, mean=fresh, variance=noise, early=early, light=light, age=0.0)
        foreground = self._compare_and_learn(state, seen.image, seen.factor, seen.elapsed)
        seen = seen._replace(foreground=foreground)
        return state, self._told(seen, begun, frame, "the picture has settled; the model is learnt anew")

    def _told(self, seen: _Seen, begun: int, frame: Frame, why: str) -> _Seen:
        """What was seen, with the event that the light has changed."""
        begin = begun if begun >= 0 else frame.index
        return seen._replace(events=(Event("light", begin, frame.index, why=why),))

    def _tend(self, state: BackgroundState, found: Regions, seen: _Seen, frame: Frame) -> tuple[Event, ...]:
        """Take in the places of things that are gone, within a second, and things that were left and lie still."""
        gone = ghosts(found, seen.image, state.mean)
        watch(state.still, found, seen.image, seen.factor, frame.time, self.threshold * self.least_noise)
        lies = rested(state.still, found, frame.time, self.absorb) & ~gone
        events = []
        for number in np.flatnonzero(gone | lies):
            mask = found.masks[number]
            x1, y1, x2, y2 = mask.box
            known = state.mean[y1:y2, x1:x2]
            share = np.float32(1.0 if lies[number] else _share(seen.elapsed, _HEALED))
            known[mask.bits] += share * (seen.image[y1:y2, x1:x2][mask.bits] * seen.factor - known[mask.bits])
            if lies[number] or self._is_told(state, mask, frame.time):
                events.append(_noticed(mask, frame.index, "abandoned" if lies[number] else "removed"))
        return tuple(events)


class _Seen(NamedTuple):
    """A frame beside the model."""

    image: Image  # (H, W, 3)
    factor: Single  # (3,) what brings it to the model's exposure
    place: tuple[float, float]  # px by which the camera had moved; the picture has been moved back
    foreground: NDArray[np.uint8]  # (H, W)
    elapsed: float  # seconds since the frame before
    events: tuple[Event, ...] = ()


def _placed(state: BackgroundState, mean: Single, variance: Single) -> BackgroundState:
    """A state that knows its place."""
    size = variance.shape
    return dataclasses.replace(
        state,
        mean=mean,
        variance=variance,
        held=np.zeros(size, np.uint8),
        early=Early.none_yet(*size),
        still=no_stillness(*size),
        passages=no_passages(*size),
    )


def _moving(foreground: NDArray[np.uint8]) -> float:
    """The share of a picture that surely moves."""
    return float(np.count_nonzero(foreground == 255)) / max(foreground.size, 1)


def _noticed(mask: Mask, frame: int, kind: str) -> Event:
    x1, y1, x2, y2 = mask.box
    why = {
        "abandoned": "it has not stirred for as long as `absorb` says, and its border is in the picture",
        "removed": "its border was in the model and is not in the picture",
    }[kind]
    return Event(kind, frame, frame, why=f"at {x1},{y1},{x2 - x1},{y2 - y1}: {why}")


def _share(elapsed: float, time: float) -> float:
    """How far a mean over so much time moves towards what it sees."""
    return 1.0 - math.exp(-elapsed / time)


_LEAST_LOOKS = 5  # fewer pictures than this say nothing about the whole
_FAINT = 0.8  # of the ground's brightness: so faint a shadow need not be even
_HOLE = 0.05  # of a region's area: smaller holes in it are filled
_SETTLED = 1.0  # s of learning before a jump of the light is one
_SHOWN = 0.3  # of the model's texture must be in a picture that another light explains
_WAIT = 0.2  # s for which a picture that no light explains may last before it is learnt anew
_COVERED = 60.0  # s, the same for one in which there is nothing at all
_SEEN = (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS)
_HEALED = 0.4  # s over which a ghost is taken in
