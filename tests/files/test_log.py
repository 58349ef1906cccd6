"""The run log: what is written reads back, whatever byte it is cut off at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from perdure.errors import FormatError
from perdure.files.log import RunLog, read_log
from perdure.types import Dropped, Event, Explanation, Ground, Mask, Outline, Renamed, Report, Status, Tracks

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
