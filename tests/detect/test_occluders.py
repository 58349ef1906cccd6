"""A post is found from how people vanish at it and come out again, and nothing else is taken for one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pytest

from perdure import states
from perdure.detect.occluders import Occluder, Passages, no_passages, note, occluders
from perdure.types import Mask, Regions

HEIGHT, WIDTH, FPS = 100, 160, 25.0
POST = np.zeros((HEIGHT, WIDTH), bool)
POST[12:90, 80:92] = True
NOTHING = np.zeros_like(POST)
PLAIN = np.full((HEIGHT, WIDTH, 3), 90, np.float32)
WITH_POST = np.where(POST[:, :, None], np.float32(200), PLAIN)


def man(x: float, y: int = 40) -> np.ndarray:
    """He is 18 wide and 36 tall, with a head of 6 and a gap between his legs; x is his middle."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    up, aside = rows - y, np.abs(columns - x)
    return (
        ((up >= 0) & (up < 10) & (aside <= 3))
        | ((up >= 10) & (up < 28) & (aside <= 9))
        | ((up >= 28) & (up < 36) & (aside <= 8) & (aside >= 2))
    )


def walk(places: Iterable[float], y: int = 40, behind: np.ndarray = POST) -> Iterator[np.ndarray]:
    """Film of one who goes from place to place behind something, and of a second in which nobody is there."""
    for x in places:
        yield man(x, y) & ~behind
    for _ in range(25):
        yield NOTHING


def there(y: int = 40, behind: np.ndarray = POST, speed: float = 2.0) -> Iterator[np.ndarray]:
    return walk(np.arange(-10.0, WIDTH + 10.0, speed), y, behind)


def seen(picture: np.ndarray) -> Regions:
    from perdure.detect.components import components

    return components(picture.astype(np.uint8), 1.0)


def noted(film: Iterable[np.ndarray], passages: Passages | None = None) -> Passages:
    passages = passages or no_passages(HEIGHT, WIDTH)
    for picture in film:
        note(passages, seen(picture), 1.0 / FPS)
    return passages


def several(behind: np.ndarray) -> list[np.ndarray]:
    """Four people go by at different heights and speeds, one of them back."""
    return [
        *there(38, behind),
        *there(42, behind, 1.0),
        *list(there(45, behind, 3.0)),
        *walk(np.arange(WIDTH + 10.0, -10.0, -1.5), 40, behind),
    ]


FILM = several(POST)


def overlap(found: Occluder, truth: np.ndarray) -> float:
    mask = found.mask.to_image(*truth.shape)
    return float((mask & truth).sum() / (mask | truth).sum())


def test_a_post_that_people_pass_behind_is_an_occluder():
    found = occluders(noted(FILM), WITH_POST)
    assert len(found) == 1
    assert overlap(found[0], POST) > 0.95  # also above and below the people: its borders go on
    assert found[0].confidence > 0.99
    assert found[0].passages == pytest.approx(4.0, abs=0.5)
    assert found[0].ended > 3.0
    assert found[0].edges > 0.95
    x1, y1, x2, y2 = found[0].mask.box
    assert (found[0].polygon.min(axis=0) >= (x1, y1)).all()
    assert (found[0].polygon.max(axis=0) < (x2, y2)).all()


def test_more_passages_are_surer():
    once, often = (occluders(noted(film), WITH_POST, 0.0)[0] for film in (there(), FILM))
    assert once.confidence < often.confidence


def test_a_post_that_people_pass_in_front_of_is_none():
    assert occluders(noted(several(NOTHING)), WITH_POST) == ()


def test_a_post_with_people_in_front_as_often_as_behind_is_none():
    assert occluders(noted([*FILM, *several(NOTHING)]), WITH_POST) == ()


def test_a_man_who_stands_by_a_wall_for_a_minute_makes_no_occluder():
    fidgets = 68.0 + np.random.default_rng(3).integers(-2, 3, 1500)  # his side stays at the post's edge
    film = walk([*np.arange(-10.0, 68.0, 2.0), *fidgets, *np.arange(68.0, -10.0, -2.0)])
    assert occluders(noted(film), WITH_POST) == ()


def test_people_who_turn_round_at_a_line_on_the_floor_make_no_occluder():
    there_and_back = [*np.arange(-10.0, 70.0, 2.0), *np.arange(70.0, -10.0, -2.0)]
    and_from_the_right = [*np.arange(170.0, 102.0, -2.0), *np.arange(102.0, 170.0, 2.0)]
    film = [*walk(there_and_back), *walk(and_from_the_right)] * 3
    assert occluders(noted(film), WITH_POST) == ()


def test_the_line_of_heads_and_feet_is_no_occluder_though_the_floor_has_an_edge_there():
    floor = PLAIN.copy()
    floor[:40] = 200
    floor[76:] = 20
    assert occluders(noted([*there(behind=NOTHING)] * 4), floor) == ()


def test_a_place_without_edges_is_less_likely_an_occluder():
    passages = noted(there())
    bare, post = (occluders(passages, mean, 0.0)[0].confidence for mean in (PLAIN, WITH_POST))
    assert bare < 0.5 < post


def test_where_nobody_was_seen_there_is_no_occluder():
    assert occluders(no_passages(HEIGHT, WIDTH), WITH_POST) == ()
    passages = noted([NOTHING] * 50)
    note(passages, Regions.of([[10, 10, 30, 60]]), 0.04)  # a box without a mask
    assert occluders(passages, WITH_POST) == ()


def test_a_mirrored_world_has_the_mirrored_occluder():
    (plain,) = occluders(noted(FILM), WITH_POST)
    (mirrored,) = occluders(noted(picture[:, ::-1] for picture in FILM), WITH_POST[:, ::-1])
    assert np.array_equal(mirrored.mask.to_image(HEIGHT, WIDTH)[:, ::-1], plain.mask.to_image(HEIGHT, WIDTH))
    assert mirrored.confidence == pytest.approx(plain.confidence)


def test_a_beam_that_things_rise_behind_is_an_occluder():
    passages = no_passages(WIDTH, HEIGHT)
    for picture in FILM:
        note(passages, seen(np.ascontiguousarray(picture.T)), 1.0 / FPS)
    (beam,) = occluders(passages, np.ascontiguousarray(WITH_POST.transpose(1, 0, 2)))
    (post,) = occluders(noted(FILM), WITH_POST)
    assert np.array_equal(beam.mask.to_image(WIDTH, HEIGHT).T, post.mask.to_image(HEIGHT, WIDTH))
    assert np.array_equal(beam.polygon[:, ::-1], post.polygon)


def test_a_run_saved_on_the_way_goes_on_as_if_it_had_not_been():
    half = len(FILM) // 2 - 7
    saved = states.save(noted(FILM[:half]))
    again = noted(FILM[half:], states.load(saved, Passages))
    assert states.save(again) == states.save(noted(FILM))


def test_asking_changes_nothing():
    passages = noted(there())
    before = states.save(passages)
    occluders(passages, WITH_POST)
    assert states.save(passages) == before


def test_on_an_endless_film_counts_stay_bounded():
    passages = noted(there())
    for counts in (passages.visits, passages.through, passages.ended):
        counts[counts > 0] = 999
    noted(there(), passages)
    assert passages.visits.max() <= 1000
    assert 400 < passages.through.max() <= 1000


def test_silhouettes_that_leave_the_picture_are_cut_at_its_border():
    passages = no_passages(HEIGHT, WIDTH)
    bits = np.ones((30, 30), bool)
    places = [(-10, -10), (90, 150), (-40, 20), (20, 200)]
    note(passages, Regions.of(np.zeros((4, 4)), masks=[Mask(y, x, bits) for y, x in places]), 0.04)
    assert passages.present.sum() == 20 * 20 + 10 * 10
    assert passages.present[:20, :20].all()
    assert passages.present[90:, 150:].all()


def test_on_a_large_picture_the_grid_is_coarser_and_the_post_is_found_too():
    scale = 6  # 600 rows: cells of two pixels
    large = np.kron(WITH_POST, np.ones((scale, scale, 1), np.float32))
    passages = no_passages(HEIGHT * scale, WIDTH * scale)
    for picture in [*there(38), *there(42)]:
        note(passages, seen(np.kron(picture, np.ones((scale, scale), bool))), 1.0 / FPS)
    (found,) = occluders(passages, large)
    assert passages.cell == 2
    assert overlap(found, np.kron(POST, np.ones((scale, scale), bool))) > 0.95


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(ValueError, match="80x50"):
        occluders(no_passages(HEIGHT, WIDTH), WITH_POST[::2, ::2])
