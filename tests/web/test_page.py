"""The page, as somebody uses it: what she sees, and what a click or a key does to the run."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from web.conftest import CROSSING, FILM, HEIGHT, WIDTH, Viewer, report, write_run

from perdure.files.calibration import read_calibration
from perdure.files.corrections import read_corrections
from perdure.files.runs import RunFolder
from perdure.files.zones import read_zones


def until(what: Callable[[], Any], seconds: float = 5.0) -> Any:
    """Wait until something is so, and return it."""
    end = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)
    return found


def frame_of(page: Any) -> int:
    return int(page.locator("canvas[data-frame]").first.get_attribute("data-frame"))


def grey(page: Any) -> float:
    """The grey of the empty lower edge of the film on the screen, which tells the number of the frame."""
    return page.evaluate(
        """() => {
            const canvas = document.querySelector("canvas[data-frame]");
            const y = Math.round(canvas.height * 0.97), x = Math.round(canvas.width / 2);
            return canvas.getContext("2d").getImageData(x, y, 1, 1).data[0];
        }"""
    )


def at(page: Any, x: float, y: float) -> tuple[float, float]:
    """Where a point of the picture is on the screen."""
    box = page.locator("canvas[data-frame]").first.bounding_box()
    scale = min(box["width"] / WIDTH, box["height"] / HEIGHT)
    return (
        box["x"] + box["width"] / 2 + (x - WIDTH / 2) * scale,
        box["y"] + box["height"] / 2 + (y - HEIGHT / 2) * scale,
    )


def go_to(page: Any, frame: int) -> None:
    page.get_by_label("Frame", exact=True).fill(str(frame))
    page.keyboard.press("Enter")
    until(lambda: frame_of(page) == frame)


def lines(run: RunFolder) -> list[tuple[str, tuple[int, ...], int]]:
    return [(one.do, one.ids, one.begin) for one in read_corrections(run.corrections).in_force]


def test_every_frame_is_the_one_that_its_number_says(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    assert abs(grey(page) - 40) <= 2
    for frame in (17, 18, 3, FILM - 1):
        go_to(page, frame)
        assert abs(grey(page) - (40 + frame)) <= 2


@pytest.mark.slow
def test_playing_shows_every_frame_to_the_end(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    go_to(page, FILM - 9)
    page.evaluate(
        """() => {
            const canvas = document.querySelector("canvas[data-frame]"), seen = (window.seen = [canvas.dataset.frame]);
            new MutationObserver(() => seen.at(-1) !== canvas.dataset.frame && seen.push(canvas.dataset.frame))
                .observe(canvas, { attributes: true, attributeFilter: ["data-frame"] });
        }"""
    )
    page.keyboard.press("Space")
    until(lambda: frame_of(page) == FILM - 1)
    assert page.evaluate("window.seen") == [str(k) for k in range(FILM - 9, FILM)]


def test_keys_step_and_jump(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    for key, frame in (
        ("ArrowRight", 1),
        ("Shift+ArrowRight", 11),
        ("ArrowLeft", 10),
        ("End", FILM - 1),
        ("Home", 0),
    ):
        page.keyboard.press(key)
        until(lambda frame=frame: frame_of(page) == frame)


def test_what_is_most_doubtful_comes_first_and_how_many_are_left_is_always_in_view(
    run: RunFolder, serve, open_page
):
    page = open_page(serve(run))
    items = page.locator(".item .kind")
    assert items.all_inner_texts() == ["Identity resolved", "Appeared inside"]
    for tab in ("Tracks", "Zones", "Ground", "Doubts"):
        page.get_by_role("tab", name=tab).click()
        assert page.locator("#left-to-look").inner_text() == "2 doubtful left"


def test_two_clicks_mend_an_exchange_and_the_results_heed_it(run: RunFolder, truth: Path, serve, open_page):
    viewer: Viewer = serve(run, truth=truth)
    log = run.log.read_bytes()
    page = open_page(viewer)
    page.locator(".item").first.click()
    page.locator(".doubt-block").get_by_role("button", name="Swap").click()
    until(lambda: lines(run) == [("swap", (1, 2), CROSSING)])
    page.get_by_text("1 doubtful left").wait_for()
    assert viewer.ask("/api/runs/0/truth/score").value["figures"]["IDSW"] == 0
    until(lambda: viewer.ask("/api/runs/0/state").value["saved"])
    rows = [line.split(",") for line in (run.path / "tracks.txt").read_text().splitlines()]
    assert {float(row[2]) for row in rows if row[1] == "1" and int(row[0]) == FILM} == {1 + 10 + 3 * (FILM - 1)}
    assert run.log.read_bytes() == log


def test_what_was_corrected_can_be_undone_and_done_again(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.locator(".item").first.click()
    page.keyboard.press("s")
    until(lambda: lines(run))
    page.keyboard.press("Control+z")
    until(lambda: not lines(run))
    page.get_by_text("2 doubtful left").wait_for()
    page.keyboard.press("Control+Shift+z")
    until(lambda: lines(run) == [("swap", (1, 2), CROSSING)])


def test_what_is_right_is_marked_and_the_next_doubt_comes(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.keyboard.press("n")
    until(lambda: frame_of(page) == CROSSING)
    page.keyboard.press("a")
    until(lambda: frame_of(page) == 15)
    page.keyboard.press("a")
    page.get_by_text("all doubts looked at").wait_for()
    page.get_by_text("All doubts have been looked at").wait_for()
    assert [one[0] for one in lines(run)] == ["confirm", "confirm"]


def test_a_clicked_person_is_selected_and_cut_joined_or_deleted(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    go_to(page, 10)
    page.mouse.click(*at(page, 47, 60))
    page.locator(".card").get_by_text("frames 0–39").wait_for()
    page.keyboard.press("c")
    until(lambda: lines(run) == [("cut", (1, 4), 10)])
    page.get_by_role("tab", name="Tracks").click()
    page.get_by_label("Id 4, frames 10 to 39").click()
    page.keyboard.down("Shift")
    page.mouse.click(*at(page, 107, 64))
    page.keyboard.up("Shift")
    page.keyboard.press("j")
    until(lambda: lines(run)[1:] == [("join", (4, 2), 0)])
    page.get_by_label("Id 3, frames 15 to 39").click()
    page.keyboard.press("Delete")
    until(lambda: lines(run)[2:] == [("delete", (3,), 0)])
    until(lambda: page.locator(".item.track").count() == 2)


def test_a_zone_is_drawn_named_and_saved_where_track_reads_it(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.get_by_role("tab", name="Zones").click()
    page.get_by_role("button", name="Draw a zone").click()
    for x, y in ((5, 20), (50, 20), (50, 100), (5, 100)):
        page.mouse.click(*at(page, x, y))
    page.keyboard.press("Enter")
    page.get_by_label("Name").fill("west door")
    page.get_by_label("Kind").select_option("exit")
    page.get_by_label("patience").fill("3")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("Saved in").wait_for()
    (zone,) = read_zones(run.path / "zones.json", WIDTH, HEIGHT).zones
    assert (zone.kind, zone.name, zone.patience) == ("exit", "west door", 3.0)
    ring = zone.polygons[0][0]
    assert all(
        abs(a - b) < 1
        for one, other in zip(ring, ((5, 20), (50, 20), (50, 100), (5, 100)), strict=True)
        for a, b in zip(one, other, strict=True)
    )


@pytest.mark.slow
def test_a_zone_that_crosses_itself_is_refused_in_words(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.get_by_role("tab", name="Zones").click()
    page.get_by_role("button", name="Draw a zone").click()
    for x, y in ((5, 20), (50, 100), (50, 20), (5, 100)):
        page.mouse.click(*at(page, x, y))
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("its outline crosses itself").wait_for()
    assert not (run.path / "zones.json").exists()
    page.wrongs.clear()  # the browser tells of the refusal


def test_four_points_and_their_distances_make_a_ground_plane(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.get_by_role("tab", name="Ground").click()
    page.get_by_text("Click four points").wait_for()
    for x, y in ((20, 110), (140, 110), (110, 50), (50, 50)):
        page.mouse.click(*at(page, x, y))
    for name, metres in (
        ("A to B", 4),
        ("B to C", 6),
        ("C to D", 4),
        ("D to A", 6),
        ("A to C", 7.211),
        ("B to D", 7.211),
    ):
        page.get_by_label(name).fill(str(metres))
        page.keyboard.press("Tab")
    page.get_by_role("button", name="Show the grid").click()
    page.get_by_text("The grid has a line every").wait_for()
    page.get_by_role("button", name="Save").click()
    page.get_by_text("Saved in").wait_for()
    ground = read_calibration(run.path / "calibration.json", WIDTH, HEIGHT)
    a, b = ground.places([[20, 110], [140, 110]])
    assert abs(((a - b) ** 2).sum() ** 0.5 - 4) < 0.05


def test_the_truth_stands_beside_the_run_in_the_same_frame(run: RunFolder, truth: Path, serve, open_page):
    page = open_page(serve(run, truth=truth))
    go_to(page, 7)
    page.get_by_label("Shown beside the run").select_option("truth")
    page.locator("canvas[data-rows='3']").wait_for()
    shown = page.locator("canvas[data-frame]")
    assert [one.get_attribute("data-frame") for one in shown.all()] == ["7", "7"]
    assert shown.first.get_attribute("data-rows") == "2"


@pytest.mark.slow
def test_another_run_stands_beside_and_may_be_shown_instead(
    run: RunFolder, film: Path, tmp_path, serve, open_page
):
    other = write_run(tmp_path / "other", film, frames=12)
    page = open_page(serve(run, other))
    page.keyboard.press("v")
    until(lambda: page.locator("canvas[data-frame]").count() == 2)
    page.get_by_label("Run", exact=True).select_option(label="other")
    page.get_by_text("12 frames").wait_for()


def test_a_run_that_goes_on_is_seen_to_grow_and_cannot_be_corrected_yet(tmp_path, film: Path, serve, open_page):
    from perdure.files.lines import to_line
    from perdure.files.log import report_to_json

    run = write_run(tmp_path / "run", film, frames=8, status="running")
    viewer = serve(run)
    page = open_page(viewer)
    page.get_by_text("8 frames").wait_for()
    with run.log.open("a") as log:
        for k in range(8, 12):
            log.write(to_line(report_to_json(k, k / 10, report(k))))
    page.get_by_text("12 frames").wait_for()
    assert page.get_by_text("● running").count()
    assert viewer.correct(do="delete", ids=[1], begin=0).status == 422
    assert not run.corrections.exists()


def test_a_damaged_log_is_shown_as_far_as_it_is_sound_with_a_message(run: RunFolder, serve, open_page):
    written = run.log.read_bytes().splitlines(keepends=True)
    written[21] = b"}" + written[21]
    run.log.write_bytes(b"".join(written))
    page = open_page(serve(run))
    page.get_by_text(re.compile("tracks.jsonl, line 22: not JSON")).wait_for()
    page.get_by_text("20 frames").wait_for()


@pytest.mark.slow
def test_damaged_corrections_are_told_and_the_run_is_shown_without_them(run: RunFolder, serve, open_page):
    run.corrections.write_text('{"format":"perdure-corrections","version":1}\n{"do":"swop"}\n')
    viewer = serve(run)
    page = open_page(viewer)
    page.get_by_text(re.compile("corrections.jsonl, line 2: .*shown is the run without any")).wait_for()
    assert viewer.correct(do="delete", ids=[1], begin=0).status == 422


def test_without_the_token_all_can_be_seen_and_nothing_changed(run: RunFolder, serve, open_page):
    viewer = serve(run)
    page = open_page(viewer, f"http://127.0.0.1:{viewer.port}/")
    page.get_by_text("Read only").wait_for()
    page.locator(".item").first.click()
    assert page.locator(".doubt-block").get_by_role("button", name="Swap").is_disabled()
    page.keyboard.press("s")
    page.get_by_text("it holds the token").wait_for()
    assert not run.corrections.exists()


@pytest.mark.slow
def test_the_token_does_not_stay_in_the_address(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    assert "secret" not in page.url


@pytest.mark.slow
def test_a_film_that_is_gone_is_told_and_the_boxes_are_drawn_all_the_same(tmp_path, serve, open_page):
    page = open_page(serve(write_run(tmp_path / "run", tmp_path / "gone")))
    page.get_by_text(re.compile("no picture: .*gone does not exist")).wait_for()
    assert page.locator("canvas[data-frame]").get_attribute("data-rows") == "2"


@pytest.mark.slow
def test_a_run_of_nothing_is_a_run(tmp_path, film: Path, serve, open_page):
    page = open_page(serve(write_run(tmp_path / "run", film, frames=0)))
    page.get_by_text("Nothing is doubtful").wait_for()


def test_why_an_id_tells_the_features(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.mouse.click(*at(page, 17, 60))
    reasons = page.locator("#reasons")
    reasons.get_by_text("area").wait_for()
    assert "0.70" in reasons.inner_text()


@pytest.mark.slow
def test_the_page_of_keys_opens_and_closes(run: RunFolder, serve, open_page):
    page = open_page(serve(run))
    page.keyboard.press("?")
    page.get_by_role("dialog").get_by_text("Swap the two ids from here on").wait_for()
    page.keyboard.press("Escape")
    assert not page.get_by_role("dialog").is_visible()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_light_and_dark_follow_the_system_until_one_is_chosen(run: RunFolder, serve, open_page, scheme: str):
    page = open_page(serve(run), color_scheme=scheme)
    other = {"light": "dark", "dark": "light"}[scheme]
    assert page.locator("html").get_attribute("data-theme") == scheme
    page.keyboard.press("l")
    assert page.locator("html").get_attribute("data-theme") == other
    page.reload()
    assert page.locator("html").get_attribute("data-theme") == other


@pytest.mark.slow
def test_every_button_and_field_has_a_name(run: RunFolder, truth: Path, serve, open_page):
    page = open_page(serve(run, truth=truth))
    page.locator(".item").first.click()
    for tab in ("Doubts", "Tracks", "Score", "Zones", "Ground"):
        page.get_by_role("tab", name=tab).click()
        nameless = page.evaluate(
            """() => [...document.querySelectorAll("button, input, select, canvas:not([aria-hidden])")]
                .filter((one) => !(one.innerText?.trim() || one.getAttribute("aria-label") || one.labels?.length))
                .map((one) => one.outerHTML.slice(0, 80))"""
        )
        assert nameless == []
