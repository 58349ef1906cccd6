"""`perdure explain`, and the contexts and networks that a run is given."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import perdure
from perdure import equipment
from perdure.cli.commands import app
from perdure.errors import FormatError, ParameterError
from perdure.files.contexts import write_context
from perdure.files.log import RunLog, read_log
from perdure.files.runs import RunFolder
from perdure.reasons import told
from perdure.scene.context import Context
from perdure.types import Event, Explanation, Renamed, Report, Status, Tracks

COUNT, GONE = 40, range(18, 21)


def sequence(folder: Path) -> Path:
    """A MOTChallenge folder without images: two side by side to the right, the first not detected for 3 frames."""
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        f"[Sequence]\nname=yard\nframeRate=10\nseqLength={COUNT}\nimWidth=320\nimHeight=240\n"
    )
    rows = []
    for k in range(COUNT):
        for who, (left, top) in enumerate(((20 + 4 * k, 60), (32 + 4 * k, 66))):
            if who or k not in GONE:
                rows.append(f"{k + 1},-1,{left + 1},{top + 1},24,60,1,-1,-1,-1\n")
    (folder / "det/det.txt").write_text("".join(rows))
    return folder


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequence(tmp_path_factory.mktemp("films") / "yard")


def said(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, list(map(str, words)))
    return done.exit_code, done.stdout, f"{done.exception or ''}\n{done.stderr}"


def tracked(yard: Path, out: Path, *words: object) -> Path:
    code, _, wrong = said("track", yard, "--no-video", "-o", out, *words)
    assert code == 0, wrong
    return out


@pytest.fixture(scope="module")
def run(yard: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tracked(
        yard, tmp_path_factory.mktemp("runs") / "run", "--tracker", "multifeature", "--context", "default"
    )


def test_a_link_says_what_each_feature_counts_and_who_came_next(run: Path):
    code, text, _ = said("explain", run, "--id", 1, "--frame", 12)
    assert code == 0
    assert text.splitlines()[0] == "id 1 in frame 12 (1.20 s): visible, region 0, confidence 1.00"
    assert "under the context 'default'" in text
    assert text.splitlines()[3].split() == ["feature", "link", "global", "weight", "counts"]
    assert "runner-up     id 2 would have scored" in text
    assert "other region  region 1 would have scored" in text


def test_what_features_count_sums_up_to_the_score_and_the_margin_is_that_to_the_best_rival(run: Path):
    value = json.loads(said("explain", run, "--id", 1, "--frame", 12, "--json")[1].splitlines()[-1])
    (link,) = value["links"]
    assert sum(one["counts"] for one in link["features"].values()) - link["waned"] == pytest.approx(
        link["score"], abs=1e-3
    )
    rivals = [link["runner_up"]["score"], link["other_region"]["score"]]
    assert link["margin"] == pytest.approx(link["score"] - max(rivals), abs=1e-3)
    assert (link["runner_up"]["id"], link["other_region"]["region"]) == (2, 1)
    assert (value["row"]["regions"], value["row"]["remark"]) == ([0], "")


def test_without_an_id_the_most_doubtful_links_of_all_are_shown(run: Path):
    code, out, _ = said("explain", run, "--json")
    links = json.loads(out)["links"]
    assert code == 0
    assert {one["id"] for one in links} == {1, 2}
    every = {one: json.loads(said("explain", run, "--id", one, "--all", "--json")[1])["links"] for one in (1, 2)}

    def doubt(link: dict) -> float:
        return link["score"] if link["margin"] is None else min(link["margin"], link["score"])

    worst = sorted(doubt(link) for some in every.values() for link in some)
    assert [doubt(one) for one in links] == worst[:10]
    shown = said("explain", run, "--most", 3)[1].splitlines()
    assert (len(shown), shown[1].split()[:2]) == (5, ["id", "frame"])
    for wrong in (("--frame", 3), ("--all",), ("--id", 1, "--all", "--most", 2)):
        assert said("explain", run, *wrong)[0]


def test_without_a_frame_the_most_doubtful_links_come_first_and_all_of_them_in_order(run: Path):
    def links(*words: object) -> list[dict]:
        return json.loads(said("explain", run, "--id", 1, "--json", *words)[1].splitlines()[-1])["links"]

    some, every = links("--most", 4), links("--all")
    doubt = [min(one["margin"], one["score"]) for one in some]
    assert len(some) == 4
    assert doubt == sorted(doubt)
    assert doubt[0] == min(min(one["margin"], one["score"]) for one in every if one["margin"] is not None)
    assert [one["frame"] for one in every] == sorted(one["frame"] for one in every)
    assert len(said("explain", run, "--id", 1, "--most", 4)[1].splitlines()) == 11


def test_a_frame_may_be_written_as_for_start_and_end(run: Path):
    plain = said("explain", run, "--id", 1, "--frame", 12)
    assert said("explain", run, "--id", 1, "--frame", "12f") == plain
    for wrong in ("12.5", "-1", "f", "1:02", "9" * 30):
        code, _, why = said("explain", run, "--id", 1, f"--frame={wrong}")
        assert (code, "is no number of a frame; write '10' or '10f'" in why) == (1, True)


def test_a_row_that_was_filled_in_says_between_which_frames(run: Path):
    text = said("explain", run, "--id", 1, "--frame", 19)[1]
    assert "filled in between frames 17 and 21" in text
    first = said("explain", run, "--id", 1, "--frame", 0)[1]
    assert "had no id yet" in first


def test_who_asks_for_what_is_not_there_is_told_what_there_is(run: Path, tmp_path: Path):
    code, _, wrong = said("explain", run, "--id", 9)
    assert "there is no id 9 in the run; it has 2, the nearest 2, 1" in wrong
    assert code
    assert "id 1 has no row in frame 99; the nearest is in 39" in said("explain", run, "--id", 1, "--frame", 99)[2]
    assert "leave out one" in said("explain", run, "--id", 1, "--frame", 9, "--all")[2]
    assert "not a run folder" in said("explain", tmp_path, "--id", 1)[2]


def test_a_run_without_reasons_says_which_parameter_would_put_them_down(yard: Path, tmp_path: Path):
    out = tracked(yard, tmp_path / "bare", "--tracker", "multifeature", "--no-explain")
    code, text, wrong = said("explain", out, "--id", 1)
    assert code == 0
    assert "track again with --explain" in wrong
    assert "entered" in text
    other = tracked(yard, tmp_path / "other", "--tracker", "compound")
    code, text, wrong = said("explain", other, "--id", 1, "--frame", 10)
    assert code == 0
    assert "the tracker compound puts down no reasons of links" in wrong
    assert text.startswith("id 1 in frame 10")


def rows(*ids: int, frame: int, status: int = Status.VISIBLE) -> Tracks:
    return Tracks.of(
        frames=frame, times=frame / 10, ids=list(ids), boxes=[[9 * one, 0, 9 * one + 8, 9] for one in ids],
        status=int(status), inferred=status != Status.VISIBLE,
    )  # fmt: skip


def reason(identity: int, rival: int, score: float = 0.8) -> Explanation:
    figures = {"score": score, "region": 0.0, "link:area": score, "global:area": score, "weight:area": 1.0}
    return Explanation(identity, "highest", {**figures, f"runner_up:{rival}": 0.5})


def test_ids_are_the_settled_ones_of_the_row_of_the_runner_up_and_of_events(tmp_path: Path):
    swap = (Renamed(1, 2, 1, 2), Renamed(2, 1, 1, 2))
    lost = Renamed(3, 1, 3, 3)
    reports = [
        Report(rows(1, 2, frame=0), explanations=(reason(1, 2), reason(2, 1))),
        Report(rows(1, 2, frame=1), explanations=(reason(1, 2, 0.6), reason(2, 1, 0.7))),
        Report(
            rows(1, 2, frame=2),
            renamed=swap,
            events=(Event("exchanged", 1, 2, (1, 2), why="by their looks"),),
            explanations=(reason(1, 2, 0.9),),
        ),
        Report(rows(3, frame=3), explanations=(reason(3, 2, 0.4),)),
        Report(renamed=(lost,), events=(Event("found_again", 3, 4, (1,), why="by its looks"),)),
    ]
    out = tmp_path / "run"
    out.mkdir()
    with RunLog(out / "tracks.jsonl") as log:
        for k, report in enumerate(reports):
            log.append(k, k / 10, report)
    one = told(lambda: read_log(RunFolder(out).log), 1)
    assert {frame: found.score for frame, found in one.reasons.items()} == {0: 0.8, 1: 0.7, 2: 0.9, 3: 0.4}
    assert {frame: found.runner_up for frame, found in one.reasons.items()} == {
        0: (2, 0.5), 1: (2, 0.5), 2: (2, 0.5), 3: (2, 0.5)
    }  # fmt: skip
    assert [event.kind for event in one.about(1)] == ["exchanged"]
    assert [event.kind for event in one.about(3)] == ["exchanged", "found_again"], (
        "what decided before is told, too"
    )
    assert one.rows.frames.tolist() == [0, 1, 2, 3]
    with pytest.raises(ParameterError, match="no id 3 any more: it turned out to be 1; ask for --id 1"):
        told(lambda: read_log(RunFolder(out).log), 3)
    assert "by its looks" in said("explain", out, "--id", 1, "--frame", 3)[1]


def test_a_log_without_tracks_has_no_ids(tmp_path: Path):
    with pytest.raises(ParameterError, match="the run has no tracks"):
        told(lambda: iter(()), 1)


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    write_context(tmp_path / "flat.json", Context("flat", {"area": 1.0, "displacement_2d": 1.0}, similar=0.1))
    return tmp_path / "flat.json"


def test_a_context_that_is_named_is_in_force_and_in_the_description_of_the_run(
    yard: Path, flat: Path, tmp_path: Path
):
    out = tracked(yard, tmp_path / "run", "--tracker", "multifeature", "--context", flat)
    about = json.loads((out / "run.json").read_text())["context"]
    assert (about["given"], about["chosen"], about["of"]) == ([str(flat)], "flat", ["flat"])
    assert about["weights"] == {"area": 1.0, "displacement_2d": 1.0}
    assert "under the context 'flat'" in said("explain", out, "--id", 1, "--frame", 12)[1]


def test_of_several_contexts_the_nearest_is_chosen_and_told(yard: Path, flat: Path, tmp_path: Path):
    out = tracked(yard, tmp_path / "run", "--tracker", "multifeature", "--context", "auto", "--context", flat)
    about = json.loads((out / "run.json").read_text())["context"]
    assert about["given"] == ["auto", str(flat)]
    assert "flat" in about["of"]
    assert len(about["of"]) > 1
    event = next(line for line in (out / "events.csv").read_text().splitlines() if line.startswith("context"))
    assert f'"{about["chosen"]}: ' in event or f",{about['chosen']}: " in event


def test_weights_and_contexts_that_do_not_go_together_are_refused(yard: Path, flat: Path, tmp_path: Path):
    def refused(*words: object, tracker: str = "multifeature") -> str:
        code, _, wrong = said("track", yard, "--no-video", "-o", tmp_path / "no", "--tracker", tracker, *words)
        assert code
        assert not (tmp_path / "no").exists()
        return wrong

    assert "--context goes with --tracker multifeature; compound takes none" in refused(
        "--context", "auto", tracker="compound"
    )
    assert "--embedding goes with" in refused("--embedding", flat, tracker="overlap")
    assert "leave one out" in refused("--context", flat, "--weights", "area=1")
    assert "leave out the other" in refused("--context", flat, "--context", "default")
    assert "No such file" in refused("--context", tmp_path / "none.json")
    assert "needs a network; name its ONNX file with --embedding" in refused("--weights", "embedding=1")
    assert "weigh looks alone" in refused("--weights", "histogram=1,dominant=1")
    assert "did you mean 'area'" in refused("--weights", "are=1")
    assert "all are 0" in refused("--weights", "area=0")
    assert "must be a number ≥ 0" in refused("--weights", "area=-1")
    value = json.loads(flat.read_text())
    for change, what in ({"version": 9}, "version 9"), ({"weights": {"hat": 1.0}}, "'hat' is not a feature"):
        (tmp_path / "odd.json").write_text(json.dumps(value | change))
        assert what in refused("--context", tmp_path / "odd.json")
    (tmp_path / "twin.json").write_text(json.dumps(value | {"similar": 0.9}))
    assert "both hold a context 'flat'" in refused("--context", flat, "--context", tmp_path / "twin.json")


def test_an_embedding_that_is_missing_or_cannot_be_run_is_refused(
    yard: Path, flat: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    words = ("track", yard, "--no-video", "-o", tmp_path / "no", "--tracker", "multifeature", "--embedding")
    assert "there is no such file" in said(*words, tmp_path / "none.onnx")[2]
    assert "not a whole ONNX model" in said(*words, flat)[2]
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    code, _, wrong = said(*words, flat)
    assert code
    assert "pip install 'perdure[onnx]'" in wrong


def test_a_context_that_counts_on_pictures_or_metres_is_noted_where_there_are_none(yard: Path, tmp_path: Path):
    weights = {"area": 1.0, "histogram": 0.5, "displacement_3d": 0.5}
    plan = perdure.plan(yard, tracker="multifeature", context=Context("rich", weights))
    plan.source.close()
    looks, metres = plan.notes()
    assert looks == "the context rich weighs histogram: nothing without pictures, which the source has not"
    assert metres == "the context rich weighs displacement_3d: nothing without a known ground plane"
    plan = perdure.plan(yard, tracker="multifeature")
    plan.source.close()
    assert plan.notes() == (), "nobody asked for those that come with the package"
    assert bool(plan.tracker.contexts) == (equipment.USUAL == equipment.AUTO)
    with pytest.raises(ParameterError, match="context looks weighs looks alone"):
        perdure.plan(yard, tracker="multifeature", context=Context("looks", {"histogram": 1.0}))


def test_from_python_contexts_are_files_or_contexts_for_a_film_and_for_a_loop(yard: Path, flat: Path):
    tracks = perdure.track(yard, tracker="multifeature", context=flat)
    assert set(tracks.ids.tolist()) == {1, 2}
    loop = perdure.Online("multifeature", fps=10, context=Context("mine", {"overlap": 1.0}), confirm=0.0)
    loop.update([[10, 10, 30, 60]])
    assert loop.update(np.float32([[12, 10, 32, 60]])).ids.tolist() == [1]
    assert loop.report.explanations[0].why.endswith("'mine'")
    assert len(perdure.Online("multifeature", context="auto").tracker.contexts) > 1
    assert perdure.Online("multifeature", weights="area=1").tracker.contexts == ()
    with pytest.raises(ParameterError, match="goes with --tracker multifeature"):
        perdure.Online("overlap", context="auto")
    with pytest.raises(FormatError):
        perdure.Online("multifeature", context="none.json")


def test_weights_that_tell_nothing_of_a_source_are_noted(yard: Path, tmp_path: Path):
    words = ("--tracker", "multifeature", "--weights", "displacement_2d=1,displacement_3d=1,histogram=1")
    _, _, noted = said("track", yard, "--no-video", "-o", tmp_path / "run", *words)
    assert "weigh histogram: nothing without pictures" in noted
    assert "weigh displacement_3d: nothing without a known ground plane" in noted


def test_a_run_of_a_part_and_a_truth_of_another_video_are_noted_by_score(yard: Path, run: Path, tmp_path: Path):
    part = tracked(yard, tmp_path / "part", "--end", "20f")
    whole, elsewhere = tmp_path / "whole.txt", tmp_path / "elsewhere.txt"
    rows = [f"{k + 1},1,{left + 4 * k},61,24,60,1,1,1\n" for left in (21, 1021) for k in range(COUNT)]
    whole.write_text("".join(rows[:COUNT]))
    elsewhere.write_text("".join(rows[COUNT:]))
    assert "is of a part of the video (--end 20f)" in said("score", part, "--truth", whole)[1]
    assert "is of a part" not in said("score", part, "--truth", whole, "--end", "20f")[1]
    assert "is of a part" not in said("score", run, "--truth", whole)[1]
    assert "is it the truth of this video?" in said("score", run, "--truth", elsewhere)[1]
    assert "is it the truth" not in said("score", run, "--truth", whole)[1]
