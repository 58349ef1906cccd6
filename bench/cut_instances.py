"""Minimum cuts as a tracker poses them: real frames, real mixtures; what bench/maxflow.py is timed on.

An object's mask in one frame gives mixtures of 10 Gaussians of its colours and of those around it; the next frame's
pixels have the clipped log-ratio of the two as unary, contrast weights of their colours as pairwise (eq. 10 of Track
and Cut with λ1 = 10, σ² = 4 times the mean squared difference), and observation nodes with eq. 11's weights (λ2 = 2) to
every pixel of an observation. Masks are those of DAVIS; in PETS what differs from the median picture in a truth box.
Observations are the largest components of what looks more like the object than like the ground.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.files.mot import read_truth
from perdure.files.video import open_source

Float = NDArray[np.floating[Any]]
Bits = NDArray[np.bool_]

LAMBDA_1, LAMBDA_2 = 10.0, 2.0  # eq. 10 and 11
COMPONENTS, SAMPLES, ROUNDS = 10, 10_000, 12  # of a mixture: Gaussians, most pixels it is fitted to, rounds of EM
CLIP = 20.0  # nats, of a log-ratio
HARD = 1000.0  # a cost that no cut pays: eight edges cost at most 80


@dataclass(frozen=True, eq=False)
class Instance:
    """One cut: what both sides are given."""

    name: str
    kind: str  # region, frame or border
    unary: Float  # (H, W) float64, cost of label 1 less that of label 0
    pairwise: Float  # (4, H, W) float64: E, S, SE, SW
    node_unary: Float  # (K,)
    node_links: tuple[tuple[NDArray[np.intp], Float], ...]  # K pairs: flat pixels, weights

    @property
    def size(self) -> str:
        height, width = self.unary.shape
        return f"{width}x{height}"


class Case(NamedTuple):
    """What to make of which frame."""

    film: str
    frame: int
    kind: str
    width: int  # 0 for the whole frame
    height: int
    nodes: int


CASES = (
    *(
        Case("pets", frame, "region", width, height, nodes)
        for frame, width, height, nodes in (
            (20, 100, 200, 0), (90, 100, 200, 1), (180, 100, 200, 3), (260, 100, 200, 7),
            (330, 320, 240, 0), (420, 320, 240, 2), (500, 320, 240, 5), (640, 320, 240, 7),
        )
    ),
    Case("libby", 10, "region", 100, 200, 1),
    Case("breakdance", 20, "region", 100, 200, 2),
    Case("car-shadow", 12, "region", 320, 240, 0),
    Case("bmx-trees", 30, "region", 320, 240, 4),
    Case("cows", 25, "region", 320, 240, 1),
    Case("drift-chicane", 40, "region", 320, 240, 7),
    *(Case("pets", frame, "frame", 0, 0, nodes) for frame, nodes in ((60, 0), (210, 4), (380, 7))),
    *(
        Case(film, frame, "frame", 0, 0, nodes)
        for film, frame, nodes in (("libby", 30, 0), ("cows", 60, 2), ("bmx-trees", 50, 7))
    ),
    *(Case("pets", frame, "border", 0, 0, nodes) for frame, nodes in ((120, 0), (450, 3))),
    *(
        Case(film, frame, "border", 0, 0, nodes)
        for film, frame, nodes in (("car-shadow", 20, 0), ("cows", 80, 1), ("breakdance", 40, 5))
    ),
)  # fmt: skip


def instances(data: Path, cases: tuple[Case, ...] = CASES) -> Iterator[Instance]:
    """Make the instances of those films that are there."""
    pets = _Pets(data) if any(one.film == "pets" for one in cases) and (data / "pets09-s2l1").is_dir() else None
    for case in cases:
        if case.film == "pets" and pets is not None:
            yield posed(case, *pets.pair(case.frame))
        elif (data / "davis2016" / "JPEGImages" / case.film).is_dir():
            yield posed(case, *davis_pair(data / "davis2016", case.film, case.frame))


def davis_pair(root: Path, film: str, frame: int) -> tuple[Float, Float, Bits]:
    """Return the picture before a frame, the frame, and the object's mask in the picture before."""
    pictures = [
        np.float64(cv2.imread(str(root / "JPEGImages" / film / f"{one:05d}.jpg"))) for one in (frame - 1, frame)
    ]
    mask = cv2.imread(str(root / "Annotations" / film / f"{frame - 1:05d}.png"), cv2.IMREAD_GRAYSCALE)
    return pictures[0], pictures[1], mask > 127


class _Pets:
    """Frames of PETS 2009 and what in them differs from the median picture."""

    def __init__(self, data: Path) -> None:
        folder = data / "pets09-s2l1"
        self.truth = read_truth(folder / "gt" / "gt.txt")
        wanted = {one.frame - back for one in CASES if one.film == "pets" for back in (0, 1)}
        self.pictures: dict[int, NDArray[np.uint8]] = {}
        every = []
        for frame in open_source(folder / "video.avi"):
            if frame.index in wanted:
                self.pictures[frame.index] = np.array(frame.image)
            if frame.index % 32 == 0:
                every.append(np.array(frame.image))
        self.ground = np.median(np.stack(every), axis=0)

    def pair(self, index: int) -> tuple[Float, Float, Bits]:
        before, now = np.float64(self.pictures[index - 1]), np.float64(self.pictures[index])
        boxes = self.truth.take(self.truth.frames == index - 1).boxes
        areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        x1, y1, x2, y2 = np.clip(boxes[np.argmax(areas)], 0, [768, 576, 768, 576]).astype(int)
        mask = np.zeros(before.shape[:2], np.bool_)
        mask[y1:y2, x1:x2] = np.abs(before - self.ground).max(axis=2)[y1:y2, x1:x2] > 30
        return before, now, mask


def posed(case: Case, before: Float, now: Float, mask: Bits) -> Instance:
    """Pose the cut of a case: mixtures from the picture before, terms from the picture now."""
    rng = np.random.default_rng(case.frame)
    rows, columns = window(case, mask)
    before, now, mask = before[rows, columns], now[rows, columns], mask[rows, columns]
    ours, theirs = (mixture(sampled(before[part], rng), rng) for part in (mask, ~mask))
    unlike = np.clip(log_density(theirs, now) - log_density(ours, now), -CLIP, CLIP)  # (H, W)
    pairwise, spread = contrast(now)
    node_unary, node_links = observations(case.nodes, unlike, now, ours, theirs, spread)
    unary = np.where(mask, unlike, 0.0) if case.kind == "border" else unlike.copy()
    unary[[0, -1], :] = unary[:, [0, -1]] = HARD
    name = f"{case.film} {case.frame}"
    return Instance(name, case.kind, unary, pairwise, node_unary, node_links)


def window(case: Case, mask: Bits) -> tuple[slice, slice]:
    """Return rows and columns of a case, around the mask."""
    if not case.width:
        return slice(None), slice(None)
    ys, xs = np.nonzero(mask)
    top = int(np.clip(np.median(ys) - case.height // 2, 0, mask.shape[0] - case.height))
    left = int(np.clip(np.median(xs) - case.width // 2, 0, mask.shape[1] - case.width))
    return slice(top, top + case.height), slice(left, left + case.width)


def contrast(picture: Float) -> tuple[Float, float]:
    """Return weights (4, H, W) of the edges E, S, SE, SW (eq. 10), and σ²; 0 where an edge leaves the picture."""
    height, width = picture.shape[:2]
    squares = np.full((4, height, width), np.inf)
    squares[0, :, :-1] = ((picture[:, 1:] - picture[:, :-1]) ** 2).sum(axis=2)
    squares[1, :-1] = ((picture[1:] - picture[:-1]) ** 2).sum(axis=2)
    squares[2, :-1, :-1] = ((picture[1:, 1:] - picture[:-1, :-1]) ** 2).sum(axis=2)
    squares[3, :-1, 1:] = ((picture[1:, :-1] - picture[:-1, 1:]) ** 2).sum(axis=2)
    spread = 4.0 * float(squares[np.isfinite(squares)].mean())
    distance = np.array([1.0, 1.0, np.sqrt(2.0), np.sqrt(2.0)])[:, None, None]
    return LAMBDA_1 / distance * np.exp(-squares / spread), spread


def observations(
    count: int, unlike: Float, picture: Float, ours: Mixture, theirs: Mixture, spread: float
) -> tuple[Float, tuple[tuple[NDArray[np.intp], Float], ...]]:
    """Return unaries and links of the nodes of the largest components that look like the object."""
    alike = cv2.morphologyEx(np.uint8(unlike < 0), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(alike)
    largest = np.argsort(-stats[1:, cv2.CC_STAT_AREA], kind="stable")[:count] + 1
    unaries, links = [], []
    for one in largest:
        pixels = np.flatnonzero(labels == one)
        colours = picture.reshape(-1, 3)[pixels]
        mean = colours.mean(axis=0)
        ratio = np.clip(log_density(theirs, mean) - log_density(ours, mean), -CLIP, CLIP)
        unaries.append(float(ratio) * len(pixels))
        links.append((pixels, LAMBDA_2 * np.exp(-((colours - mean) ** 2).sum(axis=1) / spread)))
    return np.array(unaries, np.float64), tuple(links)


# Mixtures ---------------------------------------------------------------------------------------------------


class Mixture(NamedTuple):
    """A mixture of Gaussians of colours."""

    weights: Float  # (K,) as logs
    means: Float  # (K, 3)
    roots: Float  # (K, 3, 3), Cholesky roots of the inverse covariances
    scale: Float  # (K,), log density at the mean


def sampled(colours: Float, rng: np.random.Generator) -> Float:
    return colours if len(colours) <= SAMPLES else rng.choice(colours, SAMPLES, replace=False)


def mixture(colours: Float, rng: np.random.Generator) -> Mixture:
    """Fit a mixture by some rounds of EM from random colours; fewer Gaussians where there are few pixels."""
    count = max(1, min(COMPONENTS, len(colours) // 20))
    shares = np.full((len(colours), count), 1e-3)
    centres = colours[rng.choice(len(colours), count, replace=False)]
    nearest = ((colours[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
    shares[np.arange(len(colours)), nearest] = 1.0
    for _ in range(ROUNDS):
        shares /= shares.sum(axis=1, keepdims=True)
        fitted = _maximised(colours, shares)
        joint = _joint(fitted, colours)
        shares = np.exp(joint - joint.max(axis=1, keepdims=True))
    return fitted


def _maximised(colours: Float, shares: Float) -> Mixture:
    total = shares.sum(axis=0) + 1e-9
    means = shares.T @ colours / total[:, None]
    apart = colours[:, None] - means  # (N, K, 3)
    covariances = np.einsum("nk,nki,nkj->kij", shares, apart, apart) / total[:, None, None] + np.eye(3)
    roots = np.linalg.cholesky(np.linalg.inv(covariances))
    scale = np.log(np.linalg.det(roots)) - 1.5 * np.log(2 * np.pi)
    return Mixture(np.log(total / total.sum()), means, roots, scale)


def _joint(fitted: Mixture, colours: Float) -> Float:
    """Log densities of each Gaussian times its weight, (..., K)."""
    apart = colours[..., None, :] - fitted.means  # (..., K, 3)
    turned = np.einsum("...ki,kij->...kj", apart, fitted.roots)
    return fitted.weights + fitted.scale - 0.5 * (turned**2).sum(axis=-1)


def log_density(fitted: Mixture, colours: Float) -> Float:
    """Return log densities of colours (..., 3)."""
    joint = _joint(fitted, colours)
    top = joint.max(axis=-1)
    return np.asarray(top + np.log(np.exp(joint - top[..., None]).sum(axis=-1)))
