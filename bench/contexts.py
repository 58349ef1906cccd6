"""What `perdure learn` learns from each sequence, and how well that tells pairs apart in the others.

    python bench/contexts.py [--data DIR] [--only NAME ...] [--library] [--json]

Sequences: MOT17-02 and MOT17-04 with two sets of detections (no pictures), and pets09-s2l1 with its pictures. The first
table has the weights; the second, for each that is learnt from (down) and tested on (across), the mean over the others of
1 - AUC, in percent, of the link similarity (eq. 10): with equal weights, displacement alone, by the paper's
rule from the same pairs (one threshold, no balance, no levels), as we learn.
Of MOT17 neither set of detections of a sequence is tested on what was learnt from the other. --library writes the
contexts that come with the package, into src/perdure/contexts. The data is read from $PERDURE_DATA or ../shared/data
beside the repository.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from perdure.cli.tables import aligned
from perdure.features.pool import POOL
from perdure.files.contexts import LIBRARY, write_context
from perdure.files.scored import read_scored_truth
from perdure.learn import PAPER, Film, Learning, Samples, context_of, learn, link_similarity
from perdure.maths.boost import separation
from perdure.pipeline import plan
from perdure.scene.context import Context

ROOT = Path(__file__).resolve().parents[1]


class Sequence(NamedTuple):
    place: str  # what is tested on something else must differ in it
    source: str
    detections: str
    context: str  # its name in the library
    fps: float | None = None


SEQUENCES = {
    "02-yolox": Sequence("mot17-text/MOT17-02", "", "det/det_yolox_x_ablation.txt", "square-dense"),
    "02-frcnn": Sequence("mot17-text/MOT17-02", "", "det/det_FRCNN.txt", "square-sparse"),
    "04-yolox": Sequence("mot17-text/MOT17-04", "", "det/det_yolox_x_ablation.txt", "night-street-dense"),
    "04-frcnn": Sequence("mot17-text/MOT17-04", "", "det/det_FRCNN.txt", "night-street-sparse"),
    "pets": Sequence("pets09-s2l1", "video.avi", "det/det.txt", "campus", 7.0),
}
PAIRS = 60_000


def film_of(data: Path, name: str) -> Film:
    one = SEQUENCES[name]
    folder = data / one.place
    made = plan(str(folder / one.source), detector=folder / one.detections, fps=one.fps).prepared()
    truth = read_scored_truth(folder, masks=False).boxes
    assert truth is not None
    return Film(made.source.name, made.seen(), truth, made.scene, True)


def tested(context: Context, samples: Samples) -> float:
    """1 - AUC in percent."""
    link, told = link_similarity(context, samples)
    return 100 * (1 - float(separation(link[:, None], told[:, None], samples.labels)[0]))


def alike(samples: Samples) -> Context:
    there = samples.known.any(axis=0)
    return Context("equal", {name: 1.0 for name, known in zip(POOL, there, strict=True) if known})


WAYS: dict[str, Callable[[Samples], Context]] = {
    "equal": alike,
    "displacement": lambda samples: Context("displacement", {"displacement_2d": 1.0}),
    "paper's rule": lambda samples: context_of(samples, replace(PAPER, most=PAIRS), "paper").context,
    "learnt": lambda samples: context_of(samples, Learning(most=PAIRS), "learnt").context,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--data", type=Path, default=Path(os.environ.get("PERDURE_DATA", ROOT.parent / "shared/data"))
    )
    parser.add_argument("--only", nargs="+", choices=SEQUENCES, default=list(SEQUENCES))
    parser.add_argument("--library", action="store_true")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    found = {}
    for name in asked.only:
        one = learn([film_of(asked.data, name)], Learning(most=PAIRS), SEQUENCES[name].context)
        found[name] = one
        if asked.library:
            write_context(LIBRARY / f"{one.context.name}.json", one.context)
    rows = [["weights", *POOL, "Th1", "AUC"]]
    for name, one in found.items():
        weights = [f"{one.context.weights.get(feature, 0.0):.2f}" for feature in POOL]
        rows.append([name, *weights, f"{one.context.similar:.2f}", f"{one.context.training.separation:.4f}"])
    print(aligned(rows))
    figures: dict[str, dict[str, float]] = {}
    for name, one in found.items():
        others = [other.samples for key, other in found.items() if SEQUENCES[key].place != SEQUENCES[name].place]
        if others:
            figures[name] = {
                way: float(np.mean([tested(make(one.samples), samples) for samples in others]))
                for way, make in WAYS.items()
            }
    rows = [["1 - AUC in others, %", *WAYS]]
    rows += [[name, *(f"{figures[name][way]:.2f}" for way in WAYS)] for name in figures]
    print(f"\n{aligned(rows)}")
    if asked.json:
        print(
            json.dumps(
                {"weights": {name: dict(one.context.weights) for name, one in found.items()}, "others": figures}
            )
        )


if __name__ == "__main__":
    main()
