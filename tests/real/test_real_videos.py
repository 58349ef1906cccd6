"""Real videos with truth, the first seconds of each; skipped where the data is absent."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import perdure
from perdure.files.mot import read_tracks
from perdure.files.mot_table import read_table
from perdure.metrics.clear import clear

DATA = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no videos at {DATA}; set PERDURE_DATA")


def truth_of(path: Path, frames: int) -> perdure.Tracks:
    rows = read_tracks(path)
    return rows.take((read_table(path).values[:, 6] > 0) & (rows.frames < frames))


@pytest.mark.parametrize(
    ("video", "truth", "frames", "recall", "precision"),
    [
        ("pets09-s2l1/video.avi", "pets09-s2l1/gt/gt.txt", 200, 0.45, 0.45),
        ("composites/crossing2/video.mp4", "composites/crossing2/gt/gt.txt", 120, 0.8, 0.8),
        ("composites/group4/video.mp4", "composites/group4/gt/gt.txt", 150, 0.6, 0.9),
    ],
)
def test_people_on_real_ground_are_found_from_pixels_alone(video, truth, frames, recall, precision):
    said = perdure.track(DATA / video, end=f"{frames}f").counted()
    figures = clear(said, truth_of(DATA / truth, frames))
    assert figures.recall > recall, figures
    assert figures.precision > precision, figures


def test_eight_fish_are_followed_in_a_grey_film():
    said = perdure.track(DATA / "fish8/test_A.avi", end="60f").counted()
    assert 6 <= np.median(np.bincount(said.frames)[20:]) <= 9


def test_cars_on_a_motorway_are_followed():
    said = perdure.track(DATA / "cdnet-highway/video.avi", start="600f", end="700f").counted()
    assert len(set(said.ids.tolist())) >= 2
    assert (said.frames >= 600).all()


def test_a_folder_of_images_is_a_film():
    said = perdure.track(DATA / "cdnet-fall/input", fps=25, end="60f")
    assert len(said) > 20


def test_detections_of_another_program_become_tracks():
    sequence = DATA / "mot17-text/MOT17-02"
    found = perdure.track(sequence, detector=sequence / "det/det_FRCNN.txt", end="200f").counted()
    figures = clear(found, truth_of(sequence / "gt/gt.txt", 200))
    assert figures.precision > 0.7, figures


def test_an_image_free_folder_without_det_txt_names_the_candidates():
    with pytest.raises(perdure.ParameterError, match=r"det_FRCNN\.txt"):
        perdure.track(DATA / "mot17-text/MOT17-02")
