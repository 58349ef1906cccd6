"""`perdure track --roll`: a stream that may never end, every frame of it, into run folders by the clock."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from test_cli import perdure, write_film
from typer.testing import CliRunner
from worlds import crossing

from perdure import pipeline
from perdure.cli import rolled
from perdure.cli.commands import app
from perdure.errors import DamagedVideo
from perdure.files.clock import Clock
from perdure.files.passing import Shot, passing
from perdure.files.rolling import Rolling
from perdure.files.runs import RunFolder
from perdure.files.span import read_span

WORDS = ("track", "rtsp://yard", "--tracker", "overlap", "--roll", "1h", "--json")
FRAMES = crossing().count


@pytest.fixture(name="yard")
def a_stream_and_a_clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A stream of two who cross; an hour of the clock is 40 frames long."""

    def shots() -> Iterator[Shot]:
        for frame in crossing().frames():
            yield Shot(frame.image, frame.time)

    def opened(*_: object, **__: object) -> object:
        return passing("yard", "rtsp://yard", 10.0, read_span(None, None, 1), shots(), Clock(10.0, []), [])

    ticks = itertools.count()
    clock = lambda: datetime(2026, 5, 1, 12, tzinfo=UTC) + timedelta(hours=next(ticks) / 40)  # noqa: E731
    monkeypatch.setattr(pipeline, "open_source", opened)
    monkeypatch.setattr(rolled, "Rolling", functools.partial(Rolling, now=clock))
    return tmp_path / "yard"


def test_an_endless_stream_is_tracked_into_folders_of_which_each_can_be_read(yard: Path):
    done = CliRunner().invoke(app, [*WORDS, "-o", str(yard)])
    assert done.exit_code == 0, f"{done.exception} {done.stderr}"
    told = json.loads(done.stdout.splitlines()[-1])
    runs = [RunFolder.open(one) for one in sorted(yard.iterdir())]
    assert (told["status"], told["frames"], told["folders"]) == ("done", FRAMES, len(runs))
    assert len(runs) == 2
    assert sum(run.read()[2] for run in runs) == FRAMES
    ids = [set(run.tracks().counted().ids.tolist()) for run in runs]
    assert ids[0] & ids[1]  # who goes on keeps the id
    assert all((run.path / "tracks.txt").is_file() and run.read_about()["status"] == "done" for run in runs)
    words = ["export", str(runs[0].path), "--format", "csv", "-o", str(yard.parent / "rows.csv")]
    assert CliRunner().invoke(app, words).exit_code == 0


def test_what_was_tracked_before_a_stream_broke_off_is_kept_and_settled(
    yard: Path, monkeypatch: pytest.MonkeyPatch
):
    opened = pipeline.open_source

    def broken(*_: object) -> object:
        source = opened()
        frames = list(itertools.islice(source, 20))

        def until(self: object) -> Iterator[object]:
            yield from frames
            raise DamagedVideo("yard breaks off at frame 20", 20, 2.0)

        monkeypatch.setattr(type(source), "__iter__", until)
        return source

    monkeypatch.setattr(pipeline, "open_source", lambda *_, **__: broken())
    done = CliRunner().invoke(app, [*WORDS, "-o", str(yard)])
    assert done.exit_code == 3
    assert "yard breaks off at frame 20" in done.stderr
    (run,) = (RunFolder.open(one) for one in yard.iterdir())
    assert run.read()[2] == 20
    assert run.read_about()["status"] == "damaged"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--roll", "1h"], "--roll is for what passes once"),
        (["--roll", "banana"], "no length of time"),
        (["--roll", "1h", "--resume"], "leave out --resume"),
        (["--keep", "3"], "--keep goes with --roll"),
    ],
)
def test_a_file_has_one_folder_and_a_mistake_leaves_nothing(tmp_path: Path, words: list[str], said: str):
    write_film(tmp_path / "walk.avi", [frame.image for frame in crossing().frames()][:5])
    done = perdure("track", "walk.avi", "-o", "run", *words, at=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "run").exists()
