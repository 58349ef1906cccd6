"""The log as columns says what `fold.settle` says, also while it grows, and as far as it is sound."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from perdure.files.log import RunLog
from perdure.fold import settle
from perdure.types import Dropped, Renamed, Report, Tracks
from perdure.web.ledger import Ledger
from perdure.web.settled import settle_columns

COLUMNS = ("frames", "ids", "groups", "boxes", "status", "confidence", "inferred")


def tangled(seed: int, frames: int = 25) -> list[Report]:
    """Reports with rows said late, twice, in groups, renamed in chains and circles, and dropped."""
    rng = np.random.default_rng(seed)
    reports = []
    for k in range(frames):
        count = int(rng.integers(0, 6))
        when = np.where(rng.random(count) < 0.25, rng.integers(0, k + 1, count), k)
        rows = Tracks.of(
            frames=when,
            times=when / 10,
            ids=rng.integers(1, 7, count),
            boxes=np.sort(rng.integers(0, 50, (count, 2, 2)), axis=1).reshape(count, 4),
            status=rng.integers(0, 5, count),
            confidence=rng.integers(0, 5, count) / 4,
            groups=np.where(rng.random(count) < 0.3, rng.integers(1, 9, count), 0),
            inferred=rng.random(count) < 0.4,
        )
        span = sorted(rng.integers(0, k + 1, 2).tolist())
        changes = rng.choice(np.arange(1, 9), (int(rng.integers(0, 3)), 2))
        renamed = tuple(Renamed(int(a), int(b), *span) for a, b in changes if a != b)
        dropped = (Dropped(int(rng.integers(1, 7)), *span),) if rng.random() < 0.15 else ()
        reports.append(Report(rows, renamed, dropped))
    return reports


def written(path: Path, reports: list[Report]) -> Ledger:
    with RunLog(path) as log:
        for k, report in enumerate(reports):
            log.append(k, k / 10, report)
    return Ledger(path)


def assert_same(ledger: Ledger, expected: Tracks) -> None:
    found = settle_columns(ledger.columns(), ledger.corrections).rows
    order = np.lexsort((expected.ids, expected.frames))
    assert len(found.ids) == len(expected)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name)[order], err_msg=name)


@pytest.mark.parametrize("seed", range(40))
def test_columns_settle_to_what_the_fold_settles_to(tmp_path: Path, seed: int):
    reports = tangled(seed)
    ledger = written(tmp_path / "tracks.jsonl", reports)
    ledger.refresh()
    assert_same(ledger, settle(reports))


def test_a_log_that_grows_is_read_on_and_a_half_line_waits(tmp_path: Path):
    reports = tangled(3)
    whole = written(tmp_path / "whole.jsonl", reports).path.read_bytes()
    path, ledger = tmp_path / "tracks.jsonl", Ledger(tmp_path / "tracks.jsonl")
    path.write_bytes(b"")
    for size in range(0, len(whole) + 1, 97):
        with path.open("ab") as file:
            file.write(whole[path.stat().st_size : size])
        ledger.refresh()
        assert len(ledger.offsets) == max(0, whole[:size].count(b"\n") - 1)
    with path.open("ab") as file:
        file.write(whole[path.stat().st_size :])
    ledger.refresh()
    assert_same(ledger, settle(reports))


def test_what_comes_before_a_damaged_line_is_kept_and_the_line_is_named(tmp_path: Path):
    reports = tangled(5)
    ledger = written(tmp_path / "tracks.jsonl", reports)
    lines = ledger.path.read_bytes().splitlines(keepends=True)
    lines[11] = lines[11][:20] + b"\n"
    ledger.path.write_bytes(b"".join(lines))
    ledger.refresh()
    assert "line 12" in ledger.damage
    assert_same(ledger, settle(reports[:10]))


@pytest.mark.parametrize(
    "line",
    [
        '{"frame":0,"time":0,"rows":[{"id":1,"box":[0,0,1],"status":"visible","confidence":1}]}',
        '{"frame":0,"time":0,"rows":[{"id":0,"box":[0,0,1,1],"status":"visible","confidence":1}]}',
        '{"frame":0,"time":0,"rows":[{"id":1,"box":[0,0,1,1],"status":"asleep","confidence":1}]}',
        '{"frame":0,"time":0,"rows":[{"id":1,"box":[0,0,1e999,1],"status":"visible","confidence":1}]}',
        '{"frame":0,"time":0,"rows":7}',
        '{"frame":-7,"time":0,"rows":[]}',
        '{"time":0,"rows":[]}',
        '{"frame":0,"time":0,"rows":[],"events":[{"kind":"merge"}]}',
        "[]",
        "nothing",
    ],
)
def test_a_line_that_is_no_report_is_named_and_nothing_of_it_is_taken_up(tmp_path: Path, line: str):
    path = tmp_path / "tracks.jsonl"
    path.write_text('{"format":"perdure-log","version":1}\n' + line + "\n")
    ledger = Ledger(path)
    ledger.refresh()
    assert "line 2" in ledger.damage
    assert len(ledger.columns().ids) == len(ledger.frames) == len(ledger.events) == 0


def test_a_log_that_was_replaced_is_read_anew(tmp_path: Path):
    ledger = written(tmp_path / "tracks.jsonl", tangled(1))
    ledger.refresh()
    ledger.path.unlink()
    written(ledger.path, tangled(2))
    ledger.refresh()
    assert_same(ledger, settle(tangled(2)))


def test_stretches_of_a_status_are_told_with_their_ends(tmp_path: Path):
    rows = [
        Tracks.of(frames=k, times=0.0, ids=[4], boxes=[[0, 0, 1, 1]], status=[status])
        for k, status in enumerate((0, 0, 2, 2, 0))
    ]
    ledger = written(tmp_path / "tracks.jsonl", [Report(one) for one in rows])
    ledger.refresh()
    spans = settle_columns(ledger.columns(), ()).spans()
    assert (spans["begin"], spans["end"], spans["status"]) == ([0, 2, 4], [1, 3, 4], [0, 2, 0])
