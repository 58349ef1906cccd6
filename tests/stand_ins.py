"""What the commands of README and docs name (street.mp4, gt.txt, yolox_nano.onnx …), drawn and tracked once."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from networks import network

from perdure.demo import Walker, World
from perdure.demo.figures import Clothes
from perdure.detect.coco import COCO
from perdure.files.film import Film, save_png
from perdure.files.mot import write_rows
from perdure.types import Tracks

DOCS = Path(__file__).parents[1] / "docs"
WIDTH, HEIGHT, FPS = 640, 360, 25.0
LONG, SHORT = 130, 50  # frames: the docs ask for frame 120 of a run, and mark frame 46 of a clip
CELLS = 3549  # of a network that takes 416x416
TOML = re.compile(r"```toml\n(.*?)```", re.S)


def stand_ins(place: Path) -> Path:
    """Fill a folder with everything that the docs name, and return it."""
    world = square(LONG)
    truth = world.truth()
    write_film(place / "street.mp4", world)
    write_film(place / "clip.mp4", square(SHORT))
    os.link(place / "street.mp4", place / "yard.mp4")
    for name in ("dish.mp4", "d.mp4"):
        os.link(place / "clip.mp4", place / name)
    boxes_and_truths(place, truth)
    masks(place)
    places(place)
    detectors(place)
    runs(place)
    return place


def square(count: int) -> World:
    """Nine people in three rows, smaller farther off: two come in at the left in front, two go out there behind."""
    rows = (  # the feet, how tall, how far each comes in the long film, where each begins
        (110, 115.0, 150, (60, 230, 400)),
        (212, 115.0, -220, (60, 150, 420)),
        (345, 115.0, 260, (-40, -150, 300)),
    )
    walkers = []
    for row, (foot, tall, way, starts) in enumerate(rows):
        for k, start in enumerate(starts):
            shirt = (60 + 60 * k, 200 - 70 * row, 40 + 80 * ((k + row) % 3))
            clothes = Clothes(shirt, (40, 40 + 40 * row, 90))
            path = ((0.0, start, foot), (LONG / FPS, start + way, foot))
            walkers.append(Walker("person", path, 0.36 * tall, tall, clothes))
    return World(
        WIDTH, HEIGHT, fps=FPS, count=count, walkers=tuple(walkers), backdrop="square", horizon=-180.0, noise=2.0
    )


def write_film(path: Path, world: World) -> None:
    with Film(path, world.width, world.height, fps=world.fps) as film:
        for frame in world.frames():
            film.write(frame.image, frame.time)


def boxes_and_truths(place: Path, truth: Tracks) -> None:
    """The truth under every name that it has in the docs, and as a detector's boxes."""
    (place / "better.json").write_text('{"patience": 2.5}\n', encoding="utf-8")  # as `perdure tune` writes it
    for name in ("gt.txt", "street/gt/gt.txt", "yard/gt/gt.txt"):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        with (place / name).open("w", encoding="utf-8") as file:
            write_rows(file, truth)
    seen = [re.sub(r"^(\d+),\d+,", r"\1,-1,", line) for line in (place / "gt.txt").read_text().splitlines()]
    for name in ("boxes.txt", "street.txt", "yard.txt", "yolox.txt"):
        (place / name).write_text("\n".join(seen) + "\n", encoding="utf-8")
    (place / "MOT17-04").mkdir()
    (place / "MOT17-04/seqinfo.ini").write_text(
        f"[Sequence]\nname=MOT17-04\nimDir=img1\nframeRate=25\nseqLength={LONG}\nimWidth={WIDTH}\nimHeight={HEIGHT}\n"
        "imExt=.jpg\n",
        encoding="utf-8",
    )


def masks(place: Path) -> None:
    """Two things, marked by their ids."""
    marks = np.zeros((HEIGHT, WIDTH), np.uint8)
    marks[240:340, 60:100] = 1
    marks[130:210, 300:330] = 2
    save_png(place / "mask.png", marks)


def places(place: Path) -> None:
    """Zones, a calibration and scenarios of the place; scenarios are those of the docs."""
    stop = [[400, 60], [600, 60], [600, 340], [400, 340]]
    zones = {
        "type": "FeatureCollection",
        "features": [
            _zone("ground", "bus stop", stop),
            _zone("ground", "gate", [[0, 0], [60, 0], [60, 360], [0, 360]]),
        ],
    }
    for name in ("street.json", "yard.json"):
        (place / name).write_text(json.dumps(zones), encoding="utf-8")
    corners = [([100, 110], [0, 20]), ([540, 110], [8, 20]), ([620, 345], [6, 5]), ([20, 345], [2, 5])]
    points = [{"image": image, "ground": ground} for image, ground in corners]
    (place / "calibration.json").write_text(
        json.dumps({"frame": [WIDTH, HEIGHT], "points": points}), encoding="utf-8"
    )
    examples = TOML.findall((DOCS / "scenarios.md").read_text(encoding="utf-8"))
    (place / "own.toml").write_text("\n".join(examples), encoding="utf-8")


def _zone(kind: str, name: str, ring: list[list[int]]) -> dict[str, object]:
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    return {"type": "Feature", "properties": {"kind": kind, "name": name}, "geometry": geometry}


def detectors(place: Path) -> None:
    """A YOLOX that sees nothing sure, and the same for OpenVINO."""
    output = {"output": np.full((1, CELLS, 85), 0.01, np.float32)}
    drawn = network(place / "yolox_nano.onnx", output, shape=(1, 3, 416, 416))
    (place / "names.txt").write_text("\n".join(COCO) + "\n", encoding="utf-8")
    try:
        import openvino
    except ImportError:
        return
    openvino.save_model(openvino.convert_model(str(drawn)), str(place / "person-detection-0200.xml"))


def runs(place: Path) -> None:
    """Runs under the names that the docs give them, with reasons to explain; tracks in other programs' files."""
    words = [
        "track",
        "street.mp4",
        "--detector",
        "boxes.txt",
        "--tracker",
        "multifeature",
        "--zones",
        "street.json",
    ]
    _perdure(place, *words, "-o", "run", "--no-video")
    for name in ("perdure-runs/street", "perdure-runs/clip", "perdure-runs/demo/run"):
        shutil.copytree(place / "run", place / name)
    (place / "label_02").mkdir()
    _perdure(place, "export", "run", "--format", "kitti", "-o", "label_02/0000.txt")


def _perdure(place: Path, *words: str) -> None:
    subprocess.run(
        [sys.executable, "-m", "perdure", *words], cwd=place, check=True, capture_output=True, timeout=300
    )
