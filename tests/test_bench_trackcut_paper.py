"""The bench of `trackcut`'s paper counts what it says: overlaps, identities, hidings, stages."""

from __future__ import annotations

from pathlib import Path

import cut_domain
import cv2
import numpy as np
import pytest
import trackcut_paper as bench
import worlds
from regions import Table

from perdure.errors import ParameterError
from perdure.files.film import Film
from perdure.trackers.trackcut import expecting
from perdure.trackers.trackcut import tracker as trackcut
from perdure.trackers.trackcut.windows import Window
from perdure.types import Frame, Mask, Regions, Rows, Scene, Tracks

HEIGHT, WIDTH = 72, 96


def block(x: int, y: int, width: int = 20, height: int = 30) -> Mask:
    return Mask(y, x, np.ones((height, width), np.bool_))


def truth(*rows: tuple[int, int, Mask | None, Mask]) -> bench.Truth:
    """Rows of (frame, object, what is seen of it or None, its whole silhouette)."""
    seen = [(frame, name, mask) for frame, name, mask, _ in rows if mask is not None]
    whole = [(frame, name, mask) for frame, name, _, mask in rows]
    return bench.Truth(*(_rows(one) for one in (seen, whole)))


def _rows(rows: list[tuple[int, int, Mask]]) -> Rows:
    frames, ids, masks = zip(*rows, strict=True)
    return Rows.of(frames=frames, ids=ids, masks=masks, size=(HEIGHT, WIDTH))


def said(*rows: tuple[int, int, Mask]) -> Tracks:
    """Rows of (frame, id, mask)."""
    frames, ids, masks = zip(*rows, strict=True)
    boxes = [mask.box for mask in masks]
    return Tracks.of(frames=frames, times=np.array(frames) / 25, ids=ids, boxes=boxes, masks=masks)


def drawn(count: int = 6, step: int = 3) -> bench.Film:
    """A rough reddish block walks over a rough green ground."""
    rng = np.random.default_rng(1)
    ground = rng.integers(60, 140, (HEIGHT, WIDTH, 3), np.uint8)
    ground = cv2.GaussianBlur(ground, (5, 5), 0) + np.array([0, 60, 0], np.uint8)
    cloth = cv2.GaussianBlur(rng.integers(0, 160, (30, 20, 3), np.uint8), (3, 3), 0) // 2
    cloth = cloth + np.array([150, 0, 0], np.uint8)
    frames, masks = [], []
    for number in range(count):
        picture, x = ground.copy(), 10 + step * number
        picture[20:50, x : x + 20] = cloth
        frames.append(Frame(number, number / 24, picture))
        masks.append(block(x, 20).to_image(HEIGHT, WIDTH))
    return bench.Film("drawn", frames, masks)


# davis


@pytest.mark.parametrize("method", bench.METHODS)
def test_every_method_carries_a_block_that_walks(method: str):
    film = drawn()
    found, one = bench.carry(film, method, bench.METHODS[method])
    assert len(found) == len(film.frames)
    assert len(one.overlaps) == len(film.frames) - 1
    assert one.j > 0.8
    assert one.milliseconds > 0


def test_the_last_frame_does_not_count():
    assert bench.Carried("x", "flow", (1.0, 0.5, 0.0), 1.0).j == 0.75


def test_two_empty_masks_are_alike_and_grabcut_leaves_nothing_to_nothing():
    none = np.zeros((HEIGHT, WIDTH), np.bool_)
    assert bench.iou(none, none) == 1.0
    assert bench.iou(none, ~none) == 0.0
    image = drawn(1).frames[0].image
    assert not bench.grabcut(image, none).any()
    assert bench.grabcut(image, ~none).all()


def test_sequences_that_are_there_are_carried_and_the_others_noted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    film, name = drawn(4), next(iter(bench.PUBLISHED))
    pictures, labels = tmp_path / "JPEGImages" / name, tmp_path / "Annotations" / name
    for folder in (pictures, labels):
        folder.mkdir(parents=True)
    for frame, mask in zip(film.frames, film.truth, strict=True):
        cv2.imwrite(str(pictures / f"{frame.index:05}.jpg"), cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR))
        cv2.imwrite(str(labels / f"{frame.index:05}.png"), np.uint8(255) * mask)
    carried = bench.davis(tmp_path, tmp_path / "strips")
    assert [one.method for one in carried] == list(bench.METHODS)
    assert all(one.j > 0.7 for one in carried)
    assert capsys.readouterr().err.count("is left out") == len(bench.PUBLISHED) - 1
    strip = cv2.imread(str(tmp_path / "strips" / f"davis-{name}.png"))
    assert strip.shape[1] == bench.COLUMNS * bench.STRIP_WIDTH
    table = bench.davis_table(carried)
    assert [row[0] for row in table.rows] == [name, "mean"]
    assert all(len(row) == len(table.head) for row in table.rows)
    (labels / "00002.png").unlink()
    with pytest.raises(ParameterError, match=r"no truth for the picture 00002\.jpg"):
        bench.davis_film(tmp_path, name)


# composites


def watched(told: Tracks, real: bench.Truth) -> bench.Watched:
    return bench.look("crossing2", "everything", told, real)


def test_an_object_is_compared_with_the_mask_that_has_its_id():
    here, half = block(10, 10), block(10, 10, height=15)
    real = truth(*((k, 1, here, here) for k in range(4)))
    one = watched(said((0, 7, here), (1, 7, here), (2, 7, half), (3, 8, here)), real)
    assert one.own() == {1: 7}
    assert one.iou() == pytest.approx((1 + 1 + 0.5 + 0) / 4)
    assert one.whoever() == pytest.approx((1 + 1 + 0.5 + 1) / 4)
    assert one.kept() == []  # 8 has stood on it


def test_two_objects_with_one_id_have_not_kept_it():
    left, right = block(5, 10), block(60, 10)
    real = truth((0, 1, left, left), (1, 2, right, right))
    assert watched(said((0, 7, left), (1, 7, right)), real).kept() == []
    assert watched(said((0, 7, left), (1, 8, right)), real).kept() == [1, 2]


def test_nothing_said_is_no_identity():
    here = block(10, 10)
    one = watched(Tracks.empty(), truth((0, 1, here, here)))
    assert one.own() == {1: 0}
    assert one.kept() == []
    assert one.iou() == one.whoever() == 0.0


def test_silhouettes_touch_that_lie_next_to_each_other():
    rows = _rows([(0, 1, block(0, 0)), (0, 2, block(20, 0)), (0, 3, block(41, 0))])
    assert bench.touching(rows) == {1, 2}
    assert bench.touching(rows.take([True, False, True])) == set()


def test_specks_of_an_object_do_not_count():
    here = block(10, 10)
    one = watched(said((0, 7, here)), truth((0, 1, here, here), (1, 1, block(10, 10, 3, 3), here)))
    assert len(one.readings) == 1


def test_an_object_is_found_again_when_its_id_stands_on_it():
    here = block(10, 10)
    seen = [here, here, None, block(10, 10, 5, 5), None, None, None, here, here, here, None, here]
    real = truth(*((k, 1, one, here) for k, one in enumerate(seen)))
    assert list(bench.hidings(real)) == [bench.Hiding(1, 2, 7)]  # the one frame at the end is too short
    one = watched(said((0, 7, here), (1, 7, here), (7, 8, here), (9, 7, here)), real)
    assert one.again(one.hidings[0]) == 2
    assert watched(said((0, 7, here)), real).again(one.hidings[0]) is None


def test_who_has_not_been_seen_yet_is_not_hidden():
    here = block(10, 10)
    real = truth(*((k, 1, here if k > 6 else None, here) for k in range(9)))
    assert list(bench.hidings(real)) == []


def test_tables_have_a_row_for_every_clip_and_hiding():
    here = block(10, 10)
    real = truth(*((k, 1, here if k not in range(2, 8) else None, here) for k in range(12)))
    told = said(*((k, 7, here) for k in range(12)))
    all_of_it = [bench.look("whiteband", setting, told, real) for setting in bench.SETTINGS]
    tables = bench.composite_tables(all_of_it)
    assert [len(one.rows) for one in tables] == [1, 1, 1, 1]
    assert all(len(row) == len(one.head) for one in tables for row in one.rows)
    assert tables[1].rows[0][1:] == ["0", "-", "-", "-"]  # nobody touches
    assert tables[3].rows[0] == ["whiteband", "1", "2 to 7", "0", "0", "0"]
    assert bench.columns_of(all_of_it[0]) <= set(range(12))
    assert all_of_it[0].as_json()["found again"][0]["after"] == 0


def test_between_the_observed_frames_nothing_is_observed():
    class All:
        def start(self, scene: Scene) -> int:
            return 0

        def step(self, state: int, frame: Frame) -> tuple[int, Regions]:
            return state + 1, Regions.of([(0, 0, 5, 5)])

        def heed(self, state: int, report: object) -> int:
            return 10 * state

    detector = bench.Seldom(All(), 3)
    state, counts = detector.start(Scene(10, 10)), []
    for k in range(7):
        state, regions = detector.step(state, Frame(k, k / 25))
        counts.append(len(regions))
    assert counts == [1, 0, 0, 1, 0, 0, 1]
    assert state == 7  # the model goes on
    assert detector.heed(state, None) == 70


@pytest.mark.parametrize("setting", bench.SETTINGS)
def test_a_film_is_watched_in_every_setting(setting: str):
    pictures = [frame.image for frame in worlds.lone_walker(count=20).frames()]
    told = bench.watch(pictures, bench.SETTINGS[setting])
    if bench.SETTINGS[setting].every == 1:
        assert set(told.ids.tolist()) == {1}
        assert told.frames.max() == 19
    assert set(told.ids.tolist()) <= {1}  # whether anything is founded between gaps is the tracker's matter


# people from pixels


def folder_of(world: worlds.World, folder: Path, past: int = 0) -> Path:
    """A world as a film and a truth, which goes on for some frames after the film's end."""
    (folder / "gt").mkdir(parents=True)
    with Film(folder / "video.mp4", world.width, world.height, fps=world.fps) as film:
        for frame in world.frames():
            film.write(frame.image, frame.time)
    (folder / "video.mp4").rename(folder / "video.avi")
    rows = [(*row, 1) for row in zip(world.truth().frames, world.truth().ids, world.truth().boxes, strict=True)]
    rows += [(world.count + k, 9, np.array([0, 0, 9, 9]), 1) for k in range(past)]
    lines = [f"{k + 1},{name},{x1 + 1},{y1 + 1},{x2 - x1},{y2 - y1},1" for k, name, (x1, y1, x2, y2), _ in rows]
    (folder / "gt" / "gt.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_both_trackers_are_scored_on_the_same_regions_and_drawn(tmp_path: Path):
    place = folder_of(worlds.lone_walker(count=30), tmp_path / "street", past=5)
    told = bench.pets(place, tmp_path / "strips")
    assert [one.tracker for one in told] == list(bench.BESIDE)
    for one in told:
        assert (one.frames, one.figures["ids"], one.figures["IDSW"]) == (30, 1, 0)
        assert one.figures["FN"] <= 3  # nothing is asked for after the film's end
        assert one.figures["MOTA"] > 0.85
        assert one.rate > 0
    table = bench.pets_table(told)
    assert [row[0] for row in table.rows] == list(bench.BESIDE)
    assert all(len(row) == len(table.head) for row in table.rows)
    assert told[0].as_json()["FP"] == told[0].figures["FP"]
    strip = cv2.imread(str(tmp_path / "strips" / "street.png"))
    assert strip.shape[1] == bench.COLUMNS * bench.STRIP_WIDTH


def test_a_film_may_be_followed_for_its_first_frames_only(tmp_path: Path):
    told = bench.pets(folder_of(worlds.lone_walker(count=30), tmp_path / "street"), None, limit=12)
    assert {one.frames for one in told} == {12}
    assert all(one.figures["truth_rows"] == 9 for one in told)


# the domain of a cut


def marked_block(count: int = 6) -> tuple[Scene, list[tuple[Frame, Regions]]]:
    """The block of `drawn`, marked in the first frame."""
    film = drawn(count)
    regions = [bench.marked_regions(film.truth[0]), *[Regions.empty()] * (count - 1)]
    return Scene(WIDTH, HEIGHT, 24.0), list(zip(film.frames, regions, strict=True))


def test_every_object_of_a_sampled_frame_is_cut_out_twice():
    scene, seen = marked_block()
    before = trackcut.expect, trackcut.contrast, trackcut.TrackCut._cut, expecting.around
    found = bench.compared("block", seen, scene, every=2)
    assert [(one.frame, one.object) for one in found.cuts] == [(2, 1), (4, 1)]
    assert all(550 < one.area < 650 for one in found.cuts)
    assert all(0 <= one.within < 0.1 and 0 <= one.anew < 0.1 for one in found.cuts)
    assert all(seconds > 0 for one in found.cuts for seconds in one.seconds)
    assert (trackcut.expect, trackcut.contrast, trackcut.TrackCut._cut, expecting.around) == before
    table = bench.domain_table([found])
    assert table.rows[0][:2] == ["block", "2"]
    assert all(len(row) == len(table.head) for row in table.rows)
    assert bench.domain_table([bench.Compared("nothing", ())]).rows == []


def test_what_is_told_of_a_film_is_the_same_whether_or_not_it_is_compared():
    scene, seen = marked_block()
    sizes = []
    for every in (1, 100):
        cuts = bench.compared("block", seen, scene, every).cuts
        sizes.append({one.frame: one.area for one in cuts})
    assert set(sizes[0]) == {1, 2, 3, 4, 5}
    assert sizes[1] == {}  # frame 0 has no object yet


@pytest.mark.parametrize("step", [1, 2, 4])
def test_the_whole_picture_has_the_cells_of_the_window(step: int):
    part = Window(13, 7, 13 + 8 * step, 7 + 6 * step, step)
    whole = cut_domain.over_all(part, Scene(WIDTH, HEIGHT))
    assert whole.x1 <= 0
    assert whole.y1 <= 0
    assert whole.x2 >= WIDTH
    assert whole.y2 >= HEIGHT
    assert (part.x1 - whole.x1) % step == (part.y1 - whole.y1) % step == 0
    inside = np.arange(48.0).reshape(part.shape)
    both = cut_domain.placed(inside, np.full(whole.shape, -1.0), part, whole)
    assert (both >= 0).sum() == inside.size
    picture = np.zeros((HEIGHT, WIDTH), np.uint8)
    picture[7 : 7 + 6 * step, 13 : 13 + 8 * step] = 200
    np.testing.assert_array_equal(whole.cut(picture) == 200, both >= 0)


def test_contrast_may_be_measured_elsewhere():
    colours = np.random.default_rng(3).uniform(0, 60, (9, 12, 3)).astype(np.float32)
    costs, sigma = trackcut.contrast(colours, 5.0)
    with cut_domain.contrast_measured(sigma):
        same, told = trackcut.contrast(colours, 5.0)
    np.testing.assert_allclose(same, costs, rtol=1e-4)
    assert told == sigma
    with cut_domain.contrast_measured(4 * sigma):
        assert (trackcut.contrast(colours, 5.0)[0] >= costs - 1e-4).all()


# speed


def five(count: int) -> list[tuple[Frame, Regions]]:
    paths = [worlds.walk((10 + 45 * (n % 3), 12 + 40 * (n // 3)), (1, 0)) for n in range(bench.OBJECTS)]
    colours = [(200, 40, 40), (40, 60, 220), (230, 220, 60), (40, 200, 60), (220, 60, 220)]
    blocks = tuple(worlds.Block(path, colour=colour) for path, colour in zip(paths, colours, strict=True))
    return worlds.World(blocks, count=count, width=160, height=100).seen()


def test_every_stage_is_timed_and_the_rest_completes_the_step():
    before = [getattr(place, name) for place, name in bench.STAGES.values()]
    speed = bench.timed(iter(five(14)), Scene(160, 100, 10.0), wanted=4)
    assert speed.frames == 4
    assert speed.observed == bench.OBJECTS
    assert sum(speed.stages.values()) == pytest.approx(speed.whole)
    assert all(speed.stages[stage] > 0 for stage in bench.STAGES)
    assert speed.ratio == pytest.approx(speed.whole / speed.bare)
    assert [getattr(place, name) for place, name in bench.STAGES.values()] == before
    assert trackcut.look_at.__name__ == "look_at"
    table = bench.speed_table(speed)
    assert all(len(row) == len(table.head) for row in table.rows)


def test_too_few_objects_cannot_be_timed():
    seen = [(frame, regions.take(np.arange(2))) for frame, regions in five(8)]
    with pytest.raises(ParameterError, match="never 5 objects"):
        bench.timed(iter(seen), Scene(160, 100, 10.0))


# the page


def test_what_is_between_the_marks_is_replaced():
    page = f"# Title\n\n{bench.MARKS.begin}\nold\n{bench.MARKS.end}\n\nEnd.\n"
    assert bench.MARKS.replaced(page, "new") == page.replace("old", "new")
    with pytest.raises(ParameterError, match="must have the lines"):
        bench.MARKS.replaced("# Title\n", "new")
    assert bench.MARKS.begin in bench.PAGE.read_text(encoding="utf-8")


def test_what_is_not_there_is_left_out_with_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert bench.davis(tmp_path, None) == []
    assert bench.composites(tmp_path, None) == []
    assert bench.pets(tmp_path, None) == []
    assert bench.domain(tmp_path) == []
    assert bench.speed_of(tmp_path / "video.avi") is None
    notes = capsys.readouterr().err
    assert notes.count("is left out") == len(bench.PUBLISHED) + len(bench.CLIPS) + 1 + len(bench.SAMPLED) + 1


def test_tables_of_parts_that_were_not_run_stay():
    def result(**parts: str) -> bench.Result:
        tables = tuple(Table(f"{part}: {cell}", ["one"], [[cell]]) for part, cell in parts.items())
        return bench.Result(tables, {"versions": {"python": "3"}, **parts})

    both = f"{bench.MARKS.begin}\n{bench.section('run', result(davis='old', speed='old'))}\n{bench.MARKS.end}\n"
    page = bench.MARKS.replaced(both, bench.section("run", result(speed="new", pets="new"), both))
    assert [table for _, table in bench.MARKS.tables(page)] == [
        "**davis: old**\n\n| one |\n| --- |\n| old |",
        "**pets: new**\n\n| one |\n| --- |\n| new |",
        "**speed: new**\n\n| one |\n| --- |\n| new |",
    ]
    assert page.count("`run`") == page.count("Versions:") == 1


def test_an_unknown_part_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("sys.argv", ["trackcut_paper.py", "--parts", "sped"])
    with pytest.raises(SystemExit) as left:
        bench.main()
    said_of_it = capsys.readouterr().err
    assert left.value.code == 2
    assert said_of_it.count("\n") == 1
    assert ", ".join(bench.PARTS) in said_of_it
