"""The run log: what is written reads back, whatever byte it is cut off at."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from perdure.errors import FormatError
from perdure.files.log import RunLog, read_log
from perdure.types import Dropped, Event, Explanation, Ground, Mask, Outline, Renamed, Report, Status, Tracks
from perdure.web.ledger import Ledger

FULL = Report(
    rows=Tracks.of(
        frames=[3, 2],
        times=[0.3, 0.2],
        ids=[4, 5],
        boxes=np.float32([[0.1, -2, 9, 9.7], [1, 2, 3, 4]]),
        status=[Status.AMBIGUOUS, Status.LOST],
        confidence=np.float32([0.9, 0.123456]),
        classes=["person", ""],
        groups=[5, 0],
        inferred=[False, True],
        masks=[Mask(1, 2, np.eye(4, dtype=bool)), Mask.empty()],
        believed=[Mask(0, 0, np.ones((2, 2), bool)), None],
        outlines=[Outline.of([[[-0.5, 1], [9.25, 1.5], [4, 7]], [[3, 2], [3, 3], [4, 2.5]]]), None],
        hidden_side=["left+top", ""],
        ground=[Ground(1.5, 2.5, 0.25), None],
        links=[(0, 2), ()],
    ),
    renamed=(Renamed(9, 4, 0, 2),),
    dropped=(Dropped(8, 1, 2),),
    events=(Event("merge", 2, 3, (4, 5), "door", 0.5, "rule b: 2.1 px"),),
    explanations=(Explanation(4, "nearest", {"distance": 0.25}),),
)


def written(path: Path, *reports: Report) -> Path:
    with RunLog(path) as log:
        for k, report in enumerate(reports, 3):
            log.append(k, k / 10, report)
    return path


def test_every_column_correction_event_and_reason_reads_back(tmp_path: Path):
    (entry,) = read_log(written(tmp_path / "log", FULL))
    assert (entry.frame, entry.time) == (3, 0.3)
    assert entry.report.equals(FULL)


def test_a_log_cut_off_at_any_byte_is_a_valid_log(tmp_path: Path):
    whole = written(tmp_path / "log", FULL, Report(), FULL).read_bytes()
    ends = [i + 1 for i, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(len(whole) + 1):
        (tmp_path / "cut").write_bytes(whole[:cut])
        complete = sum(end <= cut for end in ends)
        assert len(list(read_log(tmp_path / "cut"))) == max(0, complete - 1), f"cut at byte {cut}"


def test_a_damaged_line_in_the_middle_is_named(tmp_path: Path):
    lines = written(tmp_path / "log", FULL, FULL).read_text().splitlines(keepends=True)
    (tmp_path / "bad").write_text(lines[0] + "{nonsense}\n" + lines[1])
    with pytest.raises(FormatError, match="line 2"):
        list(read_log(tmp_path / "bad"))


SAID = {"id": 1, "box": [0, 0, 9, 9], "status": "visible", "confidence": 1}
EVENT = {"kind": "merge", "begin": 0, "end": 0, "ids": [1], "zone": "", "confidence": 1, "why": ""}
IMPOSSIBLE = [
    {"frame": "0"},
    {"frame": 0.5},
    {"frame": True},
    {"frame": -2},
    {"frame": 0},
    {"frame": 2, "time": -1e400},
    {"time": "1"},
    {"time": 1e400},
    {"rows": [SAID | {"id": 0}]},
    {"rows": [SAID | {"id": "1"}]},
    {"rows": [SAID | {"id": 1.5}]},
    {"rows": [SAID | {"id": 2**63}]},
    {"rows": [SAID | {"frame": -1}]},
    {"rows": [SAID | {"box": [0, 0, 9]}]},
    {"rows": [SAID | {"box": [9, 0, 0, 9]}]},
    {"rows": [SAID | {"box": [0, 0, "9", 9]}]},
    {"rows": [SAID | {"box": [0, 0, 1e300, 9]}]},
    {"rows": [SAID | {"status": "seen"}]},
    {"rows": [SAID | {"confidence": None}]},
    {"rows": [SAID | {"class": 7}]},
    {"rows": [SAID | {"group": -7}]},
    {"rows": [SAID | {"inferred": "no"}]},
    {"rows": [SAID | {"links": "12"}]},
    {"rows": [SAID | {"ground": [1]}]},
    {"renamed": [[1, "2", 0, 0]]},
    {"renamed": [[1, 2**70, 0, 0]]},
    {"dropped": [[1, 0]]},
    {"events": [EVENT | {"ids": "12"}]},
    {"events": [EVENT | {"confidence": "sure"}]},
    {"events": [EVENT | {"begin": 2, "end": 1}]},
    {"begun": [EVENT | {"begin": None}]},
    {"explanations": [{"id": 1, "why": 2, "figures": {}}]},
    {"explanations": [{"id": 1, "why": "near", "figures": {"distance": "2"}}]},
]


@pytest.mark.parametrize("wrong", IMPOSSIBLE, ids=str)
def test_a_report_of_which_anything_cannot_be_is_named_and_the_viewer_says_so_too(tmp_path: Path, wrong: dict):
    path = written(tmp_path / "log")
    good = {"frame": 1, "time": 0, "rows": [SAID]}
    wrong = {"frame": 2} | wrong
    path.write_text(path.read_text() + json.dumps(good) + "\n" + json.dumps(good | wrong) + "\n")
    with pytest.raises(FormatError, match="line 3: not") as told:
        list(read_log(path))
    assert "\n" not in str(told.value)
    ledger = Ledger(path)
    ledger.refresh()
    assert "line 3: not" in ledger.damage
    assert len(ledger.columns().ids) == 1


def test_numbers_that_json_has_not_are_refused_in_a_log(tmp_path: Path):
    path = written(tmp_path / "log")
    path.write_text(path.read_text() + '{"frame":0,"time":NaN,"rows":[]}\n')
    with pytest.raises(FormatError, match=r"line 2: not JSON .NaN is not a number that JSON has"):
        list(read_log(path))


def test_a_row_of_this_frame_and_another_time_keeps_it(tmp_path: Path):
    rows = Tracks.of(frames=[3], times=[0.25], ids=[1], boxes=[[0, 0, 9, 9]])
    (entry,) = read_log(written(tmp_path / "log", Report(rows)))
    assert entry.report.rows.times.tolist() == [0.25]


def test_a_few_bytes_cannot_unfold_into_all_of_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("perdure.files.room._LEAST", 1000)
    monkeypatch.setattr("perdure.files.room._EACH", 1)
    path = written(tmp_path / "log")
    mask = {"x": 0, "y": 0, "size": [30, 30], "runs": [900]}
    line = {"frame": 0, "time": 0, "rows": [SAID | {"mask": mask, "believed": mask} for _ in range(2)]}
    path.write_text(path.read_text() + json.dumps(line) + "\n")
    with pytest.raises(FormatError, match=r"line 2: .*unfold into more pixels"):
        list(read_log(path))


@pytest.mark.parametrize(
    "line", ["[]", "{}", '{"frame":0,"time":0,"rows":[{"id":1}]}', '{"frame":0,"time":0,"rows":7}']
)
def test_a_line_that_is_no_report_is_named(tmp_path: Path, line: str):
    path = written(tmp_path / "log")
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(FormatError, match="line 2"):
        list(read_log(path))


def test_another_kind_of_file_is_refused(tmp_path: Path):
    (tmp_path / "other").write_text('{"format": "something"}\n')
    with pytest.raises(FormatError, match="not a perdure-log"):
        list(read_log(tmp_path / "other"))
