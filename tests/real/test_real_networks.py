"""Real networks on a real film: what they find, and that they find it again; skipped where the data is absent."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import perdure
from perdure.files.mot import read_truth
from perdure.files.networks import read_network
from perdure.metrics import score
from perdure.types import Rows

DATA = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared" / "data"))
FILM, MODELS = DATA / "pets09-s2l1", DATA / "models"
YOLOX, PEOPLE = MODELS / "yolox_nano_416.onnx", MODELS / "person-detection-0200.xml"
pytestmark = pytest.mark.skipif(
    not (FILM.is_dir() and YOLOX.is_file()), reason=f"no films and networks at {DATA}; set PERDURE_DATA"
)


@pytest.mark.parametrize(
    ("engine", "file", "names", "least"),
    [("onnxruntime", YOLOX, None, 0.25), ("openvino", PEOPLE, ["person"], 0.2)],
)
def test_people_are_found_at_an_iou_of_a_half(engine, file, names, least):
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    word = f"{'onnx' if engine == 'onnxruntime' else engine}:{file}"
    made = perdure.plan(
        FILM / "video.avi",
        detector=word,
        class_names=names,
        classes="person",
        stride=40,
        parameters={"network_score": least},
    )
    seen = list(made.seen())
    made.source.close()
    truth = read_truth(FILM / "gt" / "gt.txt")
    frames = np.concatenate([np.full(len(regions), frame.index) for frame, regions in seen])
    boxes = np.concatenate([regions.boxes for _, regions in seen])
    said = Rows.of(frames=frames, ids=np.arange(1, len(boxes) + 1), boxes=boxes)
    figures = score(said, truth.take(np.isin(truth.frames, [frame.index for frame, _ in seen]))).figures
    assert figures["Recall"] > 0.85
    assert figures["Precision"] > 0.7


def test_the_layout_of_yolox_is_known_and_its_classes_are_those_of_coco():
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    model = read_network("onnx", YOLOX)
    assert (model.layout.name, len(model.known), model.known[0]) == ("YOLOX", 80, "person")
    assert model.layout.fit.about() == "416x416, in the corner, BGR 0 to 255"


@pytest.mark.slow
def test_a_network_says_the_same_bytes_in_any_process_with_any_number_of_threads(tmp_path):
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    digests = set()
    for threads in ("1", "2"):
        out = tmp_path / f"{threads}.jsonl"
        words = ["detect", FILM / "video.avi", "--detector", f"onnx:{YOLOX}", "--end", "3f", "-o", out]
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENCV_FOR_THREADS_NUM": threads}
        subprocess.run(
            [sys.executable, "-m", "perdure", *map(str, words)], env=environment, check=True, capture_output=True
        )
        digests.add(hashlib.sha256(out.read_bytes()).hexdigest())
    assert len(digests) == 1
