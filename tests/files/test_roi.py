"""Regions of interest: what is drawn is what is inside."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.errors import FormatError, ParameterError
from perdure.files.roi import read_roi

DATA = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared" / "data"))


def drawn(roi: np.ndarray) -> list[str]:
    return ["".join(".#"[int(bit)] for bit in row) for row in roi]


def test_a_box_is_its_corner_and_size() -> None:
    assert drawn(read_roi("1,1,3,2", 6, 4)) == ["......", ".###..", ".###..", "......"]


def test_a_polygon_with_the_corners_of_a_box_is_that_box() -> None:
    assert np.array_equal(read_roi("1,1 4,1 4,3 1,3", 6, 4), read_roi("1,1,3,2", 6, 4))


def test_a_triangle_holds_the_pixels_whose_centre_it_holds() -> None:
    assert drawn(read_roi("0,0 5.2,0 0,5.2", 5, 5)) == ["#####", "####.", "###..", "##...", "#...."]


def test_what_leaves_the_picture_is_cut() -> None:
    assert read_roi("-5,-5,100,100", 6, 4).all()
    assert read_roi("-5,-5 100,-5 100,100 -5,100", 6, 4).all()


@given(st.lists(st.tuples(st.integers(-3, 12), st.integers(-3, 12)), min_size=3, max_size=7))
def test_a_polygon_holds_what_a_point_in_polygon_test_says(points: list[tuple[int, int]]) -> None:
    def holds(x: float, y: float) -> bool:
        inside = False
        for (x1, y1), (x2, y2) in zip(points, points[1:] + points[:1], strict=True):
            if (y1 > y) != (y2 > y) and x >= x1 + (y - y1) * (x2 - x1) / (y2 - y1):
                inside = not inside
        return inside

    oracle = np.array([[holds(x + 0.5, y + 0.5) for x in range(10)] for y in range(8)])
    text = " ".join(f"{x},{y}" for x, y in points)
    if oracle.any():
        assert np.array_equal(read_roi(text, 10, 8), oracle)
    else:
        with pytest.raises(ParameterError):
            read_roi(text, 10, 8)


def test_an_image_is_inside_where_it_is_not_black(tmp_path: Path) -> None:
    image = np.zeros((4, 6), np.uint8)
    image[1:3, 2:5] = 255
    image[0, 0] = 1
    cv2.imwrite(str(tmp_path / "roi.png"), image)
    assert np.array_equal(read_roi(str(tmp_path / "roi.png"), 6, 4), image > 0)
    with pytest.raises(FormatError, match="6x4, the scene 8x4"):
        read_roi(tmp_path / "roi.png", 8, 4)


SQUARE = [[[1, 1], [4, 1], [4, 3], [1, 3], [1, 1]]]
DOT = [[[5, 0], [6, 0], [6, 1], [5, 1], [5, 0]]]


@pytest.mark.parametrize(
    "written",
    [
        {"type": "MultiPolygon", "coordinates": [SQUARE, DOT]},
        {
            "type": "FeatureCollection",
            "features": [
                {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": SQUARE}},
                {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": DOT}},
            ],
        },
    ],
)
def test_geojson_may_hold_several_polygons(tmp_path: Path, written: dict[str, object]) -> None:
    (tmp_path / "roi.json").write_text(json.dumps(written))
    assert drawn(read_roi(tmp_path / "roi.json", 6, 4)) == [".....#", ".###..", ".###..", "......"]


def test_a_polygon_may_have_a_hole(tmp_path: Path) -> None:
    ring = [[0, 0], [5, 0], [5, 5], [0, 5]]
    hole = [[2, 2], [3, 2], [3, 3], [2, 3]]
    (tmp_path / "roi.json").write_text(json.dumps({"type": "Polygon", "coordinates": [ring, hole]}))
    assert drawn(read_roi(tmp_path / "roi.json", 5, 5))[2] == "##.##"


def test_a_text_file_holds_a_polygon_a_line(tmp_path: Path) -> None:
    (tmp_path / "roi.txt").write_text("# the street\n1,1 4,1 4,3 1,3\n\n5,0 6,0 6,1 5,1  # a door\n")
    assert drawn(read_roi(tmp_path / "roi.txt", 6, 4)) == [".....#", ".###..", ".###..", "......"]


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("roi.txt", "1,1 2,2\n", "line 1: not a polygon"),
        ("roi.txt", "", "no polygon"),
        ("roi.json", "{", "line 1: not JSON"),
        ("roi.json", '{"type": "Point", "coordinates": [1, 2]}', "not GeoJSON"),
        ("roi.json", '{"type": "Polygon", "coordinates": [[[1, 2]]]}', "not GeoJSON"),
        ("roi.json", "[1, 2]", "not GeoJSON"),
        ("roi.json", '{"type": "FeatureCollection", "features": []}', "no polygon"),
        ("roi.json", "[" * 100_000, "not JSON"),
        ("roi.json", '{"type": "Feature", "geometry": ' * 100_000, "not JSON"),
        ("roi.json", '{"type": "Feature", "geometry": ' * 800 + "{}" + "}" * 800, "not GeoJSON"),
        ("roi.json", f'{{"type": "Polygon", "coordinates": [[[{"1" * 5000}, 1], [1, 2], [2, 2]]]}}', "not JSON"),
        ("roi.json", f'{{"type": "Polygon", "coordinates": [[[{"1" * 400}, 1], [1, 2], [2, 2]]]}}', "1000000"),
        ("roi.json", '{"type": "Polygon", "coordinates": [[["12", "13"], [1, 2], [2, 2]]]}', "not GeoJSON"),
        ("roi.json", '{"type": "Polygon", "coordinates": 5}', "not GeoJSON"),
        ("roi.txt", f"{'1' * 400},1 1,2 2,2", "1000000"),
    ],
)
def test_a_file_that_is_no_region_is_refused_in_one_line(
    tmp_path: Path, name: str, text: str, reason: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FormatError, match=reason) as refused:
        read_roi(tmp_path / name, 6, 4)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["nowhere.png", "1,2,3", "1,2 3,4", "", "10,10,5,5", "1,1,0,3", "1,1,-2,3"])
def test_a_text_that_is_no_region_is_refused(text: str) -> None:
    with pytest.raises(ParameterError):
        read_roi(text, 6, 4)


@pytest.mark.parametrize(
    "given",
    [
        "x" * 300,
        "y/" * 3000,
        "1" * 400 + ",1,2,3",
        "1" * 5000 + ",1 1,2 2,2",
        "a\nb",
        "a\0b",
        5,
        None,
        b"1,1,2,2",
        [1],
    ],
)
def test_whatever_is_given_for_a_region_is_refused_in_one_short_line(given: object) -> None:
    with pytest.raises(ParameterError) as refused:
        read_roi(given, 6, 4)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 250


def test_a_long_polygon_with_a_slip_at_its_end_is_refused_at_once() -> None:
    with pytest.raises(ParameterError, match="no region"):
        read_roi(" ".join(["1000,1000"] * 100) + " 5;5", 6, 4)


def test_a_black_image_is_no_region(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "roi.png"), np.zeros((4, 6), np.uint8))
    with pytest.raises(ParameterError, match="no pixel inside"):
        read_roi(tmp_path / "roi.png", 6, 4)


def test_a_scene_without_a_border_is_inside_everywhere() -> None:
    path = DATA / "cdnet-highway" / "ROI.bmp"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    assert read_roi(path, 320, 240).all()
