"""Files of regions: what `perdure detect` writes is what a recorded detector sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from worlds import crossing

from perdure.errors import FormatError
from perdure.files.regions import read_regions, write_regions
from perdure.types import Frame, Regions


def test_regions_with_masks_scores_and_classes_read_back(tmp_path: Path):
    seen = [(frame, regions) for frame, regions in crossing().seen()]
    seen[5] = (seen[5][0], Regions.of([[0.1, 2, 3, 4]], scores=np.float32([0.3]), classes=["dog"]))
    write_regions(tmp_path / "r.jsonl", seen)
    again = read_regions(tmp_path / "r.jsonl")
    assert all(again[frame.index].equals(regions) for frame, regions in seen)


def test_a_frame_that_is_not_there_has_no_regions(tmp_path: Path):
    write_regions(tmp_path / "r.jsonl", [(Frame(3, 0.3), Regions.of([[0, 0, 1, 1]]))])
    assert list(read_regions(tmp_path / "r.jsonl")) == [3]


def test_boxes_alone_go_through_motchallenge_text(tmp_path: Path):
    write_regions(tmp_path / "r.txt", [(Frame(3, 0.3), Regions.of([[0, 0, 10, 20]], scores=[0.5]))])
    again = read_regions(tmp_path / "r.txt")[3]
    assert (again.boxes.tolist(), again.scores.tolist()) == ([[0, 0, 10, 20]], [0.5])


def test_an_unknown_ending_is_refused_before_anything_is_written(tmp_path: Path):
    with pytest.raises(FormatError, match=r"\.jsonl"):
        write_regions(tmp_path / "r.xml", [])
    assert not list(tmp_path.iterdir())


def test_a_broken_input_leaves_no_half_file(tmp_path: Path):
    def breaks():
        yield Frame(0, 0.0), Regions.empty()
        raise RuntimeError("cable pulled")

    with pytest.raises(RuntimeError):
        write_regions(tmp_path / "r.jsonl", breaks())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "line", ['{"frame":1}', '{"frame":1,"boxes":[[1,2]]}', '{"frame":1,"boxes":[[0,0,1,1]],"scores":[1,2]}']
)
def test_a_line_that_holds_no_regions_is_named(tmp_path: Path, line: str):
    path = tmp_path / "r.jsonl"
    write_regions(path, [])
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(FormatError, match="line 2"):
        read_regions(path)
