"""Searching parameters: the same seed finds the same, and noise is not sold as a gain."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from test_cli import perdure, write_film
from worlds import Block, World, walk

from perdure import fold, params
from perdure.consistency import Consistency, backwards, consistency
from perdure.errors import ParameterError
from perdure.files.mot import write_rows
from perdure.files.regions import read_regions, write_regions
from perdure.metrics import Score, score
from perdure.pipeline import plan
from perdure.trackers import TRACKERS
from perdure.tuning import Judged, Part, Span, figure, gain, search, span_of
from perdure.types import Tracks

pytest.importorskip("optuna", reason="pip install 'perdure[tune]'")

PATIENCE = Span("patience", 2.0, 0.5, 8.0, log=True)
WAY = Span("way", "once", choices=("once", "best"))


def near_five(several: Sequence[dict[str, object]]) -> list[float]:
    """Patience 5 is best, and the way 'best' is better by 1."""
    return [(one.get("way") == "best") - abs(float(one.get("patience", 2.0)) - 5.0) for one in several]


def test_the_search_finds_what_is_better_and_the_same_again():
    found, worth = search([PATIENCE, WAY], near_five, trials=30, seed=3)
    assert found["way"] == "best"
    assert abs(found["patience"] - 5.0) < 0.8
    assert worth == near_five([found])[0]
    assert search([PATIENCE, WAY], near_five, trials=30, seed=3) == (found, worth)


def test_the_defaults_win_where_nothing_is_better():
    assert search([PATIENCE], lambda several: [0.5] * len(several), trials=8, seed=0) == ({}, 0.5)


@pytest.mark.parametrize("tracker", TRACKERS)
def test_every_span_holds_the_default_and_keeps_within_the_declared_range(tracker: str):
    for declared in params.describe(TRACKERS[tracker]):
        span = span_of(declared)
        if span is None:
            continue
        assert span.default in span.choices or span.low <= span.default <= span.high
        for end in () if span.choices else (span.low, span.high):
            params.check_value(declared, declared.kind(end))


def test_a_span_outside_the_declared_range_is_refused():
    declared = next(one for one in params.describe(TRACKERS["compound"]) if one.name == "likeness")
    with pytest.raises(ParameterError, match=r"likeness=0\.5:2 is no range"):
        span_of(declared, (0.5, 2.0))


def segment(found: int, of: int = 10) -> Score:
    """The score of one object that was found in so many frames."""

    def rows(count: int) -> Tracks:
        boxes = np.tile([[0, 0, 9, 9]], (count, 1))
        return Tracks.of(frames=range(count), times=np.arange(count), ids=[1] * count, boxes=boxes)

    return score(rows(found), rows(of))


def judged(*found: int) -> Judged:
    parts = [segment(one) for one in found]
    return Judged(Part(Score.together(parts)), tuple(Part(one) for one in parts))


def test_a_gain_in_every_segment_is_claimed():
    told = gain(
        [judged(5, 6, 5, 6), judged(5, 5, 6, 6)], [judged(8, 8, 8, 9), judged(8, 9, 8, 8)], "IDF1", 0, draws=200
    )
    assert told.claimed
    assert told.low > 0.1
    assert told.better == told.pieces == 2


def test_a_gain_that_one_segment_makes_is_within_the_noise():
    told = gain(
        [judged(6, 6, 6, 2), judged(6, 6, 6, 6)], [judged(6, 5, 6, 10), judged(6, 7, 6, 6)], "IDF1", 0, draws=200
    )
    assert told.gain > 0
    assert not told.claimed


def test_without_truth_it_counts_for_as_much_what_a_run_explains():
    agreed = segment(10)
    assert figure([Part(agreed)], "IDF1") == 1.0
    assert figure([Part(agreed, explained=0.25)], "IDF1") == 0.5


def test_few_segments_carry_no_claim():
    assert not gain([judged(5), judged(5)], [judged(9), judged(9)], "IDF1", 0, draws=200).claimed


def meeting() -> World:
    """Two who meet and part, and one who is away for a while."""
    return World(
        (
            Block(walk((5, 30), (2, 0), begin=2)),
            Block(walk((105, 34), (-2, 0), begin=2), colour=(40, 60, 220)),
            Block(walk((10, 60), (1, 0), begin=5), colour=(40, 200, 60)),
        ),
        count=60,
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tuning")
    world = meeting()
    write_film(folder / "film.avi", [frame.image for frame in world.frames()])
    write_regions(folder / "film.jsonl", world.seen())
    with (folder / "film.txt").open("w") as file:
        write_rows(file, world.truth())
    return folder


def told_of(place: Path, **parameters: object) -> Consistency:
    made = plan(place / "film.avi", tracker="overlap", detector=str(place / "film.jsonl"), parameters=parameters)
    tracks = fold.settle(step.report for step in made.steps())
    return consistency(tracks, backwards(made, 0, 60), dict(read_regions(place / "film.jsonl")))


def test_a_run_backwards_has_the_frames_and_boxes_of_the_way_there(place: Path):
    made = plan(place / "film.avi", tracker="overlap", detector=str(place / "film.jsonl"))
    back = backwards(made, 0, 60)
    lone = meeting().truth()
    lone = lone.take(lone.ids == 3)
    own = back.take(np.isin(back.boxes[:, 1], lone.boxes[:, 1]) & (back.frames == 50))
    assert own.boxes.tolist() == lone.in_frame(50).boxes.tolist()
    assert (np.diff(back.frames) >= 0).all()
    assert set(back.frames.tolist()) <= set(range(60))


def test_a_tracker_that_says_nothing_explains_nothing(place: Path):
    sound, mute = told_of(place), told_of(place, confirm=60.0)
    assert mute.whole == 0.0 < sound.whole <= 1.0
    assert sound.explained > 0.8


def tune(place: Path, output: str, *words: object) -> dict[str, object]:
    done = perdure(
        "tune", "film.avi", "--detector", "film.jsonl", "--tracker", "overlap", "--trials", 3, "--workers", 1,
        "-o", output, "--json", *words, at=place,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_same_seed_writes_the_same_with_any_number_of_workers(place: Path):
    words = ("--truth", "film.txt", "--trials", 6)
    tune(place, "one.json", *words)
    tune(place, "two.json", *words, "--workers", 2)
    assert (place / "one.json").read_bytes() == (place / "two.json").read_bytes()


def test_a_film_is_tuned_on_its_halves_into_a_file_that_track_reads(place: Path):
    told = tune(place, "a.json", "--truth", "film.txt", "--tune", "patience", "--tune", "confirm=0:10")
    assert told["against"] == "truth"
    assert told["unseen"]["pieces"] == 2
    assert set(told["searched"]) == {"patience", "confirm"}
    assert told["claimed"] is False  # two halves of a few frames
    words = ("track", "film.avi", "--tracker", "overlap", "--detector", "film.jsonl", "--parameters", "a.json")
    assert perdure(*words, "--no-video", "-o", "run", at=place).returncode == 0


def test_without_truth_a_run_is_held_against_itself_and_nothing_is_said_of_truth(place: Path):
    told = tune(place, "self.json", "--tune", "patience")
    assert told["against"] == "itself backwards"
    assert "not truth" in told["verdict"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "x.txt"), "must end in .json"),
        (("-o", "x.json", "--metric", "IDF2"), "did you mean 'IDF1'"),
        (("-o", "x.json", "--tune", "patienc"), "did you mean 'patience'"),
        (("-o", "x.json", "--tune", "patience=3"), "NAME=LOW:HIGH"),
        (("-o", "x.json", "--tune", "threshold"), "without --truth only a tracker's"),
    ],
)
def test_a_mistake_is_told_before_anything_begins(place: Path, words: tuple[str, ...], said: str):
    done = perdure("tune", "film.avi", *words, at=place)
    assert done.returncode == 2
    assert said in done.stderr
