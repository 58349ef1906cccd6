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
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.detect.components import Stage, regions_of
from perdure.detect.ghosts import ghosts
from perdure.detect.light import Light, busier, followed, is_sudden, relit
from perdure.detect.marks import Ground, take_off_halo, take_out_shadows
from perdure.detect.occluders import Occluder, Passages, no_passages, note, occluders
from perdure.detect.stillness import Stillness, no_stillness, rested, watch
from perdure.errors import ParameterError
from perdure.params import parameter
from perdure.types import Event, Frame, Image, Mask, Regions, Report, Scene, Status

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FirstLook:
    """What a look over the whole file gave: the median picture and its noise."""

    mean: Single  # (H, W, 3) grey levels
    variance: Single  # (H, W) squared grey levels, mean over channels


@dataclass(frozen=True, eq=False)
class BackgroundState:
    """The model of every pixel and its age; arrays of pixels are (0, 0) before the first frame."""

    mean: Single  # (H, W, 3)
    variance: Single  # (H, W)
    held: NDArray[np.uint8]  # (H, W), not 0 where a target is believed
    still: Stillness
    mended: NDArray[np.float64]  # (h, w) s, when a ghost was last taken in, on the grid of `still`
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
        "what is evenly darker than the background and of its colour, but no darker than this share, is shadow; 1: none",
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
        mean, variance, age = np.zeros((0, 0, 3), np.float32), np.zeros((0, 0), np.float32), 0.0
        if self.first_look is not None:
            mean, variance, age = self.first_look.mean.copy(), self.first_look.variance.copy(), self.absorb
        place = _place(*mean.shape[:2])
        return BackgroundState(
            mean, variance, *place, Light(), age, -1.0 / scene.fps, scene.roi, scene.height, scene.fps
        )

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
        return state, seen.foreground

    def _see(self, state: BackgroundState, frame: Frame) -> tuple[BackgroundState, _Seen]:
        if frame.image is None:
            raise ParameterError("the background detector needs pictures; give --detector a file of detections")
        image = np.ascontiguousarray(frame.image)
        if not state.mean.size:
            state = self._begun(state, image)
        elapsed = max(frame.time - state.time, 0.1 / state.fps)
        factor = exposure(image, state.mean)
        foreground = self._compare_and_learn(state, image, factor, elapsed)
        light, events = followed(state.light, factor, frame.index, frame.time, elapsed)
        state = dataclasses.replace(state, light=light, age=state.age + elapsed, time=frame.time)
        seen = _Seen(image, factor, foreground, elapsed, events if state.age > _SETTLED else ())
        busy = _moving(foreground)
        if light.blind >= 0 or (state.age > _SETTLED and is_sudden(light, busy, jumped=bool(events))):
            return self._in_new_light(state, seen, frame, busy)
        return dataclasses.replace(state, light=busier(light, busy, elapsed)), seen

    def _begun(self, state: BackgroundState, image: Image) -> BackgroundState:
        """The state that knows one picture."""
        first = np.full(image.shape[:2], self.least_noise**2, np.float32)
        held, still, mended, passages = _place(*image.shape[:2])
        mean = image.astype(np.float32)
        return dataclasses.replace(
            state, mean=mean, variance=first, held=held, still=still, mended=mended, passages=passages
        )

    def _compare_and_learn(
        self, state: BackgroundState, image: Image, factor: Single, elapsed: float
    ) -> NDArray[np.uint8]:
        """Return the marks of a picture, (H, W); mean and variance of the state learn."""
        from perdure.maths.kernels.gaussian import compare_and_learn

        foreground, contrast = (np.empty(image.shape[:2], np.uint8) for _ in range(2))
        darkest = self.darkest_shadow if _has_colour(image) else 1.0
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

    def _in_new_light(
        self, state: BackgroundState, seen: _Seen, frame: Frame, busy: float
    ) -> tuple[BackgroundState, _Seen]:
        """Most of the picture has changed at once: bring the model to the new light, or wait and learn it anew."""
        light, begun = state.light, state.light.blind
        sees = dataclasses.replace(light, blind=-1)
        if begun >= 0 and not is_sudden(light, busy):
            return dataclasses.replace(state, light=sees), self._told(
                seen, begun, frame, "a flash, and it is over"
            )
        mean = relit(seen.image, seen.factor, state.mean, state.held)
        trial = dataclasses.replace(state, mean=mean, variance=state.variance.copy())
        foreground = self._compare_and_learn(trial, seen.image, seen.factor, seen.elapsed)
        if not is_sudden(light, _moving(foreground)) and _moving(foreground) < busy / 2:
            why = f"{busy:.0%} of the picture changed at once; the model was brought to the new light"
            seen = self._told(seen._replace(foreground=foreground), begun, frame, why)
            return dataclasses.replace(trial, light=sees), seen
        if not is_sudden(light, busy):
            return dataclasses.replace(state, light=busier(light, busy, seen.elapsed)), seen
        if begun < 0:
            light = dataclasses.replace(light, blind=frame.index, since=frame.time)
            return dataclasses.replace(state, light=light), self._told(
                seen, frame.index, frame, f"{busy:.0%} of the picture changed at once; blind until it settles"
            )
        if frame.time - light.since < _WAIT:
            return dataclasses.replace(state, light=light), seen
        fresh = np.where(state.held[..., None] != 0, mean, seen.image * seen.factor).astype(np.float32)
        noise = np.full(fresh.shape[:2], self.least_noise**2, np.float32)
        state = dataclasses.replace(state, mean=fresh, variance=noise, light=sees, age=0.0)
        foreground = self._compare_and_learn(state, seen.image, seen.factor, seen.elapsed)
        seen = seen._replace(foreground=foreground)
        return state, self._told(seen, begun, frame, "the picture has settled; the model is learnt anew")

    def _told(self, seen: _Seen, begun: int, frame: Frame, why: str) -> _Seen:
        """What was seen, with the event that the light has changed."""
        begin = begun if begun >= 0 else frame.index
        return seen._replace(events=(Event("light", begin, frame.index, why=why),))

    def _tend(self, state: BackgroundState, found: Regions, seen: _Seen, frame: Frame) -> tuple[Event, ...]:
        """Take in the places of things that are gone, within a second, and things that were left and lie still."""
        steady = _exposed(seen.image, seen.factor) if (seen.factor != 1.0).any() else seen.image
        gone = ghosts(found, seen.image, state.mean)
        watch(state.still, found, steady, frame.time, self.threshold * self.least_noise)
        lies = rested(state.still, found, frame.time, self.absorb) & ~gone
        events = []
        for number in np.flatnonzero(gone | lies):
            mask = found.masks[number]
            x1, y1, x2, y2 = mask.box
            known = state.mean[y1:y2, x1:x2]
            share = np.float32(1.0 if lies[number] else _share(seen.elapsed, _HEALED))
            known[mask.bits] += share * (steady[y1:y2, x1:x2][mask.bits] - known[mask.bits])
            if lies[number] or self._is_new(state, mask, frame.time):
                events.append(_noticed(mask, frame.index, "abandoned" if lies[number] else "removed"))
        return tuple(events)

    def _is_new(self, state: BackgroundState, mask: Mask, time: float) -> bool:
        """Whether no ghost has just been taken in here; from now on one has."""
        cell = state.still.cell
        x1, y1, x2, y2 = mask.box
        here = state.mended[y1 // cell : -(-y2 // cell), x1 // cell : -(-x2 // cell)]
        fresh = bool((here < time - _MENDED).all())
        here.fill(time)
        return fresh


class _Seen(NamedTuple):
    """A frame beside the model."""

    image: Image  # (H, W, 3)
    factor: Single  # (3,) what brings it to the model's exposure
    foreground: NDArray[np.uint8]  # (H, W)
    elapsed: float  # seconds since the frame before
    events: tuple[Event, ...] = ()


def _place(height: int, width: int) -> tuple[NDArray[np.uint8], Stillness, NDArray[np.float64], Passages]:
    """What is known of a place before anything is seen there."""
    still = no_stillness(height, width)
    mended = np.full(still.since.shape, -math.inf)
    return np.zeros((height, width), np.uint8), still, mended, no_passages(height, width)


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


def look_over(images: NDArray[np.uint8]) -> FirstLook:
    """Return median and noise of pictures spread over a film, (N, H, W, 3) uint8.

    All are first brought to one exposure, that of their median, so that a slow change of light is not taken for
    noise. The noise is that of the quieter third: a low quantile of the deviations from the median, scaled to a
    Gaussian's standard deviation; where things pass for half of the time it is still that of the background.
    """
    images = images[: len(images) - (1 - len(images) % 2)]  # an odd number: the median is one of them
    mean, _ = _median_and_noise(images)
    factors = [exposure(image, mean) for image in images]
    if any((factor != 1.0).any() for factor in factors):
        images = np.stack([_exposed(image, factor) for image, factor in zip(images, factors, strict=True)])
    mean, variance = _median_and_noise(images)
    return FirstLook(mean, variance)


def _median_and_noise(images: NDArray[np.uint8]) -> tuple[Single, Single]:
    """The median (H, W, 3) and the squared noise (H, W) of an odd number of pictures."""
    half, low = len(images) // 2, round(_QUIET * (len(images) - 1))
    mean = np.empty(images.shape[1:], np.float32)
    variance = np.empty(images.shape[1:3], np.float32)

    def look(y: int) -> None:
        strip = images[:, y : y + _STRIP]  # (N, strip, W, 3)
        middle = np.partition(strip, half, axis=0)[half]
        deviation = np.partition(np.maximum(strip, middle) - np.minimum(strip, middle), low, axis=0)[low]
        mean[y : y + _STRIP] = middle
        variance[y : y + _STRIP] = np.square(deviation * _GAUSSIAN).mean(axis=2)

    with ThreadPoolExecutor(2) as threads:  # strips that stay in the cache; each writes its own rows
        list(threads.map(look, range(0, images.shape[1], _STRIP)))
    return mean, variance


def _exposed(image: Image, factor: Single) -> Image:
    """A picture whose channels are multiplied, in whole grey levels."""
    levels = np.arange(256, dtype=np.float32)[:, None] * factor  # (256, 3)
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table[None]), np.uint8)


def exposure(image: Image, mean: Single) -> Single:
    """Return the factor per channel (3,) that brings a picture to the model's exposure.

    The median of mean / image over a coarse grid: right as long as less than half of it is foreground.
    Within one percent it is 1, so that a still scene stays untouched.
    """
    step = max(1, min(image.shape[:2]) // _GRID)
    seen = image[::step, ::step].astype(np.float32)
    factors = np.median(np.maximum(mean[::step, ::step], 1.0) / np.maximum(seen, 1.0), axis=(0, 1))
    return np.where(np.abs(factors - 1.0) < 0.01, 1.0, factors).astype(np.float32)


_LEAST_LOOKS = 5  # fewer pictures than this say nothing about the whole
_FAINT = 0.8  # of the ground's brightness: so faint a shadow need not be even
_HOLE = 0.05  # of a region's area: smaller holes in it are filled
_SETTLED = 1.0  # s of learning before a jump of the light is one
_WAIT = 0.2  # s for which a picture that no light explains may last before it is learnt anew
_SEEN = (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS)
_MENDED = 5.0  # s within which a ghost in the same place is the same
_HEALED = 0.4  # s over which a ghost is taken in
_STRIP = 32  # rows
_GRID = 32  # rows of the grid on which the exposure is measured
_GREY = 4  # grey levels that the channels of a colourless picture may differ by
_QUIET = (
    0.3  # quantile of the deviations that tells the noise: traffic may hide the background for longer than half
)
_GAUSSIAN = 1 / 0.3853  # standard deviation of a Gaussian / that quantile of its absolute deviations


def _has_colour(image: Image) -> bool:
    """Whether a picture has colour at all; in a grey one nothing tells a shadow from a dark thing."""
    step = max(1, min(image.shape[:2]) // _GRID)
    seen = image[::step, ::step].astype(np.int16)
    return bool((np.ptp(seen, axis=2) > _GREY).any())
