"""What a step of a level set costs: with the contour's length, not with the picture's area.

    python bench/levelset.py [--rounds N] [--json]

An ellipse of SIZE pixels, in a picture FACTOR times as wide and high, moves towards one that lies a few pixels beside
it: force -1 inside of that and 1 outside, curvature 0.2. `step` is the difference between 60 and 10 steps over 50, so
that it holds its share of redistancing (every 5 steps) but not what a call costs once; `call` is one of 10 steps, as
the contour observer makes it for a frame. Then, on the same pictures, the other functions of `perdure.maths.levelset`.
Medians over the rounds, one thread.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable

import numpy as np

from perdure.maths import levelset, lie

SIZES = ((50, 100), (100, 200), (200, 400))  # width and height of the object
FACTORS = (1.4, 4.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15, help="of which medians are taken")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    arguments = parser.parse_args()
    lines = [measure(*size, factor, arguments.rounds) for size in SIZES for factor in FACTORS]
    for line in lines:
        print(
            "  ".join(
                f"{name} {value if isinstance(value, str) else f'{value:.3g}'}" for name, value in line.items()
            )
        )
    if arguments.json:
        print(json.dumps(lines))


def measure(width: int, height: int, factor: float, rounds: int) -> dict[str, float | str]:
    """Times in ms of one object in one picture."""
    down, right = round(height * factor), round(width * factor)
    y, x = np.indices((down, right))

    def ellipse(shift: float) -> np.ndarray:
        return np.hypot((x - right / 2 - shift) / (width / 2), (y - down / 2 - shift) / (height / 2)) - 1

    phi, force = levelset.redistance(ellipse(0)), np.where(ellipse(4) < 0, -1.0, 1.0)
    lines = levelset.contour(phi)

    def evolve(steps: int) -> Callable[[], object]:
        return lambda: levelset.evolve(phi, force, curvature=0.2, steps=steps)

    motion = lie.SE2.exp([2, 1, 0.1])
    few, many = taken(evolve(10), rounds), taken(evolve(60), rounds)
    return {
        "object": f"{width}x{height}",
        "picture": f"{right}x{down}",
        "contour": levelset.length(lines),
        "step": (many - few) / 50,
        "call": few,
        "redistance": taken(lambda: levelset.redistance(phi), rounds),
        "contour()": taken(lambda: levelset.contour(phi), rounds),
        "carried": taken(lambda: levelset.carried(phi, motion), rounds),
        "moments": taken(lambda: levelset.moments(phi), rounds),
        "sample": taken(lambda: levelset.sample(force, lines[0]), rounds),
    }


def taken(function: Callable[[], object], rounds: int) -> float:
    """Median time in ms; the first call, which may compile, does not count."""
    function()
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        function()
        times.append(1000 * (time.perf_counter() - begun))
    return statistics.median(times)


if __name__ == "__main__":
    main()
