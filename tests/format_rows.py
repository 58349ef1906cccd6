"""Rows for the tests of formats: drawn ones, one of everything, and any that Hypothesis thinks of."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from perdure.files.formats import Content
from perdure.types import Ground, Mask, Outline, Status, Tracks

HEIGHT, WIDTH = 12, 16
SIZE = HEIGHT, WIDTH
FPS = 25.0


def drawn(picture: str, y: int = 0, x: int = 0) -> Mask:
    return Mask(y, x, np.array([[mark == "#" for mark in row] for row in picture.split()]))


RING = drawn("#### #..# ####", 2, 3)
DISC = drawn(".#. ### .#.", 6, 9)
PAIR = drawn("#.# #.#", 1, 11)


def everything() -> Tracks:
    """Two people over four frames, with all that rows may say.

    Person 1 has a silhouette with a hole, is half hidden in frame 1, lost in frame 3; person 2 is in a group in
    frame 1, where the group 7 has a row of its own.
    """
    return Tracks.of(
        frames=[0, 0, 1, 1, 1, 3],
        times=[0.0, 0.0, 0.05, 0.05, 0.05, 0.15],
        ids=[1, 2, 1, 2, 7, 1],
        boxes=[[3, 2, 7, 5], [9, 6, 12, 9], [3.5, 2.25, 8, 6], [9, 6, 12, 9], [3, 2, 12, 9], [4, 2, 8, 5]],
        status=[0, 0, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS, 0, Status.LOST],
        confidence=[1, 0.5, 0.75, 0.5, 1, 0.25],
        classes=["car", "pedestrian", "car", "pedestrian", "", "car"],
        groups=[0, 0, 0, 7, 0, 0],
        inferred=[False, False, False, False, False, True],
        masks=[RING, DISC, RING, DISC, Mask.empty(), Mask.empty()],
        believed=[None, None, drawn("##### ##### ##### #####", 2, 3), None, None, None],
        outlines=[Outline.of([[[3, 2], [7.25, 2], [7.25, 5.5], [3, 5]]]), None, None, None, None, None],
        hidden_side=["", "", "bottom+left", "", "", ""],
        ground=[Ground(1.5, 2.25, 0.5), Ground(-3.0, 4.0), None, None, None, None],
        links=[(0,), (1,), (0, 2), (), (), ()],
    )


def content(tracks: Tracks, **more: object) -> Content:
    return Content(tracks, **{"size": SIZE, "timed": True, "name": "yard", **more})


def at_rate(tracks: Tracks, fps: float = FPS) -> Tracks:
    """The same rows at the times that a file without times gets."""
    return tracks.replace(times=tracks.frames / fps)


@st.composite
def masks(draw: st.DrawFn) -> Mask:
    """A silhouette of one pixel at least, in the picture."""
    height, width = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    bits = draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    picture = np.array(bits).reshape(height, width)
    picture[draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))] = True
    return Mask.of_image(picture, draw(st.integers(0, HEIGHT - height)), draw(st.integers(0, WIDTH - width)))


def numbers(step: float | None, low: float, high: float) -> st.SearchStrategy[float]:
    """float32 numbers, none of them nearer to 0 than a thousandth; multiples of a step where one is given."""
    if step is None:
        return st.floats(low, high, width=32).map(lambda one: one if abs(one) >= 1e-3 else 0.0)
    return st.integers(round(low / step), round(high / step)).map(lambda one: one * step)


@st.composite
def boxes(draw: st.DrawFn, step: float | None) -> list[float]:
    x1, x2 = sorted((draw(numbers(step, -64, 2048)), draw(numbers(step, -64, 2048))))
    y1, y2 = sorted((draw(numbers(step, -64, 2048)), draw(numbers(step, -64, 2048))))
    return [x1, y1, x2, y2]


@st.composite
def said(
    draw: st.DrawFn, *, step: float | None = None, seen: bool = False, classes: tuple[str, ...] = ("", "dog")
) -> Tracks:
    """Up to six rows: box, class and confidence; with `seen`, silhouettes instead of boxes."""
    keys = sorted(draw(st.sets(st.tuples(st.integers(0, 6), st.integers(1, 4)), max_size=6)))
    count = len(keys)
    shapes = [draw(masks()) for _ in keys] if seen else [Mask.empty()] * count
    return Tracks.of(
        frames=[frame for frame, _ in keys],
        times=[frame / FPS for frame, _ in keys],
        ids=[identity for _, identity in keys],
        boxes=[mask.box for mask in shapes] if seen else [draw(boxes(step)) for _ in keys],
        masks=shapes,
        classes=[draw(st.sampled_from(classes)) for _ in keys],
        confidence=[draw(numbers(step, 0, 1)) for _ in keys],
        status=[draw(st.sampled_from([Status.VISIBLE, Status.PARTLY_OCCLUDED])) for _ in keys],
    )
