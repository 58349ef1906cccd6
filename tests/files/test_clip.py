"""What is told of a composed clip: events from 1 there, from 0 here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from perdure.errors import FormatError
from perdure.files.clip import read_blobs, read_clip
from perdure.types import Event


def clip(folder: Path, *events: dict) -> Path:
    (folder / "clip.json").write_text(json.dumps({"events": events}))
    return folder / "clip.json"


def test_moments_and_stretches_of_objects_are_read_and_others_left_out(tmp_path: Path):
    path = clip(
        tmp_path,
        {"type": "merge", "frame": 89, "ids": [1, 2]},
        {"type": "full_occlusion", "begin": 110, "end": 126, "ids": [1]},
        {"type": "light", "begin": 3, "end": 4},
    )
    assert read_clip(path)[0] == (Event("merge", 88, 88, (1, 2)), Event("full_occlusion", 109, 125, (1,)))


def test_the_size_of_the_pictures_is_told_where_the_clip_says_it(tmp_path: Path):
    (tmp_path / "clip.json").write_text('{"events": [], "height": 480, "width": 640}')
    assert read_clip(tmp_path / "clip.json") == ((), (480, 640))
    (tmp_path / "clip.json").write_text('{"events": [], "height": "480"}')
    assert read_clip(tmp_path / "clip.json") == ((), None)


def test_a_merge_of_fewer_than_two_is_none(tmp_path: Path):
    events = [{"type": "merge", "frame": 9, "ids": ids} for ids in ([], [1], [1, 1], [1, 2])]
    assert [one.ids for one in read_clip(clip(tmp_path, *events))[0]] == [(1, 2)]


@pytest.mark.parametrize(
    "event",
    [{"type": "merge"}, {"type": "merge", "frame": "9", "ids": [1]}, {"type": "split", "frame": 9, "ids": 1}, 7],
)
def test_a_malformed_event_is_named(tmp_path: Path, event: object):
    good = {"type": "merge", "frame": 89, "ids": [1, 2]}
    with pytest.raises(FormatError, match=r"clip\.json, event 2: wanted are"):
        read_clip(clip(tmp_path, good, event))


@pytest.mark.parametrize("text", ["", "[1]", '{"events": 3}', "{"])
def test_what_is_no_clip_is_refused(tmp_path: Path, text: str):
    (tmp_path / "clip.json").write_text(text)
    with pytest.raises(FormatError, match=r"clip\.json"):
        read_clip(tmp_path / "clip.json")


def test_blobs_are_sets_of_ids_by_frame(tmp_path: Path):
    (tmp_path / "blobs.txt").write_text("1 \n2 1+3 2\n3 1 1 2\n")
    assert read_blobs(tmp_path / "blobs.txt") == {
        0: (),
        1: (frozenset({1, 3}), frozenset({2})),
        2: (frozenset({1}), frozenset({1}), frozenset({2})),
    }


def test_a_malformed_blob_is_named_with_its_line(tmp_path: Path):
    (tmp_path / "blobs.txt").write_text("1 2\n2 1+x\n")
    with pytest.raises(FormatError, match=r"line 2: '2 1\+x'"):
        read_blobs(tmp_path / "blobs.txt")


@pytest.mark.parametrize(
    "event",
    [
        {"type": "occluded", "begin": 3, "end": 2, "ids": [1]},
        {"type": "occluded", "begin": 0, "end": 2, "ids": [1]},
        {"type": "enter", "frame": True, "ids": [1]},
        {"type": "enter", "frame": 3, "ids": ["1"]},
        {"type": "enter", "frame": 3, "ids": [1.9]},
        {"type": "enter", "frame": 3, "ids": [-1]},
    ],
    ids=str,
)
def test_an_event_that_cannot_be_is_named(tmp_path: Path, event: dict):
    (tmp_path / "clip.json").write_text(json.dumps({"events": [event]}))
    with pytest.raises(FormatError, match="event 1: wanted are"):
        read_clip(tmp_path / "clip.json")


@pytest.mark.parametrize("line", ["0 1+2", "-3 1", "1_0 1", "3 0", "3 1+-2", "3 ٣", "99999999999 1"])
def test_blobs_of_no_frame_or_nobody_are_named(tmp_path: Path, line: str):
    (tmp_path / "blobs.txt").write_text(f"1 1+2\n{line}\n", encoding="utf-8")
    with pytest.raises(FormatError, match="line 2"):
        read_blobs(tmp_path / "blobs.txt")
