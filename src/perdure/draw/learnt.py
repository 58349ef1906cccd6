"""What a context was learnt from as a picture: for each feature how alike same pairs and different ones are."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.draw.chart import COLOURS, GRID, INK, PAPER, ticks, width_of, write
from perdure.features.pool import POOL
from perdure.learn import Learnt, link_similarity
from perdure.types import Image

WIDTH, PANEL, _KEY = 620, 300, 40  # px
_LEFT, _RIGHT, _TOP, _BOTTOM = 30, 20, 62, 34  # px round a panel's axis
_BINS = 50
_SAME, _DIFFERENT, _CHOSEN = COLOURS[0], COLOURS[1], COLOURS[2]
_LINK = "link similarity (eq. 10)"


def plot(learnt: Learnt) -> Image:
    """Return a panel for each feature that is known of any pair, and one for the link similarity, RGB, two abreast.

    Shares of same pairs are drawn as a filled curve, those of different ones as another; thresholds that rounds chose as
    upright lines, the longer the more α they got; levels as marks below the axis.
    """
    samples, context = learnt.samples, learnt.context
    panels = []
    for k, name in enumerate(POOL):
        there = samples.known[:, k]
        if name not in context.training.alone:
            continue
        alone = context.training.alone[name]
        words = f"weight {context.weights.get(name, 0.0):.2f}   AUC {alone.separation:.3f}   error {100 * alone.error:.1f} %"
        rounds = [(one.threshold, one.alpha) for one in learnt.boosted.rounds if one.feature == k]
        kinds = [samples.similarities[there & kind, k] for kind in (samples.same, ~samples.same)]
        panels.append(_panel(name, words, kinds, rounds, context.levels.get(name, ())))
    link, told = link_similarity(context, samples)
    kinds = [link[told & kind] for kind in (samples.same, ~samples.same)]
    words = f"Th1 {context.similar:.2f}   AUC {context.training.separation:.3f}"
    panels.append(_panel(_LINK, words, kinds, [(context.similar, 1.0)], ()))
    if len(panels) % 2:
        panels.append(np.full_like(panels[0], PAPER))
    return np.vstack([*(np.hstack(panels[k : k + 2]) for k in range(0, len(panels), 2)), _key()])


def _key() -> Image:
    """What the axes and marks mean."""
    picture = np.full((_KEY, 2 * WIDTH, 3), PAPER, np.uint8)
    write(picture, "across: similarity; up: share of pairs (its root)", (_LEFT, 24))
    x = WIDTH + _LEFT
    cv2.line(picture, (x + 4, 8), (x + 4, 28), _CHOSEN, 2)
    write(picture, "threshold of a round, or Th1", (x + 16, 24))
    x += 44 + width_of("threshold of a round, or Th1")
    cv2.fillPoly(picture, [np.array([(x, 13), (x - 6, 23), (x + 6, 23)], np.int32)], INK)
    write(picture, "level", (x + 16, 24))
    return picture


def _panel(
    title: str,
    words: str,
    kinds: Sequence[NDArray[np.float64]],
    rounds: Sequence[tuple[float, float]],
    levels: Sequence[float],
) -> Image:
    """A panel: `kinds` are the similarities of same pairs and of different ones."""
    picture = np.full((PANEL, WIDTH, 3), PAPER, np.uint8)
    shares = [np.histogram(one, _BINS, (0.0, 1.0))[0] / max(1, len(one)) for one in kinds]
    highest = max(1e-9, *(float(np.sqrt(one).max()) for one in shares))
    wide, high = WIDTH - _LEFT - _RIGHT, PANEL - _TOP - _BOTTOM

    def place(similarity: float, height: float) -> tuple[int, int]:
        return round(_LEFT + wide * similarity), round(_TOP + high * (1 - height))

    for value in ticks(0.0, 1.0, 5):
        cv2.line(picture, place(value, 0), place(value, 1), GRID, 1)
        write(picture, f"{value:g}", (place(value, 0)[0], PANEL - _BOTTOM + 24), middle=True)
    for share, colour in zip(shares, (_SAME, _DIFFERENT), strict=True):
        tops = np.sqrt(share) / highest  # roots: a tenth of a percent is still seen
        steps = [place((k + side) / _BINS, tops[k]) for k in range(_BINS) for side in (0, 1)]
        corners = np.array([place(0, 0), *steps, place(1, 0)], np.int32)
        filled = picture.copy()
        cv2.fillPoly(filled, [corners], colour)
        picture = cv2.addWeighted(filled, 0.35, picture, 0.65, 0).astype(np.uint8)
        cv2.polylines(picture, [corners], True, colour, 1, cv2.LINE_AA)
    most = max([alpha for _, alpha in rounds], default=1.0)
    for threshold, alpha in rounds:
        cv2.line(picture, place(threshold, 0), place(threshold, 0.15 + 0.85 * alpha / most), _CHOSEN, 2)
    for level in levels:
        x, y = place(level, 0)
        cv2.fillPoly(picture, [np.array([(x, y + 1), (x - 6, y + 11), (x + 6, y + 11)], np.int32)], INK)
    cv2.line(picture, place(0, 0), place(1, 0), INK, 1)
    write(picture, title, (_LEFT, 24))
    write(picture, words, (_LEFT, 48))
    x = WIDTH - _RIGHT
    for name, colour in (("different", _DIFFERENT), ("same", _SAME)):
        x -= width_of(name)
        write(picture, name, (x, 24))
        cv2.line(picture, (x - 30, 19), (x - 8, 19), colour, 5)
        x -= 44
    return picture
