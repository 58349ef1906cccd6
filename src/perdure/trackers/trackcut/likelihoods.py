"""How much more a pixel looks, and moves, like the object than like its surroundings (eq. 6-9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.mixture import Mixture, fit, log_density, log_ratio, subsample
from perdure.scene.backdrop import LEAST, Backdrop
from perdure.trackers.trackcut.targets import Colours
from perdure.trackers.trackcut.windows import Window
from perdure.types import Bits

Float = NDArray[np.float32]
_SAMPLE = 2000  # pixels a mixture is fitted to, at most
_FLOOR = 4.0  # least variance of colours
_STEPS = 4  # of EM
_LEAST_TRUST = 1e-9  # in either looks
_FAR = 25.0  # nats: as unlikely as a colour may be
_STILL = 0.4  # px a frame by which flow errs at least
_ROUGH = 0.1  # share of a motion by which parts of an object differ from it
_BARE = 2.0  # deviations of each channel, up to which a colour is that of the backdrop
_MOST_BARE = 0.6  # share of an object that may look like the backdrop; of more, colours do not tell


def learn_colours(
    colours: Float,
    inside: NDArray[np.bool_],
    near: NDArray[np.bool_],
    components: int,
    start: Colours | None = None,
) -> Colours:
    """Return mixtures of the colours (h, w, 3) inside an object and near it, outside (eq. 6)."""
    return Colours(
        _fitted(colours, inside, components, start.own if start else None),
        _fitted(colours, near & ~inside, components, start.other if start else None),
    )


def _fitted(colours: Float, where: NDArray[np.bool_], components: int, start: Mixture | None) -> Mixture:
    places = subsample(np.flatnonzero(where), _SAMPLE)
    if not len(places):
        return start if start is not None else Mixture.empty(3)
    points = colours.reshape(-1, 3)[places]
    return fit(points, components, start=start, iterations=_STEPS, floor=_FLOOR)


def of_colours(points: Float, first: Colours, last: Colours, trust: float, bound: float) -> Float:
    """Return ln p / q (…) of colours (…, 3), within ± bound: of the looks at first, `trust`, and at last (eq. 8)."""
    sure, unsure = trust + _LEAST_TRUST, 1 - trust + _LEAST_TRUST
    own, other = ([(first.own, sure), (last.own, unsure)], [(first.other, sure), (last.other, unsure)])
    return log_ratio(points, own, other, bound)


def of_looks(points: Float, looks: Colours) -> Float:
    """Return ln p (N,) of colours (N, 3) under an object's looks."""
    return np.asarray(np.maximum(log_density(looks.own, points), -_FAR), np.float32)


def of_motions(flow: Float, sure: NDArray[np.bool_], bound: float, known: Float | None = None) -> Float:
    """Return ln p / q (h, w) of motions (h, w, 2) beyond the camera's, within ± bound.

    Flow errs often and far, so both are heavy-tailed (Student, three degrees of freedom): about the median motion of
    the pixels that are `sure` to be the object's, or a `known` motion (2,), and about rest.
    """
    if known is None and not sure.any():
        return np.zeros(flow.shape[:2], np.float32)
    from perdure.maths.kernels.tails import student_ratios

    own = np.ascontiguousarray((flow[sure] if known is None else known[None]).T)  # (2, n)
    middle = np.median(own, axis=1)
    spread = np.maximum(1.5 * np.median(np.abs(own - middle[:, None]), axis=1), _STILL) + _ROUGH * np.abs(middle)
    out = np.empty(flow.shape[:2], np.float32)
    student_ratios(np.ascontiguousarray(flow), middle, spread, np.float32(_STILL), np.float32(bound), out)
    return out


def of_backdrop(colours: Float, window: Window, backdrop: Backdrop) -> tuple[Float, Bits]:
    """Return ln p (h, w) of the colours (h, w, 3) of a window if nothing is there, and where they are the backdrop's.

    -∞ where it is not known what is behind.
    """
    variance = np.maximum(window.cut(backdrop.variance), np.float32(LEAST))
    off = colours - window.cut(backdrop.colours)
    squares = np.einsum("hwc,hwc->hw", off, off) / variance
    known = window.cut(backdrop.known.view(np.uint8)) > 0
    density = np.float32(-0.5) * squares - np.float32(1.5) * np.log(np.float32(2 * np.pi) * variance)
    return np.where(known, density, -np.inf).astype(np.float32), known & (squares < 3 * _BARE**2)


def unlike(cells: Bits, bare: Bits) -> Bits:
    """Return those of an object's cells (h, w) that are not the backdrop's: all, if too few remain."""
    rest = np.asarray(cells & ~bare, np.bool_)
    return rest if np.count_nonzero(rest) >= (1 - _MOST_BARE) * np.count_nonzero(cells) else cells
