"""The ground plane: how even heights are on it, and what it brings to the association.

    python bench/ground.py [--data DIR] [--clips NAME ...] [--trackers NAME ...] [--json] [--write]

plane        the camera that `--calibration auto` finds in each clip's detections, with deviations; on it the heights of
             the truth's boxes in metres: their median, how far one lies off it on the median, and the same of the
             medians of a grid of 4 x 4 cells (of 50 rows or more). For pets09-s2l1 also the calibration that was
             published with PETS 2009, and how long distances between people come out against it.
association  IDF1, MOTA and switches of each tracker with the estimated plane and without, all else equal: the same
             detections, at the defaults. `overlap`, which has no second look for doubtful boxes, gets those of yolox
             from a score of 0.5.

mot17-text has no pictures: boxes alone. pets09-s2l1 is seen with its own detections and with the background detector's
silhouettes, recorded once. A clip that is not there is left out with a note. --write puts the tables into
docs/ground.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from perdure import fold
from perdure.detect import Recorded
from perdure.files.calibration import calibration_of_json
from perdure.files.mot import read_truth
from perdure.files.whole import whole_file
from perdure.metrics import score
from perdure.pipeline import Plan, plan
from perdure.scene.ground import Ground, feet
from perdure.types import Rows, Use

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/ground.md"
TITLE = "## Figures"
TRACKERS = ("compound", "overlap")
LEAST = 50  # rows of a cell that counts
PETS = {  # view 1, R. Tsai's model; camera and lens as published with the data set, in metres and pixels
    "focal": [1185.0013, 1194.6061],
    "centre": [324.2215, 282.5665],
    "turns": [2.0405458695, -0.89337703748, -0.43056124791],
    "translation": [0.82873214225, -3.1754796051, 35.469298547],
    "bend": 0.15772,  # straight = seen (1 + bend r²), r in focal lengths
}


class Clip(NamedTuple):
    """A source, its detections and its truth."""

    name: str
    detections: str
    source: Path
    detector: Path | None  # None for the background detector
    truth: Path


def clips(data: Path) -> list[Clip]:
    """Every clip with every kind of detections."""
    found = []
    for name in ("MOT17-02", "MOT17-04"):
        folder = data / "mot17-text" / name
        for kind, file in (("FRCNN", "det_FRCNN.txt"), ("yolox", "det_yolox_x_ablation.txt")):
            found.append(Clip(name, kind, folder, folder / "det" / file, folder / "gt/gt.txt"))
    pets = data / "pets09-s2l1"
    found.append(Clip("pets09-s2l1", "FRCNN", pets / "video.avi", pets / "det/det.txt", pets / "gt/gt.txt"))
    found.append(Clip("pets09-s2l1", "silhouettes", pets / "video.avi", None, pets / "gt/gt.txt"))
    return found


def main() -> None:
    arguments = read_arguments()
    result: dict[str, Any] = {"planes": [], "association": []}
    for clip in clips(arguments.data):
        if arguments.clips and clip.name not in arguments.clips:
            continue
        if not clip.source.exists():
            print(f"note: {clip.name} is not there", file=sys.stderr)
            continue
        measure(clip, arguments.trackers, result)
    tables = [*plane_tables(result["planes"]), association_table(result["association"])]
    print("\n\n".join(tables))
    if arguments.write:
        text = PAGE.read_text(encoding="utf-8")
        before = text[: text.index(TITLE)] if TITLE in text else text.rstrip() + "\n\n"
        with whole_file(PAGE) as file:
            file.write(before + TITLE + "\n\n`python bench/ground.py --write`\n\n" + "\n\n".join(tables) + "\n")
    if arguments.json:
        print(json.dumps(result))


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--clips", nargs="+", metavar="NAME", help="only these")
    parser.add_argument("--trackers", nargs="+", metavar="NAME", default=TRACKERS, help=", ".join(TRACKERS))
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the section in docs/ground.md")
    return parser.parse_args()


def measure(clip: Clip, trackers: list[str], result: dict[str, Any]) -> None:
    """Estimate the plane of a clip, and track on it and without it."""
    truth = read_truth(clip.truth)
    made = recorded(clip)
    known = made.prepared()
    made = dataclasses.replace(made, body=0.0)
    told, ground = known.estimate, known.scene.ground
    assert told is not None
    if ground is None:
        print(f"note: {clip.name}, {clip.detections}: {told.verdict}", file=sys.stderr)
        return
    off = np.sqrt(np.diag(told.covariance))
    about = {
        "clip": clip.name,
        "detections": clip.detections,
        "people": told.people,
        "focal": told.focal / made.scene.width,
        "height": [told.height, told.height * off[3]],
        "tilt": [math.degrees(told.tilt), math.degrees(off[1])],
        "roll": [math.degrees(told.roll), math.degrees(off[2])],
        **evenness(ground, truth),
    }
    if clip.name.startswith("pets"):
        published = pets_calibration()
        about |= {"ratio": distances_against(ground, published, truth), "published": evenness(published, truth)}
    result["planes"].append(about)
    for name in trackers:
        figures = {}
        for what, scene in (("without", made.scene), ("with", known.scene)):
            tracker = (
                plan(clip.source, tracker=name).tracker if clip.detector is None else with_tracker(clip, name)
            )
            figures[what] = scored(dataclasses.replace(made, scene=scene, tracker=tracker), name, truth)
        row = {"clip": clip.name, "detections": clip.detections, "tracker": name, **figures}
        print(json.dumps(row), file=sys.stderr)
        result["association"].append(row)
    made.source.close()


def recorded(clip: Clip) -> Plan:
    """The plan of a clip on recorded detections, with the ground to be estimated."""
    made = plan(clip.source, tracker="overlap", detector=clip.detector, calibration="auto")
    if clip.detector is None:
        looked = dataclasses.replace(made, body=0.0).prepared()
        seen = {frame.index: regions for frame, regions in looked.seen()}
        made = dataclasses.replace(made, detector=Recorded(regions=seen))
    return made


def with_tracker(clip: Clip, name: str) -> Any:
    made = plan(clip.source, tracker=name, detector=clip.detector)
    made.source.close()
    return made.tracker


def scored(made: Plan, name: str, truth: Rows) -> dict[str, float]:
    """IDF1, MOTA and switches of a run."""
    if name == "overlap":
        made = dataclasses.replace(made, detector=dataclasses.replace(made.detector, least_score=0.5))
    tracks = fold.settle([step.report for step in made.steps()])
    figures = score(tracks.counted(), truth).figures
    return {"IDF1": 100 * figures["IDF1"], "MOTA": 100 * figures["MOTA"], "switches": figures["IDSW"]}


def evenness(ground: Ground, truth: Rows) -> dict[str, float]:
    """The median height of people (m), how far one lies off (share), and the medians of cells."""
    boxes = truth.boxes[truth.use == Use.SCORED]
    heights = ground.heights(boxes)
    there = np.isfinite(heights)
    boxes, heights = boxes[there], heights[there]
    middle = float(np.median(heights))
    cell = np.clip(np.floor(feet(boxes) / np.array(ground.size) * 4), 0, 3) @ (1, 4)
    medians = [float(np.median(heights[cell == one])) for one in range(16) if (cell == one).sum() >= LEAST]
    off = np.abs(np.array(medians) / middle - 1)
    return {
        "median": middle,
        "deviation": float(np.median(np.abs(heights / middle - 1))),
        "cells": len(medians),
        "cell_deviation": float(np.median(off)),
        "cell_largest": float(off.max()),
        "without_place": float((~there).mean()),
    }


def distances_against(ground: Ground, published: Ground, truth: Rows) -> list[float]:
    """Quartiles of the ratios of distances between people of one frame, ours to the published ones."""
    ratios = []
    for frame in np.unique(truth.frames)[::5]:
        points = feet(truth.boxes[(truth.frames == frame) & (truth.use == Use.SCORED)])
        one, other = (each.places(points) for each in (ground, published))
        first, second = np.triu_indices(len(points), 1)
        far = np.linalg.norm(other[first] - other[second], axis=1)
        ratios.append((np.linalg.norm(one[first] - one[second], axis=1) / far)[far > 2.0])
    return [float(one) for one in np.nanquantile(np.concatenate(ratios), (0.25, 0.5, 0.75))]


def pets_calibration() -> Ground:
    """The published calibration as a calibration file would say it; Tsai's bending turned round as a series."""
    x, y, z = PETS["turns"]
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    bend = PETS["bend"]
    camera = {
        "focal": PETS["focal"],
        "centre": PETS["centre"],
        "distortion": [-bend, 3 * bend**2, 0.0, 0.0, -12 * bend**3],
        "rotation": (about_z @ about_y @ about_x).tolist(),
        "translation": PETS["translation"],
    }
    return calibration_of_json({"frame": [768, 576], "camera": camera}, 768, 576)


def plane_tables(planes: list[dict[str, Any]]) -> list[str]:
    """The planes, and PETS beside its published calibration."""
    head = (
        "clip | detections | people | height, m | tilt | roll | median person, m | deviation | of cells | largest"
    )
    lines = [f"| {head} |", "|" + "---|" * (head.count("|") + 1)]
    for one in planes:
        lines.append(
            f"| {one['clip']} | {one['detections']} | {one['people']} | {one['height'][0]:.1f} ± {one['height'][1]:.1f} "
            f"| {one['tilt'][0]:.1f}° ± {one['tilt'][1]:.1f} | {one['roll'][0]:.1f}° ± {one['roll'][1]:.1f} "
            f"| {one['median']:.2f} | {100 * one['deviation']:.1f} % | {100 * one['cell_deviation']:.1f} % "
            f"of {one['cells']} | {100 * one['cell_largest']:.1f} % |"
        )
    tables = ["\n".join(lines)]
    pets = [one for one in planes if "published" in one]
    if pets:
        known = pets[0]["published"]
        words = [
            f"On the calibration published with PETS 2009 (7.1 m, 16.5°, 3.1°) the median person is {known['median']:.2f} m "
            f"high, one lies {100 * known['deviation']:.1f} % off, the median of cells {100 * known['cell_deviation']:.1f} %."
        ]
        words += [
            f"Distances between people, estimated from {one['detections']}, are {one['ratio'][1]:.2f} of those on it "
            f"(quartiles {one['ratio'][0]:.2f} and {one['ratio'][2]:.2f})."
            for one in pets
        ]
        tables.append("\n".join(words))
    return tables


def association_table(rows: list[dict[str, Any]]) -> str:
    """What the plane brings, and the means."""
    head = "clip | detections | tracker | IDF1 without | with | | MOTA without | with | switches without | with"
    lines = [f"| {head} |", "|" + "---|" * (head.count("|") + 1)]
    for one in rows:
        a, b = one["without"], one["with"]
        lines.append(
            f"| {one['clip']} | {one['detections']} | {one['tracker']} | {a['IDF1']:.1f} | {b['IDF1']:.1f} "
            f"| {b['IDF1'] - a['IDF1']:+.1f} | {a['MOTA']:.1f} | {b['MOTA']:.1f} | {a['switches']:.0f} | {b['switches']:.0f} |"
        )
    for tracker in dict.fromkeys(one["tracker"] for one in rows):
        own = [one for one in rows if one["tracker"] == tracker]
        a, b = (
            {key: np.mean([one[what][key] for one in own]) for key in ("IDF1", "MOTA", "switches")}
            for what in ("without", "with")
        )
        lines.append(
            f"| mean | | {tracker} | {a['IDF1']:.1f} | {b['IDF1']:.1f} | {b['IDF1'] - a['IDF1']:+.1f} "
            f"| {a['MOTA']:.1f} | {b['MOTA']:.1f} | {a['switches']:.0f} | {b['switches']:.0f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
