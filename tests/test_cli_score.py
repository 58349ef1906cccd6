"""`perdure score` and `perdure draw --truth`, as a user types them."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
import pytest
from worlds import two_apart

import perdure
from perdure.cli.commands import run as run_command
from perdure.cli.spreading import spread
from perdure.comparison import Window, read_window
from perdure.draw import Trails, paint
from perdure.draw.marks import Mark
from perdure.errors import ParameterError
from perdure.files.log import RunLog
from perdure.files.mot import write_rows
from perdure.files.runs import RunFolder
from perdure.types import Event, Frame, Mask, Report, Scene, Status, Tracks

WORLD = two_apart()


class Done(NamedTuple):
    code: int
    stdout: str
    stderr: str

    @property
    def value(self) -> dict:
        return json.loads(self.stdout.splitlines()[-1])

    def figures(self, family: str = "boxes", sequence: int = 0) -> dict:
        return self.value["sequences"][sequence][family]


@pytest.fixture
def perdure_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Run `perdure` with some words, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run_it(*words: object) -> Done:
        monkeypatch.setattr(sys, "argv", ["perdure", *map(str, words)])
        return Done(run_command(), *capsys.readouterr())

    return run_it


def write_text(path: Path, tracks: Tracks) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        write_rows(file, tracks)
    return path


def write_run(folder: Path, tracks: Tracks, *events: Event, height: int = 80, width: int = 120) -> Path:
    folder.mkdir(parents=True)
    RunFolder(folder).write_about(
        {"height": height, "width": width, "source": "x", "reporting": {"report_confidence": 0.5}}
    )
    with RunLog(folder / "tracks.jsonl") as log:
        for frame in np.unique(tracks.frames).tolist():
            told = tuple(one for one in events if one.begin == frame)
            log.append(frame, frame / 10, Report(tracks.in_frame(frame), events=told))
    return folder


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return write_text(tmp_path / "street/gt/gt.txt", WORLD.truth()).parents[1]


def late(tracks: Tracks, first: int = 10) -> Tracks:
    return tracks.take(tracks.frames >= first)


def test_a_run_is_scored_against_the_folder_of_its_truth(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    done = perdure_says("score", "run", "--truth", truth)
    assert (done.code, done.stderr) == (0, "")
    assert "boxes, %" in done.stdout
    assert "100.0" in done.stdout
    assert "never lost ones, never groups" in done.stdout
    assert "MOT15" in done.stdout


def test_as_json_it_is_one_object_on_the_last_line(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    done = perdure_says("score", "run", "--truth", truth, "--json")
    assert done.figures()["HOTA"] == pytest.approx(1.0)
    (sequence,) = done.value["sequences"]
    assert (sequence["name"], sequence["frames"], sequence["report_confidence"]) == ("street", [3, 40], 0.5)
    assert "together" not in done.value


def test_several_sequences_are_found_by_name_and_scored_each_and_together(tmp_path, perdure_says):
    whole, part = WORLD.truth(), late(WORLD.truth())
    for name in ("b", "a"):
        write_text(tmp_path / f"truth/{name}/gt/gt.txt", whole)
    write_text(tmp_path / "said/a.txt", whole)
    write_text(tmp_path / "said/b.txt", part)
    done = perdure_says("score", "said", "--truth", "truth", "--json")
    assert [one["name"] for one in done.value["sequences"]] == ["a", "b"]
    recalls = [done.figures(sequence=place)["FN"] for place in (0, 1)]
    assert recalls[0] == 0 < recalls[1]
    assert done.value["together"]["boxes"]["FN"] == sum(recalls)


def test_results_of_other_names_are_taken_in_order(tmp_path, truth, perdure_says):
    write_text(tmp_path / "one.txt", WORLD.truth())
    write_text(tmp_path / "two.txt", late(WORLD.truth()))
    other = write_text(tmp_path / "park/gt/gt.txt", WORLD.truth())
    done = perdure_says("score", "one.txt", "two.txt", "--truth", truth, other, "--json")
    assert [one["name"] for one in done.value["sequences"]] == ["street", "park"]


def test_several_results_may_be_held_against_one_truth(tmp_path, truth, perdure_says):
    write_text(tmp_path / "good.txt", WORLD.truth())
    write_text(tmp_path / "late.txt", late(WORLD.truth()))
    done = perdure_says("score", "good.txt", "late.txt", "--truth", truth)
    assert "\ngood " in done.stdout
    assert "\nlate " in done.stdout
    assert "together" not in done.stdout


def test_two_trackers_over_several_sequences_are_two_groups(tmp_path, perdure_says):
    for name in "ab":
        write_text(tmp_path / f"truth/{name}.txt", WORLD.truth())
        write_text(tmp_path / f"good/{name}.txt", WORLD.truth())
        write_text(tmp_path / f"late/data/{name}.txt", late(WORLD.truth()))  # as TrackEval lays them out
    done = perdure_says("score", "good", "late", "--truth", "truth", "--json")
    assert [(one["group"], one["name"]) for one in done.value["sequences"]] == [
        ("good", "a"), ("good", "b"), ("late", "a"), ("late", "b"),
    ]  # fmt: skip
    assert [done.value["groups"][name]["boxes"]["FN"] for name in ("good", "late")] == [0, 28]
    shown = perdure_says("score", "good", "late", "--truth", "truth").stdout
    assert "good/a " in shown
    assert "late together" in shown


@pytest.mark.parametrize(
    ("results", "truths"),
    [
        (["a.txt", "x.txt"], ["b.txt", "a.txt"]),  # one name is known, the other not: in order would mix them up
        (["several"], ["a.txt"]),  # a folder of sequences against the truth of one
        (["a.txt", "x.txt"], ["a.txt", "b.txt", "c.txt"]),
    ],
)
def test_names_that_are_known_in_part_are_not_guessed_at(tmp_path, perdure_says, results, truths):
    for name in ("truth/a", "truth/b", "truth/c", "said/a", "said/x", "said/several/a", "said/several/b"):
        write_text(tmp_path / f"{name}.txt", WORLD.truth())
    places = [f"said/{name}" for name in results], [f"truth/{name}" for name in truths]
    done = perdure_says("score", *places[0], "--truth", *places[1])
    assert done.code == 2
    assert "cannot tell which" in done.stderr


def test_pairs_made_by_their_order_are_told(tmp_path, perdure_says):
    for name in ("one", "two", "a", "b"):
        write_text(tmp_path / f"{name}.txt", WORLD.truth())
    done = perdure_says("score", "one.txt", "two.txt", "--truth", "a.txt", "b.txt")
    assert "paired in their order: two.txt with b.txt" in done.stdout


def test_a_text_may_have_any_name(tmp_path, truth, perdure_says):
    write_text(tmp_path / "result.csv", WORLD.truth())
    assert perdure_says("score", "result.csv", "--truth", truth, "--json").figures()["MOTA"] == 1.0


def test_a_truth_of_which_nothing_is_asked_for_is_told(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    done = perdure_says("score", "run", "--truth", truth, "--protocol", "mot17")
    assert "no row of " in done.stdout
    assert "is asked for in these frames (as mot17; name another --protocol)" in done.stdout
    assert "nothing was said" in perdure_says("score", "run", "--truth", truth, "--start", "90").stdout


def test_a_run_that_was_broken_off_is_told(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    RunFolder(tmp_path / "run").write_about({"status": "interrupted", "frames": 40})
    assert "run is interrupted: it ends after 38 frames" in perdure_says("score", "run", "--truth", truth).stdout
    RunFolder(tmp_path / "run").write_about({"status": "done", "frames": 40})
    assert "breaks off after 38 of 40 frames" in perdure_says("score", "run", "--truth", truth).stdout


@pytest.mark.parametrize("value", ["x", None, [], 7.0])
def test_a_run_json_with_a_wrong_value_is_named(tmp_path, truth, perdure_says, value):
    write_run(tmp_path / "run", WORLD.truth())
    RunFolder(tmp_path / "run").write_about({"reporting": {"report_confidence": value}})
    done = perdure_says("score", "run", "--truth", truth)
    assert done.code == 2
    assert "run.json: report_confidence" in done.stderr


def test_a_truth_of_another_size_is_of_another_video(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    (truth / "clip.json").write_text('{"events": [], "height": 480, "width": 640}')
    done = perdure_says("score", "run", "--truth", truth)
    assert done.code == 2
    assert "run is of pictures of 120x80" in done.stderr


def test_more_truths_than_results_are_told(tmp_path, perdure_says):
    for name in "abc":
        write_text(tmp_path / f"truth/{name}.txt", WORLD.truth())
    write_text(tmp_path / "a.txt", WORLD.truth())
    done = perdure_says("score", "a.txt", "--truth", "truth")
    assert "no result for b, c" in done.stdout


def test_numbers_that_do_not_pair_are_refused(tmp_path, perdure_says):
    for name in "abc":
        write_text(tmp_path / f"truth/{name}.txt", WORLD.truth())
    write_text(tmp_path / "x.txt", WORLD.truth())
    write_text(tmp_path / "y.txt", WORLD.truth())
    done = perdure_says("score", "x.txt", "y.txt", "--truth", "truth")
    assert done.code == 2
    assert "no truth 'x' among a, b, c" in done.stderr


def test_the_truth_may_stand_first(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", WORLD.truth())
    assert perdure_says("score", "--truth", truth, "run", "--json").figures()["MOTA"] == 1.0
    assert spread(["--json", "--truth", "a", "b", "--masks"], ("--truth",)) == [
        "--json",
        "--truth",
        "a",
        "--truth",
        "b",
        "--masks",
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run"], "no truth: name it behind --truth"),
        (["--truth", "street"], "no result: name it before --truth"),
        (["nowhere", "--truth", "street"], "there is no nowhere"),
        (["street", "--truth", "street"], "street holds no result; wanted is a run folder"),
        (["run", "--truth", "run/tracks.jsonl"], "holds no truth"),
        (["run", "--truth", "street", "--masks"], "run holds no silhouettes, only boxes"),
        (["run", "--truth", "street", "--protocol", "mot99"], "mot99"),
        (["run", "--truth", "street", "--start", "0"], "start = '0' is no frame"),
        (["run", "--truth", "street", "--start", "9", "--end", "3"], "start (9) must not lie after end (3)"),
        (["broken.txt", "--truth", "street"], "broken.txt, line 2: 'x' is no number"),
        (["twice.txt", "--truth", "street"], "twice.txt, line 2: id 1 stands twice in frame 1"),
    ],
)
def test_a_mistake_is_answered_in_one_line(tmp_path, truth, perdure_says, words, said):
    write_run(tmp_path / "run", WORLD.truth())
    (tmp_path / "broken.txt").write_text("1,1,1,1,9,9\nx,1,1,1,9,9\n")
    (tmp_path / "twice.txt").write_text("1,1,1,1,9,9\n1,1,1,1,9,9\n")
    done = perdure_says("score", *words)
    assert done.code == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_only_the_frames_of_the_window_are_scored(tmp_path, truth, perdure_says):
    write_run(tmp_path / "run", late(WORLD.truth()))
    whole = perdure_says("score", "run", "--truth", truth, "--json").figures()
    after = perdure_says("score", "run", "--truth", truth, "--json", "--start", "11").figures()
    one = perdure_says("score", "run", "--truth", truth, "--json", "--start", "12", "--end", "12").figures()
    assert whole["FN"] == 14  # the second comes in frame 6
    assert (after["FN"], after["truth_rows"]) == (0, whole["truth_rows"] - 14)
    assert one["truth_rows"] == 2


def test_a_window_is_numbered_as_text_is_or_as_track_does():
    assert read_window("1", "1") == read_window("0f", "1f") == Window(0, 0)
    assert read_window(None, None) == Window()
    with pytest.raises(ParameterError, match="leaves no frame"):
        read_window(None, "0f")


def test_an_empty_result_is_a_result(tmp_path, truth, perdure_says):
    (tmp_path / "none.txt").write_text("")
    figures = perdure_says("score", "none.txt", "--truth", truth, "--json").figures()
    assert (figures["MOTA"], figures["FN"], figures["ML"]) == (0, 74, 2)
    assert perdure_says("score", "none.txt", "--truth", "none.txt").code == 0


def test_rows_beyond_the_truth_are_told(tmp_path, perdure_says):
    tracks = WORLD.truth()
    write_text(tmp_path / "gt.txt", tracks.take(tracks.frames < 20))
    write_text(tmp_path / "said.txt", tracks)
    assert "40 rows of said.txt lie in frames of which gt.txt has no row" in (
        perdure_says("score", "said.txt", "--truth", "gt.txt").stdout
    )


def test_hidden_targets_count_from_the_confidence_of_the_run_or_of_the_moment(tmp_path, truth, perdure_says):
    tracks = WORLD.truth()
    write_run(
        tmp_path / "run", tracks.replace(status=np.full(len(tracks), Status.OCCLUDED), confidence=np.full(74, 0.4))
    )
    assert perdure_says("score", "run", "--truth", truth, "--json").figures()["rows"] == 0
    more = perdure_says("score", "run", "--truth", truth, "--json", "--report-confidence", "0.3")
    assert more.figures()["rows"] == 74


def clip_of_a_meeting(folder: Path) -> Tracks:
    """A truth of two who touch from frame 10 to 16, with its clip.json and blobs.txt; return what to say of it."""
    tracks = WORLD.truth()
    write_text(folder / "gt/gt.txt", tracks)
    events = [{"type": "merge", "frame": 11, "ids": [1, 2]}, {"type": "split", "frame": 17, "ids": [1, 2]}]
    (folder / "clip.json").write_text(json.dumps({"events": events}))
    lines = [f"{frame + 1} {'1+2' if 10 <= frame < 16 else '1 2'}" for frame in range(40)]
    (folder / "gt/blobs.txt").write_text("\n".join(lines))
    together = (tracks.frames >= 10) & (tracks.frames < 15)
    return tracks.replace(links=[(0,) if one else () for one in together])


def test_events_and_blobs_of_a_clip_are_scored(tmp_path, perdure_says):
    said = clip_of_a_meeting(tmp_path / "clip")
    write_run(tmp_path / "run", said, Event("merge", 12, 12, (1, 2)), Event("split", 30, 30, (1, 2)))
    done = perdure_says("score", "run", "--truth", "clip", "--json")
    events = done.figures("events")
    assert (events["merges"]["precision"], events["merges"]["recall"]) == (1.0, 1.0)
    assert (events["splits"]["precision"], events["splits"]["recall"]) == (0.0, 0.0)
    assert (events["blobs"]["true"], events["blobs"]["said"], events["blobs"]["found"]) == (6, 5, 5)
    assert events["returned"] == 1.0
    assert "ids back" in perdure_says("score", "run", "--truth", "clip").stdout


def test_every_mistake_is_listed_with_frame_ids_and_box(tmp_path, truth, perdure_says):
    tracks = WORLD.truth()
    swapped = np.where(tracks.frames >= 20, 3 - tracks.ids, tracks.ids)
    write_run(tmp_path / "run", tracks.replace(ids=swapped))
    done = perdure_says("score", "run", "--truth", truth, "--errors", "--json")
    (fault,) = done.value["sequences"][0]["errors"]
    assert (fault["kind"], fault["frame"], fault["cost"], len(fault["box"])) == ("exchange", 21, 34, 4)
    assert sorted(fault["true_ids"]) == sorted(fault["ids"]) == [1, 2]
    shown = perdure_says("score", "run", "--truth", truth, "--errors").stdout
    assert "1 exchange; worst first" in shown
    assert "exchanged ids" in shown


def test_silhouettes_are_scored_on_their_own_terms(tmp_path, perdure_says):
    tracks = WORLD.truth()
    masks = [
        Mask(int(y1), int(x1), np.ones((int(y2 - y1), int(x2 - x1)), bool)) for x1, y1, x2, y2 in tracks.boxes
    ]
    write_run(tmp_path / "run", tracks.replace(masks=masks))
    for kind, place in (("mots", "masks.txt"), ("mask-png", "pictures")):
        assert perdure_says("export", "run", "--format", kind, "-o", place).code == 0
        figures = perdure_says("score", "run", "--truth", place, "--json").figures("masks")
        perfect = [figures[name] for name in ("MOTSA", "sMOTSA", "HOTA", "J", "F", "J&F")]
        assert perfect == pytest.approx([1.0] * 6), kind
    figures = perdure_says("score", "pictures", "--truth", "masks.txt", "--masks").stdout
    assert "J&F" in figures


def test_pictures_of_another_size_are_another_video(tmp_path, perdure_says):
    mask = Mask(0, 0, np.ones((5, 5), bool))
    rows = Tracks.of(frames=0, times=0, ids=[1], boxes=[[0, 0, 5, 5]], masks=[mask])
    write_run(tmp_path / "small", rows)
    write_run(tmp_path / "large", rows, height=90)
    assert perdure_says("export", "large", "--format", "mots", "-o", "large.txt").code == 0
    done = perdure_says("score", "small", "--truth", "large.txt")
    assert done.code == 2
    assert "not of the same video" in done.stderr


# In pictures and films --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["missed", "wrong", "changed"])
def test_a_departure_is_red_where_it_is(kind: str):
    frame = Frame(0, 0.0, np.full((120, 160, 3), 90, np.uint8))
    plain = paint(frame, Tracks.empty(), Trails.empty(), Scene(160, 120), marks=())
    marked = paint(
        frame, Tracks.empty(), Trails.empty(), Scene(160, 120), marks=[Mark(kind, "", (40, 30, 80, 90))]
    )
    rows, columns = np.nonzero((plain != marked).any(axis=2))
    assert 36 <= columns.min() <= columns.max() <= 84
    assert 26 <= rows.min() <= rows.max() <= 94
    assert _is_red(marked).any()


def test_a_departure_outside_the_picture_is_left_out():
    frame = Frame(0, 0.0, np.full((120, 160, 3), 90, np.uint8))
    far = [Mark("missed", "missed 7", (900, 900, 950, 950)), Mark("wrong", "x", (-90, -90, -50, -50))]
    scene = Scene(160, 120)
    plain = paint(frame, Tracks.empty(), Trails.empty(), scene, marks=())
    assert np.array_equal(plain, paint(frame, Tracks.empty(), Trails.empty(), scene, marks=far))


def test_the_film_shows_what_departs_from_the_truth(tmp_path, truth, perdure_says):
    with av.open(str(tmp_path / "walk.avi"), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.height, stream.width, stream.pix_fmt = 80, 120, "yuv420p"
        for frame in WORLD.frames():
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame.image, format="rgb24")))
        container.mux(stream.encode(None))
    write_run(tmp_path / "run", late(WORLD.truth(), 20))
    assert perdure_says("draw", "walk.avi", "run", "--truth", truth, "-o", "film.mp4").code == 0
    with av.open(str(tmp_path / "film.mp4")) as film:
        red = [int(_is_red(frame.to_ndarray(format="rgb24")).sum()) for frame in film.decode(video=0)]
    assert len(red) == 40
    assert min(red[6:18]) > 3 * max(red[22:])


def _is_red(picture: np.ndarray) -> np.ndarray:
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    return (red > 170) & (green < 120) & (blue < 120) & (red - green > 90) & (abs(green - blue) < 45)


def test_scores_are_functions_too():
    from perdure.metrics import score

    assert score(WORLD.truth(), WORLD.truth()).figures["HOTA"] == pytest.approx(1.0)
    assert isinstance(WORLD.truth(), perdure.Tracks)
