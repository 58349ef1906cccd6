"""Corrections by hand: what each does to a run, and what becomes of the file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from perdure.cli.commands import app
from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files.corrections import (
    Correction,
    History,
    append_correction,
    correction_of_json,
    newest_id,
    read_corrections,
)
from perdure.files.log import RunLog
from perdure.files.runs import Reporting, RunFolder
from perdure.types import Event, Report, Tracks

FILM = 6  # frames


def run_of(place: Path, *walkers: int) -> RunFolder:
    """A run in which each id stands at ten times its number, with a meeting of all in frame 3."""
    folder = RunFolder.create(place, overwrite=False)
    folder.write_about({"width": 200, "height": 100, "source": "nowhere"})
    with RunLog(folder.log) as log:
        for k in range(FILM):
            boxes = [[10 * one, 0, 10 * one + 8, 20] for one in walkers]
            rows = Tracks.of(frames=k, times=k / 10, ids=list(walkers), boxes=boxes)
            events = (Event("merge", k, k, walkers),) if k == 3 else ()
            log.append(k, k / 10, Report(rows, events=events))
    return folder


def where(folder: RunFolder) -> dict[int, str]:
    """For each id, frame by frame, at whose place it stands: '1 1 1 2 2 2', '-' for nobody's."""
    tracks = folder.tracks()
    found = {}
    for identity in sorted(set(tracks.ids.tolist())):
        own = tracks.of_id(identity)
        place = dict(zip(own.frames.tolist(), (own.boxes[:, 0] / 10).astype(int).tolist(), strict=True))
        found[identity] = "".join(str(place.get(k, "-")) for k in range(FILM))
    return found


def correct(folder: RunFolder, *lines: Correction | str) -> None:
    for line in lines:
        append_correction(folder.corrections, line)


def test_a_swap_exchanges_two_from_a_moment_on(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("swap", (1, 2), begin=3))
    assert where(folder) == {1: "111222", 2: "222111"}


def test_a_swap_ends_where_it_is_told_to(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("swap", (1, 2), begin=2, end=3))
    assert where(folder) == {1: "112211", 2: "221122"}


def test_a_cut_gives_the_rest_a_new_id_and_a_join_takes_it_back(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1)
    correct(folder, Correction("cut", (1, 2), begin=4))
    assert where(folder) == {1: "1111--", 2: "----11"}
    correct(folder, Correction("join", (2, 1), begin=0))
    assert where(folder) == {1: "111111"}


def test_who_is_deleted_is_in_no_event_either(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("delete", (2,), begin=1))
    assert where(folder) == {1: "111111", 2: "2-----"}
    assert folder.read()[1] == (), "what two did, of whom one is none, has not happened"


def test_of_two_joined_who_are_there_at_once_one_row_stays(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("join", (2, 1), begin=0))
    assert len(folder.tracks()) == FILM


def test_an_action_speaks_of_ids_as_those_before_it_left_them(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("swap", (1, 2), begin=3), Correction("delete", (2,), begin=3))
    assert where(folder) == {1: "111222", 2: "222---"}


def test_what_is_undone_is_as_if_it_had_not_been_and_can_be_done_again(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    before = where(folder)
    correct(folder, Correction("swap", (1, 2), begin=0), Correction("delete", (2,), begin=0), "undo", "undo")
    assert where(folder) == before
    correct(folder, "redo")
    assert where(folder) == {1: "222222", 2: "111111"}
    assert read_corrections(folder.corrections).undone == (Correction("delete", (2,), begin=0),)


def test_a_new_action_forgets_what_was_undone():
    history = History().after(Correction("delete", (1,), 0)).after("undo").after(Correction("delete", (2,), 0))
    assert history.undone == ()
    with pytest.raises(ParameterError, match="nothing to redo"):
        history.after("redo")


def test_a_confirmed_event_changes_nothing(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    before = where(folder)
    correct(folder, Correction("confirm", (1, 2), begin=3, event=(3, 0)))
    assert where(folder) == before


def test_the_log_stays_as_it_was_and_the_file_only_grows(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    log, written = folder.log.read_bytes(), b""
    for line in (Correction("swap", (1, 2), 2), "undo", "redo"):
        correct(folder, line)
        now = folder.corrections.read_bytes()
        assert now.startswith(written)
        written = now
    assert folder.log.read_bytes() == log


def test_a_line_cut_off_never_counted_and_the_next_one_does(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("delete", (1,), 0), Correction("delete", (2,), 0))
    written = folder.corrections.read_bytes()
    folder.corrections.write_bytes(written[:-9])
    assert list(where(folder)) == [2]
    correct(folder, Correction("delete", (2,), 3))
    assert where(folder) == {2: "222---"}


def test_a_file_cut_off_at_any_byte_is_a_valid_one(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("swap", (1, 2), 2), "undo", Correction("cut", (1, 3), 4))
    written = folder.corrections.read_bytes()
    for size in range(len(written)):
        folder.corrections.write_bytes(written[:size])
        assert len(read_corrections(folder.corrections).in_force) <= 1


def test_a_damaged_line_is_named(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1)
    correct(folder, Correction("delete", (1,), 0))
    with folder.corrections.open("a") as file:
        file.write('{"do":"swop","ids":[1,2],"begin":0}\n')
    with pytest.raises(FormatError, match=r"corrections.jsonl, line 3: .*'swop'.*swap"):
        folder.tracks()


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ({"do": "swap", "ids": [1], "begin": 0}, "2 ids, not 1"),
        ({"do": "swap", "ids": [4, 4], "begin": 0}, "two different"),
        ({"do": "delete", "ids": [0], "begin": 0}, "from 1 on"),
        ({"do": "delete", "ids": [True], "begin": 0}, "from 1 on"),
        ({"do": "delete", "ids": [1], "begin": -1}, "from 0"),
        ({"do": "delete", "ids": [1], "begin": 9, "end": 3}, "before it begins"),
        ({"do": "delete", "ids": [1], "begins": 9}, "begin"),
        ({"do": "delete", "ids": [1], "begin": 0, "event": [1]}, "event"),
        ([], "JSON object"),
    ],
)
def test_an_action_that_cannot_be_is_refused_with_what_would_do(line: object, wrong: str):
    with pytest.raises(ParameterError, match=wrong):
        correction_of_json(line)


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path):
    with pytest.raises(OutputError, match="cannot write"):
        append_correction(tmp_path / "gone/corrections.jsonl", Correction("delete", (1,), 0))


def test_a_new_id_is_nobody_elses():
    history = History((Correction("cut", (3, 9), 5),), (Correction("cut", (3, 12), 5),))
    assert newest_id([1, 3, 7], history) == 13


def test_tracks_txt_exports_and_explain_heed_corrections(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    correct(folder, Correction("delete", (2,), 0))
    folder.write_results(Reporting())
    assert {line.split(",")[1] for line in (folder.path / "tracks.txt").read_text().splitlines()} == {"1"}
    out = tmp_path / "rows.csv"
    assert CliRunner().invoke(app, ["export", str(folder.path), "--format", "csv", "-o", str(out)]).exit_code == 0
    assert len(out.read_text().splitlines()) == 1 + FILM
    asked = CliRunner().invoke(app, ["explain", str(folder.path), "--id", "2"])
    assert "its rows were taken back" in str(asked.exception)


def test_a_score_heeds_corrections(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1, 2)
    truth = tmp_path / "gt.txt"
    truth.write_text("".join(f"{k + 1},1,11,1,8,20,1,-1,-1,-1\n" for k in range(FILM)))

    def precision() -> float:
        done = CliRunner().invoke(app, ["score", str(folder.path), "--truth", str(truth), "--json"])
        return json.loads(done.stdout.splitlines()[-1])["sequences"][0]["boxes"]["IDP"]

    before = precision()
    correct(folder, Correction("delete", (2,), 0))
    assert (before, precision()) == (pytest.approx(0.5), pytest.approx(1.0))


def test_a_run_that_is_replaced_takes_its_corrections_with_it(tmp_path: Path):
    folder = run_of(tmp_path / "run", 1)
    correct(folder, Correction("delete", (1,), 0))
    RunFolder.create(folder.path, overwrite=True)
    assert not folder.corrections.exists()
