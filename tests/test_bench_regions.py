"""The bench of regions counts what it says: pixels, merged and isolated boxes, the section it writes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import regions as bench

from perdure.detect.components import components
from perdure.errors import ParameterError
from perdure.pipeline import plan
from perdure.types import Regions

INSIDE = np.ones((20, 30), np.bool_)


def picture(*blocks: tuple[int, int, int, int], size: tuple[int, int] = (20, 30)) -> np.ndarray:
    """Blocks (x1, y1, x2, y2) drawn in a picture."""
    drawn = np.zeros(size, np.bool_)
    for x1, y1, x2, y2 in blocks:
        drawn[y1:y2, x1:x2] = True
    return drawn


def boxes(*rows: tuple[float, ...]) -> np.ndarray:
    return np.array(rows, np.float32).reshape(-1, 4)


def sought(*counted: tuple[float, ...], ignored: tuple[tuple[float, ...], ...] = ()) -> bench.Sought:
    return bench.Sought(boxes(*counted), boxes(*ignored))


def look(foreground: np.ndarray) -> bench.Look:
    return bench.Look(components(np.uint8(255) * foreground, least_area=1), foreground, 0.0, 0.0)


def shares(counts: bench.Counts) -> tuple[float, float, float]:
    return counts.precision, counts.recall, counts.f_measure


# pixels


def test_a_perfect_foreground_scores_one():
    block = (4, 5, 12, 15)
    scores = bench.score(look(picture(block)), bench.Labels(picture(block), INSIDE), sought(block))
    assert set(scores.counts) == {"raw", "union", "all", "isolated"}
    assert all(shares(one) == (1.0, 1.0, 1.0) for one in scores.counts.values())


def test_pixels_are_counted_by_hand():
    #            truth 4 x 4, seen the right half of it and as much beside it
    counts = bench.pixel_counts(picture((6, 4, 10, 8)), bench.Labels(picture((4, 4, 8, 8)), INSIDE))
    assert counts == bench.Counts(hits=8, false=8, missed=8)
    assert shares(counts) == (0.5, 0.5, 0.5)


def test_unknown_outside_and_shadow_pixels_are_what_cdnet_says():
    values = np.array([[0, 50, 85, 170, 255, 255]], np.uint8)
    inside = np.array([[1, 1, 1, 1, 1, 0]], np.bool_)
    labels = bench.cdnet_labels(values, inside)
    assert labels.counted.tolist() == [[True, True, False, False, True, False]]
    everything = bench.pixel_counts(np.ones((1, 6), np.bool_), labels)
    assert everything == bench.Counts(hits=1, false=2, missed=0)  # background and shadow are false alarms
    assert bench.pixel_counts(np.zeros((1, 6), np.bool_), labels) == bench.Counts(0, 0, 1)


def test_the_union_is_of_the_regions_that_are_left_not_of_the_raw_foreground():
    foreground = picture((2, 2, 10, 10), (20, 15, 21, 16))
    found = components(np.uint8(255) * foreground, least_area=4)
    scores = bench.score(
        bench.Look(found, foreground, 0.0, 0.0), bench.Labels(picture((2, 2, 10, 10)), INSIDE), None
    )
    assert scores.counts["raw"] == bench.Counts(64, 1, 0)
    assert scores.counts["union"] == bench.Counts(64, 0, 0)
    assert scores.pixels == 600


# regions


def test_an_isolated_box_is_isolated():
    crowd = sought((0, 0, 10, 10), (5, 0, 15, 10), (40, 0, 50, 10))
    assert bench.isolated(crowd).tolist() == [False, False, True]


@pytest.mark.parametrize(("gap", "alone"), [(0.9, False), (1.1, True)])
def test_a_box_is_isolated_if_it_still_touches_none_when_all_grew_by_a_tenth(gap: float, alone: bool):
    # each of the two boxes, 10 wide, grows by half a pixel to each side
    assert bench.isolated(sought((0, 0, 10, 10), (10 + gap, 0, 20 + gap, 10))).tolist() == [alone, alone]


def test_an_ignored_box_takes_the_isolation_of_its_neighbour():
    assert bench.isolated(sought((0, 0, 10, 10), ignored=((8, 0, 18, 10),))).tolist() == [False]


def test_two_merged_boxes_lower_only_the_figures_over_all():
    truth = sought((0, 0, 10, 10), (9, 8, 19, 18), (40, 0, 50, 10))
    every, alone = bench.region_counts(boxes((0, 0, 19, 18), (40, 0, 50, 10)), truth)
    assert every == bench.Counts(hits=1, false=1, missed=2)
    assert alone == bench.Counts(hits=1, false=0, missed=0)


def test_a_false_region_far_from_everything_lowers_both_precisions():
    truth = sought((0, 0, 10, 10))
    every, alone = bench.region_counts(boxes((0, 0, 10, 10), (60, 60, 70, 70)), truth)
    assert every == alone == bench.Counts(hits=1, false=1, missed=0)


def test_a_region_has_one_truth_box_at_most():
    every, _ = bench.region_counts(boxes((0, 0, 10, 10)), sought((0, 0, 10, 9), (0, 1, 10, 10)))
    assert every == bench.Counts(hits=1, false=0, missed=1)


def test_a_region_of_an_ignored_box_is_not_counted():
    truth = sought((0, 0, 10, 10), ignored=((40, 0, 50, 10),))
    every, alone = bench.region_counts(boxes((40, 0, 50, 11)), truth)
    assert every == alone == bench.Counts(hits=0, false=0, missed=1)


def test_an_empty_result_has_no_recall_and_no_nan():
    empty = bench.Look(Regions.empty(), picture(), 0.0, 0.0)
    scores = bench.score(empty, bench.Labels(picture((4, 5, 12, 15)), INSIDE), sought((4, 5, 12, 15)))
    assert all(shares(one) == (0.0, 0.0, 0.0) for one in scores.counts.values())
    nothing = bench.score(empty, bench.Labels(picture(), INSIDE), sought())
    assert all(one == bench.Counts() and shares(one) == (0.0, 0.0, 0.0) for one in nothing.counts.values())


# clips, methods, tables


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with 32 frames in the place of `cdnet-fall`: a grey floor, a bright block on the last four."""
    folder = tmp_path / "cdnet-fall"
    for name in ("input", "groundtruth"):
        (folder / name).mkdir(parents=True)
    for number in range(1460, 1492):
        moving = picture((20, 30, 50, 70), size=(96, 128)) if number >= 1488 else np.zeros((96, 128), np.bool_)
        cv2.imwrite(str(folder / "input" / f"in{number:06d}.png"), np.where(moving, 220, 90).astype(np.uint8))
        cv2.imwrite(str(folder / "groundtruth" / f"gt{number:06d}.png"), np.uint8(255) * moving)
    cv2.imwrite(str(folder / "ROI.bmp"), np.full((96, 128), 255, np.uint8))
    (folder / "temporalROI.txt").write_text("1000 1490")
    return tmp_path


@pytest.mark.parametrize("method", ["background", "MOG2"])
def test_a_method_is_measured_on_the_frames_that_have_truth(data: Path, method: str):
    clip = bench.open_clip(data, "cdnet-fall")
    assert clip is not None
    seen: list[int] = []
    scores = bench.measure(method, clip, lambda frame, *_: seen.append(frame.index))
    assert seen == [25, 26, 27, 28, 29, 30]  # frame 31 is behind the end that temporalROI.txt says
    assert (scores.frames, scores.pixels) == (6, 6 * 96 * 128)
    assert scores.counts["union"].hits + scores.counts["union"].missed == 3 * 30 * 40
    assert scores.counts["union"].f_measure > 0.9
    assert "all" not in scores.counts


def test_our_detector_sees_what_a_run_of_perdure_sees(data: Path):
    planned = plan(data / "cdnet-fall" / "input").prepared()
    model = bench.start("background", planned.source)
    seen = [(model.look(frame).regions, regions) for frame, regions in planned.seen()]
    assert sum(len(regions) for _, regions in seen) == 4  # the block on the last four frames
    assert all(ours.equals(regions) for ours, regions in seen)


def test_a_cold_detector_has_not_seen_the_block_go_away(data: Path):
    """The block stands there from the first frame on and leaves: with a first look it is seen, without, its ghost."""
    folder = data / "cdnet-fall" / "input"
    for number in range(1460, 1465):
        (folder / f"in{number:06d}.png").write_bytes((folder / "in001490.png").read_bytes())
    counts = {}
    for method in ("background", "background-cold"):
        source = bench.open_source(folder)
        model = bench.start(method, source)
        counts[method] = [len(model.look(frame).regions) for frame in source][:10]
    assert counts["background"] == [1] * 5 + [0] * 5
    assert counts["background-cold"] == [0] * 5 + [1] * 5


def test_tables_and_json_name_every_method(data: Path):
    result = bench.run(data, ["cdnet-fall", "cdnet-highway"], ["background", "CNT"])
    pixels, times = bench.tables_of(result)
    assert [row[0] for row in pixels.rows] == ["background", "CNT"]
    assert "6 frames, 73,728 pixels, 3,600 of them moving" in pixels.title
    assert [row[1] for row in times.rows] == ["background", "CNT"]
    assert all(float(cell) > 0 for row in times.rows for cell in row[2:])
    assert bench.as_json(result)["pooled"]["cdnet-fall"]["background"]["union"]["f_measure"] > 0.9


def test_boxes_of_a_file_count_from_zero_and_flag_0_is_ignored(tmp_path: Path):
    (tmp_path / "gt.txt").write_text("1,1,11,21,5,6,1,-1,-1,-1\n2,1,1,1,4,4,1,-1,-1,-1\n2,2,9,9,2,2,0,-1,-1,-1\n")
    truth = bench.BoxTruth(tmp_path / "gt.txt")
    assert truth(1).counted.tolist() == [[10, 20, 15, 26]]
    assert truth(2).counted.tolist() == [[0, 0, 4, 4]]
    assert truth(2).ignored.tolist() == [[8, 8, 10, 10]]
    assert truth(3).counted.shape == (0, 4)


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # inside pycocotools
def test_masks_of_a_file_are_joined(tmp_path: Path):
    coding = pytest.importorskip("pycocotools.mask", reason="pycocotools reads the composites' masks")
    drawn = [picture((1, 2, 5, 6)), picture((4, 5, 9, 9))]
    codes = [coding.encode(np.asfortranarray(one.view(np.uint8)))["counts"].decode() for one in drawn]
    text = "".join(f"7 {one} 1 20 30 {code}\n" for one, code in enumerate(codes, 1))
    (tmp_path / "visible.txt").write_text(text)
    truth = bench.MaskTruth(tmp_path / "visible.txt", 20, 30)
    assert np.array_equal(truth(7).moving, drawn[0] | drawn[1])
    assert truth(7).counted.all()
    assert not truth(8).moving.any()


@pytest.mark.parametrize("words", [["--clips", "cdnet-fell"], ["--methods", "MOG3"]])
def test_an_unknown_name_is_refused_in_one_line_that_names_the_others(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("sys.argv", ["regions.py", *words])
    with pytest.raises(SystemExit) as left:
        bench.main()
    said = capsys.readouterr().err
    assert left.value.code == 2
    assert said.count("\n") == 1
    assert words[1] in said
    assert ("cdnet-fall, " in said) or ("background, background-cold, MOG2, " in said)


def test_a_data_folder_without_clips_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(ParameterError, match="no clip in"):
        bench.run(tmp_path, ["cdnet-fall"], ["MOG2"])
    assert "cdnet-fall is not in" in capsys.readouterr().err


# the page


def test_the_section_is_put_at_the_end_and_then_replaced_in_place():
    first = bench.replaced("# Benchmarks\n\nText.\n", "old")
    assert first == f"# Benchmarks\n\nText.\n\n{bench.HEADING}\n\n{bench.BEGIN}\nold\n{bench.END}\n"
    second = bench.replaced(first + "\n## After\n", "new")
    assert second == first.replace("old", "new") + "\n## After\n"


def test_a_page_with_half_a_section_is_left_alone():
    for page in (f"{bench.BEGIN}\nold\n", f"{bench.END}\nold\n{bench.BEGIN}\n"):
        with pytest.raises(ParameterError, match="must have the lines"):
            bench.replaced(page, "new")


def test_a_table_is_the_same_in_text_and_markdown():
    table = bench.Table("times", ["method", "ms"], [["MOG2", "4.02"], ["CNT", "10.50"]])
    assert bench.plain(table) == "times\n\nmethod     ms\nMOG2     4.02\nCNT     10.50"
    assert bench.markdown(table) == "**times**\n\n| method | ms |\n| --- | --- |\n| MOG2 | 4.02 |\n| CNT | 10.50 |"
