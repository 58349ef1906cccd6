"""Files of regions: what `perdure detect` writes is what a recorded detector sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from worlds import crossing

from perdure.detect import Recorded
from perdure.errors import FormatError
from perdure.files.regions import read_regions, write_regions
from perdure.types import Event, Frame, Regions, Scene


def test_regions_with_masks_scores_and_classes_read_back(tmp_path: Path):
    seen = [(frame, regions) for frame, regions in crossing().seen()]
    seen[5] = (seen[5][0], Regions.of([[0.1, 2, 3, 4]], scores=np.float32([0.3]), classes=["dog"]))
    write_regions(tmp_path / "r.jsonl", seen)
    again = read_regions(tmp_path / "r.jsonl")
    assert all(again[frame.index].equals(regions) for frame, regions in seen)


def test_what_the_detector_noticed_reads_back_and_a_stride_loses_nothing_of_it(tmp_path: Path):
    told = Event("light", 1, 2, why="x 0.5")
    empty = Regions.empty()
    seen = [
        (Frame(k, k / 10), replace(empty, events=(told,) if k == 2 else (), blind=k in (1, 2))) for k in range(5)
    ]
    write_regions(tmp_path / "r.jsonl", seen)
    again = read_regions(tmp_path / "r.jsonl")
    assert all(again[frame.index].equals(regions) for frame, regions in seen)
    detector, events = Recorded(regions=again), []
    state = detector.start(Scene(64, 48))
    for k in (0, 3):
        state, regions = detector.step(state, Frame(k, k / 10))
        events += regions.events
    assert events == [told]


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


def mask(size: str = "[2,2]", runs: str = "[0,4]", x: str = "0") -> str:
    return f'{{"frame":1,"boxes":[[0,0,2,2]],"masks":[{{"x":{x},"y":0,"size":{size},"runs":{runs}}}]}}'  # one silhouette


def event(kind: str = '"light"', begin: object = 3, end: object = 3) -> str:
    return f'{{"frame":3,"boxes":[],"events":[{{"kind":{kind},"begin":{begin},"end":{end},"why":""}}]}}'


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"frame":1}', "boxes"),
        ('{"boxes":[]}', "frame"),
        ('{"frame":1,"boxes":[[1,2]]}', "four numbers"),
        ('{"frame":1,"boxes":[["1","2","3","4"]]}', "four numbers"),
        ('{"frame":1,"boxes":[[0,0,true,1]]}', "four numbers"),
        ('{"frame":1,"boxes":[5]}', "four numbers"),
        ('{"frame":1,"boxes":5}', "boxes"),
        ('{"frame":1,"boxes":[[0,0,NaN,1]]}', "NaN is not a number that JSON has"),
        ('{"frame":1,"boxes":[[0,0,1e300,1]]}', "1000000|1e\\+06"),
        (f'{{"frame":1,"boxes":[[0,0,1{"0" * 400},1]]}}', "1000000|1e\\+06"),
        ('{"frame":1,"boxes":[[2,0,1,1]]}', "x1 ≤ x2"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"scores":[1,1]}', "scores"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"scores":[1.5]}', r"\[0, 1\]"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"scores":[1e300]}', r"\[0, 1\]"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"scores":["1"]}', "scores"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"scores":0.5}', "scores"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"classes":[["a"]]}', "classes"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"classes":["a","b"]}', "classes"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"masks":[5]}', "mask"),
        ('{"frame":1,"boxes":[[0,0,1,1]],"masks":"x"}', "masks"),
        ('{"frame":true,"boxes":[]}', "frame = true is no whole number from 0 on"),
        ('{"frame":1.5,"boxes":[]}', "frame = 1.5 is no whole number"),
        ('{"frame":"1","boxes":[]}', "frame = '1' is no whole number"),
        ('{"frame":-1,"boxes":[]}', "frame = -1 is no whole number"),
        ("[" * 100_000, "not JSON"),
        (f'{{"frame":{"1" * 5000}}}', "not JSON"),
        ("\udcff", "not JSON"),
        (mask(size="[2]"), "mask"),
        (mask(size="[-2,-2]"), "32768"),
        (mask(size="[1e9,1]"), "32768"),
        (mask(size="[true,4]"), "32768"),
        (mask(size="[32768,32768]", runs="[0,1073741824]"), "268435456"),
        (mask(size="[4000000000,4000000000]"), "32768"),
        (mask(runs="[0,5]"), "do not fill"),
        (mask(runs="[-1,5]"), "runs"),
        (
            mask(runs="[4611686018427387904,4611686018427387904,4611686018427387904,4611686018427387908]"),
            "do not fill",
        ),
        (mask(runs=f"[0,1{'0' * 400}]"), "do not fill"),
        (mask(runs='["4"]'), "runs"),
        (mask(runs="[4.0]"), "runs"),
        (mask(runs="4"), "runs"),
        (mask(x="1e300"), "mask"),
        (mask(x="null"), "mask"),
        ('{"frame":3,"boxes":[],"blind":3}', "blind"),
        ('{"frame":3,"boxes":[],"events":{}}', "events"),
        ('{"frame":3,"boxes":[],"events":[{"kind":"light"}]}', "events"),
        (event(begin=-1), "begin and end"),
        (event(begin=3, end=2), "in this order"),
        (event(begin=3, end=9), "frame 9"),
        (event(begin="true"), "begin and end"),
        (event(kind='""'), "kind"),
        (event(kind="1"), "texts"),
    ],
)
def test_a_line_that_holds_no_regions_is_named(tmp_path: Path, line: str, said: str):
    path = tmp_path / "r.jsonl"
    write_regions(path, [])
    path.write_text(path.read_text() + line + "\n", errors="surrogateescape")
    with pytest.raises(FormatError, match=f"line 2: .*({said})") as refused:
        read_regions(path)
    assert "\n" not in str(refused.value)
    assert "Error(" not in str(refused.value)
    assert len(str(refused.value)) < 300


def test_a_frame_given_twice_is_refused_with_both_lines(tmp_path: Path):
    seen = [(Frame(index, index / 10), Regions.empty()) for index in (3, 4, 3)]
    write_regions(tmp_path / "r.jsonl", seen)
    with pytest.raises(FormatError, match="line 4: frame 3 was given already, in line 2"):
        read_regions(tmp_path / "r.jsonl")


def test_capitals_in_an_ending_do_not_matter(tmp_path: Path):
    seen = [(Frame(3, 0.3), Regions.of([[0, 0, 10, 20]], scores=[0.5], classes=["dog"]))]
    write_regions(tmp_path / "R.JSONL", seen)
    assert read_regions(tmp_path / "R.JSONL")[3].classes.tolist() == ["dog"]
    write_regions(tmp_path / "R.TXT", seen)
    assert read_regions(tmp_path / "R.TXT")[3].scores.tolist() == [0.5]


def test_regions_that_change_on_disk_are_refused_when_they_are_wanted(tmp_path: Path):
    path = tmp_path / "r.jsonl"
    write_regions(path, [(Frame(3, 0.3), Regions.of([[0, 0, 10, 20]]))])
    again = read_regions(path)
    path.write_text(path.read_text().replace("boxes", "bixes"))
    with pytest.raises(FormatError, match=r"line 2: .*boxes"):
        again[3]
    path.unlink()
    with pytest.raises(FormatError, match="cannot read"):
        again[3]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("/dev/zero", "no regular file"),
        ("/tmp", "no regular file"),
        ("a\0b", "no regular file"),
        ("x" * 300, "too long"),
    ],
)
def test_a_place_that_holds_no_regions_is_refused(name: str, said: str):
    with pytest.raises(FormatError, match=said) as refused:
        read_regions(Path(name))
    assert len(str(refused.value)) < 150


def test_a_file_of_another_version_is_refused_in_one_short_line(tmp_path: Path):
    for version in ('"a\\nb"', "[" * 50 + "]" * 50, "{}", "2"):
        (tmp_path / "r.jsonl").write_text(f'{{"format":"perdure-regions","version":{version}}}\n')
        with pytest.raises(FormatError, match="this Perdure reads version 1") as refused:
            read_regions(tmp_path / "r.jsonl")
        assert "\n" not in str(refused.value)
