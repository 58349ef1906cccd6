"""The comparison with other trackers, without them: what is handed over, cut, laid out and written."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import peers
import pytest

from perdure.metrics import score
from perdure.types import Frame, Regions, Rows, Scene

PYTHON = peers.ENVIRONMENT / "bin" / "python"


@pytest.fixture(name="run")
def the_script_of_the_peers() -> ModuleType:
    spec = importlib.util.spec_from_file_location("peers_run", peers.HERE / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def walk(count: int = 12) -> peers.Seen:
    """One thing walks right from frame 5; in the third frame nothing is seen."""
    boxes = [[10.5 + 2 * k, 20, 30.5 + 2 * k, 60] for k in range(count)]
    regions = [Regions.empty() if k == 2 else Regions.of([box], scores=[0.75]) for k, box in enumerate(boxes)]
    truth = Rows.of(frames=np.arange(5, 5 + count), ids=np.ones(count), boxes=boxes)
    frames = tuple(Frame(5 + k, (5 + k) / 12.5) for k in range(count))
    return peers.Seen(Scene(200, 100, 12.5), frames, tuple(regions), truth)


def a_line(name: str, hota: float) -> peers.Line:
    """A line whose score has the wanted share of the truth found."""
    truth = walk(100).truth
    said = truth.take(np.arange(round(100 * hota)))
    return peers.Line(peers.Runner(name, "defaults", "how", None), score(said, truth), 0.01234, "")


def a_table(*lines: peers.Line) -> peers.Table:
    return peers.Table("A film", ("film",), True, 100, 100, 1, tuple(lines))


def test_the_module_and_not_the_folder_is_imported():
    assert Path(peers.__file__).name == "peers.py"


class Echo:
    """A tracker that calls everything 7."""

    def update(self, regions):
        return regions


def test_a_peer_gets_the_regions_and_its_rows_come_back(tmp_path, run):
    given, fps = walk(), []
    run.LIBRARIES["echo"] = lambda job, rate: (
        fps.append(rate) or run.Peer(Echo, lambda boxes, scores: boxes, lambda boxes: ((7, one) for one in boxes))
    )
    peers.save_regions(tmp_path / "film.regions.npz", given)
    run.run({"library": "echo", "scores_above": 0.5}, tmp_path, "film")
    outcome = peers.load_outcome(tmp_path, "film", "")
    assert fps == [12.5]
    assert outcome.rows.frames.tolist() == [5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16]
    assert set(outcome.rows.ids.tolist()) == {7}
    assert outcome.rows.boxes.tolist() == [box.tolist() for one in given.regions for box in one.boxes]
    assert outcome.seconds > 0


def test_regions_below_the_cut_are_not_offered(tmp_path, run):
    run.LIBRARIES["echo"] = lambda job, rate: run.Peer(
        Echo, lambda boxes, scores: boxes, lambda boxes: ((7, one) for one in boxes)
    )
    peers.save_regions(tmp_path / "film.regions.npz", walk())
    run.run({"library": "echo", "scores_above": 0.75}, tmp_path, "film")
    assert len(peers.load_outcome(tmp_path, "film", "").rows) == 0


def test_a_peer_that_fails_leaves_one_line_and_the_others_their_rows():
    runner = peers.Runner(
        "norfair", "defaults", "", {"library": "norfair", "make": "Tracker", "scores_above": None}
    )
    found = peers.follow_there(runner, {"film": walk()}, Path(sys.executable))  # our environment has no peers
    assert found["film"].fault == "ModuleNotFoundError: No module named 'norfair'"
    ours = peers.follow_here(next(one for one in peers.runners() if one.job is None), {"film": walk()})
    clip = peers.Clip("film", "tud-campus", lambda root: walk())
    trackers = [runner, peers.Runner("perdure/overlap", "defaults", "", None)]
    outcomes = {(trackers[0], "film"): found["film"], (trackers[1], "film"): ours["film"]}
    table = peers.tabulate("tud-campus", {"film": walk()}, [clip], trackers, outcomes)
    assert [one.runner.tracker for one in table.lines] == ["perdure/overlap", "norfair"]
    assert "failed: ModuleNotFoundError" in peers.text_table(peers.cells(table)).splitlines()[-1]


def test_a_process_that_ends_early_is_told_from_a_fault(tmp_path):
    assert peers.load_outcome(tmp_path, "film", "its process ended with -11: no reason given").fault.startswith(
        "its"
    )


def test_frames_are_halved_as_mot17_halves_them():
    assert [peers.second_half(count) for count in (600, 1050, 5)] == [300, 525, 2]


def test_only_the_second_half_of_a_sequence_is_read_and_scored(tmp_path):
    folder = tmp_path / "mot17-text" / "MOT17-77"
    for name in ("gt", "det"):
        (folder / name).mkdir(parents=True)
    (folder / "seqinfo.ini").write_text("[Sequence]\nframeRate=30\nseqLength=6\nimWidth=64\nimHeight=48\n")
    (folder / "gt" / "gt.txt").write_text("".join(f"{k},1,{k},1,10,20,1,1,1\n" for k in range(1, 7)))
    (folder / "det" / "some.txt").write_text("3,-1,3,1,10,20,.9\n4,-1,4,1,10,20,.3\n6,-1,6,1,10,20,.8\n")
    seen = peers.from_second_half("MOT17-77", "some.txt", tmp_path)
    assert [frame.index for frame in seen.frames] == [3, 4, 5]
    assert [len(one) for one in seen.regions] == [1, 0, 1]
    assert seen.regions[0].boxes.tolist() == [[3, 0, 13, 20]]
    assert seen.truth.frames.tolist() == [3, 4, 5]


def test_a_sequence_whose_data_is_absent_is_left_out_with_a_note(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PERDURE_DATA", str(tmp_path))
    there = peers.Clip("there", "tud-campus", lambda root: walk())
    absent = next(one for one in peers.CLIPS if one.name == "tud-campus")
    assert list(peers.read_all([there, absent])) == ["there"]
    assert "note: tud-campus is left out" in capsys.readouterr().err
    with pytest.raises(peers.PeersError, match="PERDURE_DATA"):
        peers.read_all([absent])


def test_a_table_is_laid_out_for_a_terminal_and_for_markdown():
    cells = peers.cells(a_table(a_line("left/one", 0.64)))
    assert cells[0][:4] == ("left/one", "defaults", "64.0", "64.0")
    assert cells[0][-2:] == ("0.012", "1")
    head, below = peers.text_table(cells).splitlines()
    assert head.index("HOTA") == below.index("64.0")
    assert peers.markdown_table(cells).splitlines()[1].count("---") == len(peers.HEAD)


def test_numbers_keep_two_digits():
    assert [peers.two_digits(one) for one in (0.01234, 1.26, 431.0, 1.0)] == ["0.012", "1.3", "430", "1"]


def test_the_section_comes_at_the_end_and_is_then_replaced_in_place():
    page = peers.with_section("# Benchmarks\n\n## Rate\n\nfast\n", "old")
    assert page.endswith(f"{peers.HEADING}\n\n{peers.BEGINS}\n\nold\n\n{peers.ENDS}\n")
    longer = f"{page}\n## Later\n"
    again = peers.with_section(longer, "new")
    assert again == longer.replace("old", "new")


def test_a_page_with_one_of_the_two_marks_is_refused():
    with pytest.raises(peers.PeersError, match="without the other"):
        peers.with_section(f"# Benchmarks\n{peers.BEGINS}\n", "new")
    with pytest.raises(peers.PeersError, match="without the other"):
        peers.with_section(f"# Benchmarks\n{peers.ENDS}\n", "new")


def test_every_peer_has_its_defaults_and_its_published_settings(run):
    theirs = [one for one in peers.runners() if one.job]
    assert {one.settings for one in theirs} == {"defaults", "published"}
    assert {one.job["library"] for one in theirs} == set(run.LIBRARIES)
    published = next(one for one in theirs if (one.tracker, one.settings) == ("pyxtrackers/sort", "published"))
    assert published.how.startswith("regions with scores above 0.5 only, max_age 1, min_hits 3")


def test_trackers_and_sequences_are_chosen_by_name_or_group():
    named = {one.name: one for one in peers.CLIPS}
    assert [one.name for one in peers.chosen("sequence", ["mot17-fixed-frcnn"], named, lambda one: one.group)] == [
        "MOT17-02-frcnn",
        "MOT17-04-frcnn",
    ]
    with pytest.raises(peers.PeersError, match="'pets9-det' is not a sequence; did you mean 'pets09-det'"):
        peers.chosen("sequence", ["pets9-det"], named, lambda one: one.group)


def test_a_folder_that_is_no_environment_is_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(peers.PeersError, match="name another folder"):
        peers.environment(tmp_path)
    assert (tmp_path / "thesis.txt").exists()


def test_an_environment_without_the_peers_is_named_with_a_remedy(tmp_path):
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python").symlink_to(sys.executable)
    with pytest.raises(peers.PeersError, match="remove the folder and run this again"):
        peers.environment(tmp_path)


@pytest.mark.skipif(not PYTHON.exists(), reason="no environment of the peers; python bench/peers.py makes it")
def test_a_real_peer_follows_a_walk():
    runner = next(one for one in peers.runners() if one.tracker == "pyxtrackers/bytetrack")
    outcome = peers.follow_there(runner, {"film": walk()}, PYTHON)["film"]
    assert outcome.fault == ""
    assert set(outcome.rows.ids.tolist()) == {1}


def test_the_script_of_the_peers_knows_nothing_of_perdure():
    script = peers.HERE / "run.py"
    assert "import perdure" not in script.read_text(encoding="utf-8")
    done = subprocess.run(
        [sys.executable, script, "--versions", "numpy", "none-such"], capture_output=True, text=True
    )
    assert json.loads(done.stdout) == {"numpy": np.__version__, "none-such": None}
