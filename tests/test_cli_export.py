"""`perdure export` of silhouettes, as a user types it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from worlds import two_apart

from perdure.cli.main import run as run_command
from perdure.files import mask_pngs, mots
from perdure.files.log import RunLog, read_log
from perdure.files.runs import RunFolder
from perdure.fold import settle
from perdure.types import Mask, Renamed, Report, Rows, Status, Tracks

HEIGHT, WIDTH = 30, 40


class Done(NamedTuple):
    code: int
    stdout: str
    stderr: str


@pytest.fixture
def export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Run `perdure export` with some words, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run_it(*words: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["perdure", "export", *words])
        return Done(run_command(), *capsys.readouterr())

    return run_it


def disc(x: int, radius: int) -> Mask:
    return Mask.of_image(cv2.circle(np.zeros((HEIGHT, WIDTH), np.uint8), (x, 15), radius, 1, -1) > 0)


def write_run(folder: Path, reports: dict[int, Report], **about: object) -> Path:
    folder.mkdir()
    RunFolder(folder).write_about({"height": HEIGHT, "width": WIDTH, **about})
    with RunLog(folder / "tracks.jsonl") as log:
        for frame, report in reports.items():
            log.append(frame, 0.0, report)
    return folder


def report(frame: int, *ids_and_masks: tuple[int, Mask], **more: object) -> Report:
    ids, masks = zip(*ids_and_masks, strict=True)
    boxes = [mask.box for mask in masks]
    return Report(Tracks.of(frames=frame, times=0.0, ids=ids, boxes=boxes, masks=masks), **more)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Every second frame from 6 to 14; nothing in 8; id 300 turns out to be 1; a lost and an unseen target."""
    lost = Tracks.of(
        frames=10, times=0.0, ids=[9], boxes=[[0, 0, 5, 5]], masks=[disc(30, 2)], status=[Status.LOST]
    )
    reports = {
        6: report(6, (1, disc(5, 4)), (2, disc(20, 6))),
        8: Report(),
        10: Report(Tracks.join([report(10, (300, disc(8, 4)), (2, Mask.empty())).rows, lost])),
        12: report(12, (1, disc(9, 5)), renamed=(Renamed(300, 1, 0, 12),)),
        14: Report(),
        -1: Report(),
    }
    return write_run(tmp_path / "run", reports)


def told(rows: Rows) -> list[tuple[int, int, tuple[int, int, int, int]]]:
    return [(int(f), int(i), mask.box) for f, i, mask in zip(rows.frames, rows.ids, rows.masks, strict=True)]


WANTED = [(6, 1, disc(5, 4).box), (6, 2, disc(20, 6).box), (10, 1, disc(8, 4).box), (12, 1, disc(9, 5).box)]


def test_mots_holds_the_settled_silhouettes_of_the_rows_that_count(
    export: Callable[..., Done], run: Path, tmp_path: Path
):
    done = export("run", "--format", "mots", "-o", "out.txt", "--json")
    assert json.loads(done.stdout) == {"output": "out.txt", "rows": 4}
    assert done.stderr == "perdure: note: rows left out, without a silhouette: 1\n"
    rows = mots.read_masks(tmp_path / "out.txt")
    assert (told(rows), rows.size) == (WANTED, (HEIGHT, WIDTH))
    assert rows.masks[1] == disc(20, 6)


def test_mask_png_holds_a_picture_for_every_frame_of_the_run(
    export: Callable[..., Done], run: Path, tmp_path: Path
):
    done = export("run", "--format", "mask-png", "-o", "out", "--json")
    assert json.loads(done.stdout) == {"output": "out", "rows": 4, "frames": 5}
    names = ["000006.png", "000008.png", "000010.png", "000012.png", "000014.png"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    rows = mask_pngs.read_masks(tmp_path / "out", void=True)
    assert (told(rows), rows.size) == (WANTED, (HEIGHT, WIDTH))
    assert cv2.imread(str(tmp_path / "out/000006.png"), cv2.IMREAD_UNCHANGED).dtype == np.uint8


def test_large_ids_take_16_bits_and_larger_ones_are_refused(export: Callable[..., Done], tmp_path: Path):
    write_run(tmp_path / "wide", {0: report(0, (255, disc(5, 4)))})
    write_run(tmp_path / "wider", {0: report(0, (65_536, disc(5, 4)))})
    assert export("wide", "--format", "mask-png", "-o", "out").code == 0
    assert mask_pngs.read_masks(tmp_path / "out", void=True).ids.tolist() == [255]
    refused = export("wider", "--format", "mask-png", "-o", "other")
    assert (refused.code, "65536 is too large" in refused.stderr) == (2, True)
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("form", ["mots", "mask-png"])
def test_a_run_that_does_not_tell_its_size_is_named(export: Callable[..., Done], tmp_path: Path, form: str):
    for number, size in enumerate((None, -3, "wide", 3.5, 10**9)):
        write_run(tmp_path / f"run{number}", {0: report(0, (1, disc(5, 4)))}, width=size)
        refused = export(f"run{number}", "--format", form, "-o", "out")
        assert (refused.code, "run.json does not tell the size" in refused.stderr) == (2, True)
        assert not (tmp_path / "out").exists()


def test_pictures_are_replaced_only_if_that_is_asked(export: Callable[..., Done], run: Path, tmp_path: Path):
    export("run", "--format", "mask-png", "-o", "out")
    refused = export("run", "--format", "mask-png", "-o", "out")
    assert (refused.code, "--overwrite" in refused.stderr) == (2, True)
    assert export("run", "--format", "mask-png", "-o", "out", "--overwrite").code == 0


@pytest.mark.parametrize("form", ["csv", "mots", "mask-png"])
@pytest.mark.parametrize("place", ["run", "run/tracks.jsonl", "run/run.json"])
def test_what_the_run_rests_on_is_never_replaced(
    export: Callable[..., Done], run: Path, tmp_path: Path, form: str, place: str
):
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    assert export("run", "--format", form, "-o", place, "--overwrite").code == 2
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_a_damaged_log_leaves_nothing_behind(export: Callable[..., Done], run: Path, tmp_path: Path):
    log = run / "tracks.jsonl"
    log.write_text(log.read_text().replace('"runs":[', '"runs":[1,', 3))
    for form in ("mots", "mask-png"):
        refused = export("run", "--format", form, "-o", "out")
        assert (refused.code, "line" in refused.stderr) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_silhouettes_that_track_and_cut_found_come_back_from_both_formats(
    export: Callable[..., Done], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    frames = two_apart().frames()[10:20]
    (tmp_path / "film").mkdir()
    for frame in frames:
        cv2.imwrite(f"film/{frame.index:03d}.png", frame.image[:, :, ::-1])
    reds = (frames[0].image == (200, 40, 40)).all(axis=2)
    blues = (frames[0].image == (40, 60, 220)).all(axis=2)
    cv2.imwrite("both.png", np.uint8(reds * 3 + blues * 1))
    monkeypatch.setattr(
        sys, "argv", ["perdure", "track", "film", "-o", "run", "--init", "both.png", "--no-video", "--fps", "10"]
    )
    assert run_command() == 0
    said = settle(entry.report for entry in read_log(Path("run/tracks.jsonl"))).counted()
    assert sorted(set(said.ids.tolist())) == [1, 3]
    assert len(said) == 20
    assert export("run", "--format", "mots", "-o", "out.txt").code == 0
    assert export("run", "--format", "mask-png", "-o", "out").code == 0
    wanted = sorted(told(Rows.of(frames=said.frames, ids=said.ids, masks=said.masks)))
    size = frames[0].image.shape[:2]
    for rows in (mots.read_masks(Path("out.txt")), mask_pngs.read_masks(Path("out"), void=True)):
        assert rows.size == size
        assert sorted(told(rows)) == wanted
        there = {
            (int(frame), int(name)): mask
            for frame, name, mask in zip(rows.frames, rows.ids, rows.masks, strict=True)
        }
        for frame, name, mask in zip(said.frames, said.ids, said.masks, strict=True):
            assert np.array_equal(there[int(frame), int(name)].to_image(*size), mask.to_image(*size))
    first = {
        name: mask.to_image(*size)
        for frame, name, mask in zip(said.frames, said.ids, said.masks, strict=True)
        if frame == 0
    }
    assert np.array_equal(first[3], reds)
    assert np.array_equal(first[1], blues)
