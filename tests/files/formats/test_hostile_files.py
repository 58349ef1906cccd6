"""Files that are cut off, changed or meant ill: what is wrong and where is told, and nothing else happens."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from format_rows import content, everything
from hostile.trying import bounded
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.errors import FormatError, PerdureError
from perdure.files.formats import FORMATS, WRITTEN, read, recognised
from perdure.types import Tracks

FILES = [name for name in WRITTEN if not FORMATS[name].is_folder]
FEATURE = {
    "type": "Feature",
    "properties": {"frame": 0, "id": 1},
    "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 0]]]},
}


def kitti(**changes: str) -> str:
    words = {
        "frame": "0",
        "id": "1",
        "kind": "Car",
        "cut": "0",
        "hidden": "0",
        "alpha": "0",
        "x1": "1",
        "y1": "2",
        "x2": "3",
        "y2": "4",
    } | changes
    return " ".join([*words.values(), *["0"] * 7]) + "\n"


def cvat(shape: str = "", track: str = '<track id="1" label="car">{}</track>', head: str = "") -> str:
    return f"{head}<annotations>{track.format(shape)}</annotations>"


def box(**changes: str) -> str:
    words = {
        "frame": "0",
        "outside": "0",
        "occluded": "0",
        "keyframe": "1",
        "xtl": "1",
        "ytl": "2",
        "xbr": "3",
        "ybr": "4",
    } | changes
    return "<box " + " ".join(f'{name}="{value}"' for name, value in words.items() if value != "-") + "/>"


def mask(**changes: str) -> str:
    words = {"frame": "0", "rle": "0, 4", "left": "1", "top": "1", "width": "2", "height": "2"} | changes
    return "<mask " + " ".join(f'{name}="{value}"' for name, value in words.items()) + "/>"


def geojson(**changes: object) -> str:
    feature = {**FEATURE, **{name: value for name, value in changes.items() if name in FEATURE}}
    feature["properties"] = {**FEATURE["properties"], **{k: v for k, v in changes.items() if k not in FEATURE}}
    return json.dumps(
        {"type": "FeatureCollection", "features": [FEATURE | {"properties": {"frame": 9, "id": 9}}, feature]}
    )


def video(rows: object = None, **changes: object) -> str:
    row = {"id": 1, "image_id": 1, "category_id": 1, "track_id": 1, "bbox": [0, 0, 2, 2]}
    rows = [row | one for one in (rows or [{}])]
    value = {
        "images": [
            {"id": 1, "frame_id": 0, "width": 8, "height": 8},
            {"id": 2, "frame_id": 1, "width": 8, "height": 8},
        ],
        "annotations": rows,
        "categories": [{"id": 1, "name": "dog"}],
    }
    return json.dumps(value | changes)


def vis(row: dict[str, object] | None = None, **film: object) -> str:
    told = {
        "id": 1,
        "video_id": 1,
        "category_id": 1,
        "bboxes": [[0, 0, 2, 2], None],
        "segmentations": [None, None],
    }
    return json.dumps(
        {
            "videos": [{"id": 1, "width": 8, "height": 8, "length": 2, "file_names": ["a", "b"]} | film],
            "annotations": [told | (row or {})],
            "categories": [{"id": 1, "name": "dog"}],
        }
    )


NAMES = "frame,id,x1,y1,x2,y2,status,contour\n"
LAUGHS = '<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'
OUTSIDE = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>'
WRONG = [
    ("a.txt", kitti() + kitti(), "line 2: frame 0 has id 1 already, in line 1"),
    ("a.txt", kitti(frame="-1"), "line 1: frame -1 is not from 0"),
    ("a.txt", kitti(frame="0.5"), "line 1: frame 0.5 is not a whole number"),
    ("a.txt", kitti(id="-7"), "line 1: id -7 is not from 0"),
    ("a.txt", kitti(x1="nan"), "line 1: left of the box nan is not a number that can be"),
    ("a.txt", kitti(x1="inf"), "line 1: left of the box inf"),
    ("a.txt", kitti(x1="9"), "line 1: a box from \\(9, 2\\) to \\(3, 4\\) is inside out"),
    ("a.txt", kitti(y2="four"), "line 1: 'four' in column 10 is no number"),
    ("a.txt", kitti(hidden="5"), "line 1: occluded is 5; wanted is 0, 1, 2 or 3"),
    ("a.txt", kitti() + "0 2 Car 0\n", "line 2: 4 words; a row has 17, or 18 with its score"),
    ("a.txt", kitti(id="1_0"), "line 1: '1_0' in column 2 is no number"),
    (
        "a.txt",
        kitti()[:-1] + " 0.75\n" + kitti(id="2"),
        "line 2: 17 words where others have 18; is the file whole",
    ),
    (
        "a.txt",
        "".join(f"{k},1,0,0,5,0.75\n" for k in range(1, 20)) + "20,1,0,0,5,0.7",
        "line 20: its last number has",
    ),
    ("a.txt", "1,1,0,0,5,1_0\n", "line 1: '1_0' is no number"),
    ("a.csv", NAMES.replace("status", "ground_x") + "0,1,1,2,3,4,nan,\n", "a place or speed on the ground nan"),
    ("a.csv", NAMES + "0,\u0661,1,2,3,4,visible,\n", "in column 'id' is no number"),
    (
        "a.csv",
        NAMES + "0,1,1,2,3,4,visible,\n0,1,5,5,6,6,visible,\n",
        "line 3: frame 0 has id 1 already, in line 2",
    ),
    ("a.csv", NAMES + "0,1,1,2,3,4,seen,\n", "line 2: status 'seen' is none of visible, partly_occluded"),
    ("a.csv", NAMES + "0,1,1,2,3,,visible,\n", "line 2: bottom of the box nan"),
    ("a.csv", NAMES + "0,1,1,2,3,x,visible,\n", "line 2: 'x' in column 'y2' is no number"),
    ("a.csv", NAMES + "0,1,1,2,3,4\n", "line 2: not as many cells as the first line has names, 8"),
    (
        "a.csv",
        NAMES + '0,1,1,2,3,4,visible,"POLYGON ((0 0, 1"\n',
        "line 2: contour: 'POLYGON .*' is not well-known text",
    ),
    (
        "a.csv",
        NAMES + '0,1,1,2,3,4,visible,"POLYGON ((0 0, 1e400 0, 1 1, 0 0))"\n',
        "line 2: contour: a ring must be",
    ),
    ("a.csv", NAMES + "0,1,1,2,3,4,visible,POINT (1 2)\n", "line 2: contour: wanted is a POLYGON"),
    ("a.csv", "frame,id,x1,y1,x2,y2,id\n0,1,1,2,3,4,1\n", "line 1: column 'id' stands twice"),
    ("a.geojson", geojson(frame="0"), "feature 2: frame '0' is not a whole number"),
    ("a.geojson", geojson(frame=9, id=9), "feature 2: frame 9 has id 9 already, in feature 1"),
    ("a.geojson", geojson(id=None), "feature 2: id None is not a whole number"),
    ("a.geojson", geojson(box=[0, 0, 5]), "feature 2: not a row"),
    ("a.geojson", geojson(status="seen"), "feature 2: not a row \\('SEEN' is missing or not known\\)"),
    (
        "a.geojson",
        geojson(geometry={"type": "Point", "coordinates": [0, 0]}),
        "feature 2: .*its geometry is a 'Point'",
    ),
    (
        "a.geojson",
        geojson(geometry={"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}),
        "feature 2: .*four points",
    ),
    ("a.geojson", geojson().replace("[4, 4]", "[NaN, 4]"), "NaN is not a number that JSON has"),
    ("a.geojson", '{"type":"FeatureCollection","features":3}', "wanted is a FeatureCollection with a list"),
    ("a.json", video([{}, {"id": 2}]), "annotation 2: frame 0 has id 1 already, in annotation 1"),
    ("a.json", video([{"track_id": None}]), "annotation 1: it has no track_id: these are detections, not tracks"),
    ("a.json", video([{"track_id": -4}]), "annotation 1: id -4 is not from 0"),
    ("a.json", video([{"track_id": "a"}]), "annotation 1: id 'a' is not a whole number"),
    ("a.json", video([{"image_id": 7}]), "annotation 1: there is no image of id 7"),
    ("a.json", video([{"category_id": 5}]), "annotation 1: 5 is missing, or a category that there is not"),
    ("a.json", video([{"bbox": [0, 0, -2, 2]}]), "annotation 1: a bbox of -2x2 cannot be"),
    ("a.json", video([{"bbox": [0, 0, 2]}]), "annotation 1: a bbox must be four numbers"),
    ("a.json", video([{"bbox": [0, 0, 1e300, 2]}]), "annotation 1: right of the box 1e\\+300"),
    ("a.json", video([{"segmentation": {"size": [9, 8], "counts": "a"}}]), "annotation 1: a segmentation of size"),
    (
        "a.json",
        video([{"segmentation": {"size": [8, 8], "counts": "\u00ff"}}]),
        "annotation 1: the rle holds a letter",
    ),
    ("a.json", video([{"segmentation": {"size": [8, 8], "counts": [3]}}]), "annotation 1: the runs do not fill"),
    (
        "a.json",
        video([{"segmentation": {"size": [8, 8], "counts": [-1, 65]}}]),
        "annotation 1: the runs do not fill",
    ),
    ("a.json", video([{"segmentation": [[0, 0, 1]]}]), "annotation 1: a polygon must be"),
    ("a.json", video(images=[{"id": 1, "width": 1e9, "height": 1}]), "height and width must be whole numbers"),
    (
        "a.json",
        video(images=[{"id": 1, "width": 65000, "height": 65000}]),
        "a picture of 65000x65000 is too large",
    ),
    ("a.json", video(annotations={}), "'annotations' must be a list, not a table"),
    ("a.json", video(annotations=[3]), "annotations 1: wanted is an object, not 3"),
    ("a.json", video()[:-9], "line 1: not JSON .*is the file whole"),
    ("a.json", video(categories=[{"id": 1, "name": "d\ud800g"}]), "half of a surrogate pair stands alone"),
    ("a.json", "[" * 100_000, "nested too deep"),
    (
        "a.json",
        vis({"bboxes": [[0, 0, 2, 2]]}),
        "annotation 1: bboxes must have an entry, or null, for each of the 2",
    ),
    ("a.json", vis({"bboxes": [3, None]}), "annotation 1, frame 0: a bbox must be four numbers"),
    ("a.json", vis(length=10**12), "length must be a whole number up to"),
    ("a.json", vis(length=-1), "length must be a whole number up to"),
    ("a.xml", cvat(box(), head=LAUGHS), "line 1: it has a document type or entities, which are not read"),
    ("a.xml", cvat(box(), head=OUTSIDE), "line 1: it has a document type or entities, which are not read"),
    ("a.xml", cvat("&c;"), "line 1: not XML \\(undefined entity"),
    ("a.xml", cvat(box())[:-20], "line 1: not XML .*is the file whole"),
    ("a.xml", cvat(box() + "\n" + box()), "line 2: frame 0 has two shapes of track 1"),
    (
        "a.xml",
        cvat(box(), track='<track id="1" label="a">{0}</track>\n<track id="1" label="b">{0}</track>'),
        "already",
    ),
    ("a.xml", cvat(box(frame="-3")), "line 1: frame -3 is not a whole number from 0"),
    ("a.xml", cvat(box(xtl="nan")), "line 1: xtl 'nan' is no number"),
    ("a.xml", cvat(box(ybr="-")), "line 1: ybr is missing"),
    ("a.xml", cvat(box(xtl="7")), "a box from \\(7, 2\\) to \\(3, 4\\) is inside out"),
    ("a.xml", cvat(box(frame="0") + box(frame="900000000")), "frames 0 to 900000000 of track 1 are too many"),
    ("a.xml", cvat(box(), track='<track id="-1" label="car">{}</track>'), "id -1 is not from 0"),
    (
        "a.xml",
        cvat('<polygon frame="0" points="0,0;99999,0;99999,99999"/>'),
        "line 1, frame 0: .*too large to be drawn",
    ),
    (
        "a.xml",
        cvat(box(frame="0") + box(frame="300999")),
        "frames 0 to 300999 of track 1 are too many to be filled",
    ),
    ("a.xml", cvat(mask(rle="1, 2")), "the rle does not fill the mask's 2x2 pixels"),
    ("a.xml", cvat(mask(rle="a")), "rle must be whole numbers"),
    ("a.xml", cvat(mask(width="99999")), "a mask of 99999x2 at"),
    ("a.xml", cvat('<polygon frame="0" points="1,2;3"/>'), "points '1,2;3' are not"),
    ("a.xml", "<annotations><image/></annotations>", "this is CVAT for images, which has no tracks"),
    ("a.xml", cvat(head='<?xml version="1.0" encoding="utf-z"?>'), "line 1: its encoding cannot be read"),
    (
        "a.xml",
        cvat(box(), track='<track id="1" task_id="4">{0}</track><track id="2" task_id="5"/>'),
        "several tasks",
    ),
    ("a.xml", "<html></html>", "its first element is <html>"),
    ("a.xml", "<annotations>" + "<a>" * 50, "nested too deep"),
    ("a.parquet", "PAR1 and nothing else", "a.parquet"),
    ("a.txt", "1,1,0,0,nan,5,1,-1,-1,-1\n", "line 1: .*is not frame, id, left, top, width, height"),
    ("a.txt", "1,1,0,0,5,5,1,-1,-1,-1\n1,1,0,0,5,5,1,-1,-1,-1\n", "line 2: id 1 stands twice in frame 1"),
]


@pytest.mark.parametrize(("name", "text", "why"), WRONG, ids=[f"{k}-{one[2][:30]}" for k, one in enumerate(WRONG)])
def test_what_is_wrong_and_where_is_told(tmp_path: Path, name: str, text: str, why: str):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FormatError, match=why) as told:
        read(path, recognised(path))
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


def test_a_parquet_file_is_told_column_and_row(tmp_path: Path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "a.parquet"
    good = Tracks.of(frames=[0, 1], times=[0, 0.1], ids=[1, 1], boxes=[[0, 0, 1, 1]] * 2).to_arrow()
    flags = pa.array(["visible", "seen"])
    bits = {"x": 0, "y": 0, "height": 2, "width": 2, "runs": [3]}
    for changes, why in (
        ({"id": pa.array([1, -1])}, "row 1 .* has an id that is not from 0"),
        ({"frame": pa.array([3, 3])}, "row 1 .* has an id that its frame has already"),
        ({"frame": pa.array([0, None], pa.int64())}, "row 1: column 'frame' is empty"),
        ({"x1": pa.array([0.0, np.nan])}, "row 1: column 'x1' is not a finite number"),
        ({"x1": pa.array(["a", "b"])}, "column 'x1' holds string"),
        ({"x1": pa.array([5.0, 5.0])}, "row 0 .* has a box that is inside out"),
        ({"status": flags}, "row 1: column 'status' cannot be read"),
        ({"mask": pa.array([None, bits])}, "row 1: column 'mask' cannot be read"),
        ({"mask": pa.array([None, bits | {"height": 2**30}])}, "row 1: column 'mask' cannot be read"),
        ({"mask": pa.array([None, bits | {"runs": [1, 3], "x": 2**30}])}, "row 1: column 'mask' .* too far out"),
        ({"id": None}, "it has no column 'id'"),
    ):
        table = good
        for column, values in changes.items():
            place = table.column_names.index(column)
            table = table.remove_column(place) if values is None else table.set_column(place, column, values)
        pq.write_table(table, path)
        with pytest.raises(FormatError, match=why):
            read(path, FORMATS["parquet"])


def test_a_last_number_that_is_as_long_as_the_others_needs_no_line_end(tmp_path: Path):
    text = "".join(f"{k},1,0,0,5,{k / 4:.2f}\n" for k in range(1, 20))
    for ending in ("20,1,0,0,5,0.75", "20,1,0,0,5,5.125", "20,1,0,0,5,5\n"):
        (tmp_path / "a.txt").write_text(text + ending)
        assert len(read(tmp_path / "a.txt", FORMATS["mot"]).tracks) == 20


def test_scores_beyond_one_are_not_rounded_away(tmp_path: Path):
    tracks = Tracks.of(
        frames=[0, 1], times=0.0, ids=[1, 1], boxes=[[0, 0, 1, 1]] * 2, confidence=[98.7654, 12345.5]
    )
    for name in ("mot", "csv"):
        path = tmp_path / f"a{FORMATS[name].suffixes[0]}"
        FORMATS[name].write(path, content(tracks), overwrite=False)
        assert np.allclose(read(path, FORMATS[name]).tracks.confidence, tracks.confidence, atol=1e-4, rtol=0)


def test_a_film_of_ten_million_frames_takes_no_room_where_nothing_is_seen(tmp_path: Path):
    row = {"id": 1, "video_id": 1, "category_id": 1}
    film = {"id": 1, "width": 8, "height": 8, "length": 10**7}
    value = {"videos": [film], "annotations": [row] * 200, "categories": [{"id": 1, "name": "dog"}]}
    (tmp_path / "a.json").write_text(json.dumps(value))
    with bounded(seconds=2.0, mib=200):
        found = read(tmp_path / "a.json", FORMATS["coco-vis"])
    assert (len(found.tracks), len(found.frames or ())) == (0, 10**7)


@pytest.mark.parametrize("name", ["a.geojson", "a.xml"])
def test_a_silhouette_that_leaves_its_picture_is_cut(tmp_path: Path, name: str):
    size = "<meta><task><original_size><width>3</width><height>2</height></original_size></task></meta>"
    text = cvat(mask(), track=size + '<track id="1" label="car">{}</track>')
    if name == "a.geojson":
        value = json.loads(geojson(outline="seen"))
        text = json.dumps(value | {"picture": {"width": 3, "height": 2}})
    (tmp_path / name).write_text(text)
    found = read(tmp_path / name, recognised(tmp_path / name))
    assert any(one.area for one in found.tracks.masks)
    for one in found.tracks.masks:
        assert one.area == 0 or (one.box[2] <= 3 and one.box[3] <= 2)


def test_a_few_bytes_cannot_unfold_into_all_of_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("perdure.files.room._LEAST", 1000)
    monkeypatch.setattr("perdure.files.room._EACH", 1)
    side = 30
    rows = [{"track_id": k, "segmentation": {"size": [side, side], "counts": [0, side**2]}} for k in (1, 2)]
    pictures = [{"id": 1, "frame_id": 0, "width": side, "height": side}]
    (tmp_path / "a.json").write_text(video(rows, images=pictures))
    with pytest.raises(FormatError, match="annotation 2: its silhouettes unfold into more pixels"):
        read(tmp_path / "a.json", FORMATS["coco-video"])


def test_what_a_parquet_file_tells_of_its_film_must_be_able_to_be(tmp_path: Path):
    import pyarrow.parquet as pq

    path = tmp_path / "a.parquet"
    table = Tracks.of(frames=[0], times=[0.0], ids=[1], boxes=[[0, 0, 1, 1]]).to_arrow()
    for told, why in (
        ("[]", "no JSON object"),
        ('{"fps": "25"}', "the fps of its description, '25', cannot be"),
        ('{"fps": NaN}', "a.parquet"),
        ('{"size": [-1, 8]}', "height and width must be whole numbers"),
        ('{"size": 8}', "the size of its description"),
        ('{"frames": [0, 1.5]}', "no list of frames"),
    ):
        pq.write_table(table.replace_schema_metadata({b"perdure": told}), path)
        with pytest.raises(FormatError, match=why):
            read(path, FORMATS["parquet"])


@pytest.mark.parametrize("name", FILES)
@settings(max_examples=40)
@given(data=st.data())
def test_a_file_cut_off_or_changed_anywhere_is_read_or_refused(
    whole: dict[str, Path], name: str, data: st.DataObject
):
    path = whole[name]
    good = path.with_name(f"whole{path.suffix}").read_bytes()
    if data.draw(st.booleans()):
        path.write_bytes(good[: data.draw(st.integers(0, len(good)))])
    else:
        at = data.draw(st.integers(0, len(good) - 1))
        path.write_bytes(good[:at] + data.draw(st.binary(min_size=1, max_size=3)) + good[at + 1 :])
    refusal = ""
    try:
        read(path, FORMATS[name])
    except PerdureError as error:
        refusal = str(error)
    assert not refusal or (str(path) in refusal and "\n" not in refusal)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of each kind, and the place where a spoilt copy may stand."""
    found = {}
    for name in FILES:
        folder = tmp_path_factory.mktemp(name)
        path = folder / f"whole{FORMATS[name].suffixes[0]}"
        FORMATS[name].write(path, content(everything()), overwrite=False)
        found[name] = folder / f"spoilt{path.suffix}"
    return found
