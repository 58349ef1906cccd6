"""A file of each kind, read by another program's own reader; and files as those programs' documentation shows them."""

from __future__ import annotations

import csv
import json
import os
import subprocess
from pathlib import Path

import motrics
import numpy as np
import parity
import pytest
from format_rows import DISC, HEIGHT, PAIR, RING, SIZE, WIDTH, content
from shapely.geometry import shape

from perdure.files.formats import FORMATS, Content, read, recognised
from perdure.types import Mask, Tracks

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # of coco.annToMask
PEERS = parity.ENVIRONMENT / "bin/python"
DATUMARO = os.environ.get("PERDURE_DATUMARO", "")
FRAMES = 4


@pytest.fixture
def yard() -> Content:
    """Two who are seen in frames 0 and 1, and one of them again in frame 3."""
    masks = [RING, DISC, RING, DISC, PAIR]
    tracks = Tracks.of(
        frames=[0, 0, 1, 1, 3],
        times=[0, 0, 0.04, 0.04, 0.12],
        ids=[1, 2, 1, 2, 1],
        boxes=[mask.box for mask in masks],
        masks=masks,
        classes=["pedestrian", "car", "pedestrian", "car", "pedestrian"],
        confidence=[1, 0.5, 1, 0.5, 1],
    )
    return content(tracks, frames=tuple(range(FRAMES)))


def write(name: str, path: Path, what: Content) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert FORMATS[name].write(path, what, overwrite=False) == len(what.tracks)
    return path


def by_frame(what: Content, shift: float = 0.0) -> dict[int, tuple[list[int], list[list[float]]]]:
    """Ids and boxes, frame by frame."""
    found = {}
    for frame in np.unique(what.tracks.frames).tolist():
        here = what.tracks.in_frame(frame)
        found[frame] = here.ids.tolist(), (here.boxes + shift).tolist()
    return found


def test_motrics_reads_mot_text(yard: Content, tmp_path: Path):
    rows = motrics.load_motchallenge(write("mot", tmp_path / "a.txt", yard))
    told = {frame - 1: (list(ids), [list(box) for box in boxes]) for frame, (ids, boxes) in rows.items()}
    assert told == by_frame(yard, shift=1)  # pixels count from 1 there


def test_motrics_reads_kitti_labels(yard: Content, tmp_path: Path):
    rows = motrics.load_kitti(write("kitti", tmp_path / "a.txt", yard))
    told = {frame: (list(ids), [list(box) for box in boxes]) for frame, (ids, boxes, _) in rows.items()}
    assert told == by_frame(yard)
    assert rows[0][2] == [4, 1]  # a pedestrian and a car


def test_motrics_reads_mots_text(yard: Content, tmp_path: Path):
    rows = motrics.load_kitti_mots(write("mots", tmp_path / "a.txt", yard))
    assert {frame - 1: list(ids) for frame, (ids, _, _) in rows.items()} == {0: [1, 2], 1: [1, 2], 3: [1]}
    assert np.array_equal(motrics.mask_decode(rows[4][1][0]), PAIR.to_image(*SIZE))
    assert list(rows[1][2]) == [2, 1]


def test_motrics_reads_index_pictures(yard: Content, tmp_path: Path):
    frames = motrics.load_davis(write("mask-png", tmp_path / "pictures", yard))
    assert [list(ids) for ids, _ in frames] == [[1, 2], [1, 2], [], [1]]
    assert np.array_equal(motrics.mask_decode(frames[0][1][0]), RING.to_image(*SIZE))


def test_pycocotools_reads_coco_video(yard: Content, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    from pycocotools.coco import COCO

    coco = COCO(str(write("coco-video", tmp_path / "a.json", yard)))
    capsys.readouterr()
    assert [one["frame_id"] for one in coco.loadImgs(coco.getImgIds())] == [0, 1, 2, 3]
    rows = coco.loadAnns(coco.getAnnIds())
    assert [one["track_id"] for one in rows] == yard.tracks.ids.tolist()
    for one, mask in zip(rows, yard.tracks.masks, strict=True):
        assert np.array_equal(coco.annToMask(one), mask.to_image(*SIZE))
        assert one["area"] == mask.area
    names = {one["id"]: one["name"] for one in coco.loadCats(coco.getCatIds())}
    assert [names[one["category_id"]] for one in rows] == yard.tracks.classes.tolist()


def test_supervision_reads_coco_video(yard: Content, tmp_path: Path):
    supervision = pytest.importorskip("supervision")
    path = write("coco-video", tmp_path / "a.json", yard)
    found = supervision.DetectionDataset.from_coco(str(tmp_path), str(path))
    seen = list(found.annotations.values())
    assert [len(one) for one in seen] == [2, 2, 0, 1]
    assert np.array_equal(seen[0].xyxy, yard.tracks.in_frame(0).boxes)
    assert np.array_equal(seen[3].mask[0], PAIR.to_image(*SIZE))
    assert [found.classes[one] for one in seen[0].class_id] == ["pedestrian", "car"]


def test_pandas_reads_csv_and_parquet(yard: Content, tmp_path: Path):
    pandas = pytest.importorskip("pandas")
    tables = (
        pandas.read_csv(write("csv", tmp_path / "a.csv", yard)),
        pandas.read_parquet(write("parquet", tmp_path / "a.parquet", yard)),
    )
    for table in tables:
        assert table["frame"].tolist() == yard.tracks.frames.tolist()
        assert table[["x1", "y1", "x2", "y2"]].to_numpy(np.float32).tolist() == yard.tracks.boxes.tolist()
    mask = tables[1]["mask"][4]
    assert {**mask, "runs": list(mask["runs"])} == {"x": 11, "y": 1, "height": 2, "width": 3, "runs": [0, 2, 2, 2]}


def test_shapely_reads_geojson(yard: Content, tmp_path: Path):
    value = json.loads(write("geojson", tmp_path / "a.geojson", yard).read_text())
    shapes = [shape(one["geometry"]) for one in value["features"]]
    assert [one.area for one in shapes] == [mask.area for mask in yard.tracks.masks]
    assert shapes[0].bounds == RING.box
    assert all(one.is_valid for one in shapes)


@pytest.mark.skipif(not PEERS.exists(), reason="no environment of the peers; `python bench/peers.py` makes it")
@pytest.mark.parametrize("kind", ["mot", "mots", "kitti", "coco-vis"])
def test_trackeval_reads_them(yard: Content, tmp_path: Path, kind: str):
    people = yard.replace(tracks=yard.tracks.replace(classes=["pedestrian"] * 5))
    if kind == "kitti":
        write(kind, tmp_path / "truth/label_02/yard.txt", people)
        write(kind, tmp_path / "said/ours/data/yard.txt", people)
        (tmp_path / "truth/evaluate_tracking.seqmap.training").write_text(f"yard empty 000000 {FRAMES:06d}\n")
    elif kind == "coco-vis":
        write(kind, tmp_path / "youtube_vis_all/truth.json", people)
    else:
        write(kind, tmp_path / "truth/yard.txt", people)
        write(kind, tmp_path / "said/ours/data/yard.txt", people)
    program = parity.ROOT / "bench/peers/reading.py"
    done = subprocess.run(
        [PEERS, program, kind, tmp_path, str(FRAMES)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for ids, places in json.loads(done.stdout).values():
        assert ids == [[1, 2], [1, 2], [], [1]]
        assert [len(one) for one in places] == [2, 2, 0, 1]
        if kind == "kitti":
            assert places[0] == people.tracks.in_frame(0).boxes.tolist()
        if kind == "mot":
            assert places[0] == [[4, 3, 4, 3], [10, 7, 3, 3]]  # left, top, width, height, from 1


@pytest.mark.skipif(not DATUMARO, reason="PERDURE_DATUMARO names no Python with datumaro")
def test_datumaro_reads_cvat(yard: Content, tmp_path: Path):
    write("cvat", tmp_path / "annotations.xml", yard)
    program = (
        "import json, sys; from datumaro import Dataset; print(json.dumps([[item.attributes['frame'],"
        " [[one.attributes['track_id'], one.get_bbox()] for one in item.annotations if not one.attributes['outside']]]"
        " for item in Dataset.import_from(sys.argv[1], 'cvat')]))"
    )
    done = subprocess.run([DATUMARO, "-c", program, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = {frame: rows for frame, rows in json.loads(done.stdout.splitlines()[-1]) if rows}
    assert told == {
        frame: [[one, [x1, y1, x2 - x1, y2 - y1]] for one, (x1, y1, x2, y2) in zip(ids, boxes, strict=True)]
        for frame, (ids, boxes) in by_frame(yard).items()
    }


# As other programs write them -----------------------------------------------------------------------------------

CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations>
  <version>1.1</version>
  <meta>
    <task>
      <id>5</id>
      <name>interpolation</name>
      <size>4620</size>
      <mode>interpolation</mode>
      <labels>
        <label>
          <name>car</name>
          <attributes>
          </attributes>
        </label>
      </labels>
      <original_size>
        <width>640</width>
        <height>480</height>
      </original_size>
    </task>
    <dumped>2018-09-25 16:05:07.134046+03:00</dumped>
  </meta>
  <track id="0" label="car">
    <polygon frame="0" points="324.79,213.16;323.74,227.90;347.42,237.37;371.11,217.37;350.05,190.00;318.47,191.58" outside="0" occluded="0" keyframe="1">
    </polygon>
    <polygon frame="1" points="324.79,213.16;323.74,227.90;347.42,237.37;371.11,217.37;350.05,190.00;318.47,191.58" outside="1" occluded="0" keyframe="1">
    </polygon>
    <polygon frame="6" points="305.32,237.90;312.16,207.90;352.69,206.32;355.32,233.16;331.11,254.74" outside="0" occluded="0" keyframe="1">
    </polygon>
    <polygon frame="7" points="305.32,237.90;312.16,207.90;352.69,206.32;355.32,233.16;331.11,254.74" outside="1" occluded="0" keyframe="1">
    </polygon>
  </track>
  <track id="1" label="car">
    <box frame="110" xtl="634.12" ytl="37.68" xbr="661.50" ybr="71.37" outside="0" occluded="1" keyframe="1">
      <attribute name="model">1</attribute>
    </box>
    <box frame="111" xtl="634.21" ytl="38.50" xbr="661.59" ybr="72.19" outside="0" occluded="1" keyframe="0">
      <attribute name="model">1</attribute>
    </box>
    <box frame="112" xtl="634.30" ytl="39.32" xbr="661.67" ybr="73.01" outside="1" occluded="1" keyframe="1">
      <attribute name="model">1</attribute>
    </box>
  </track>
  <track id="2" label="s1" source="manual">
    <skeleton frame="0" keyframe="1" z_order="0">
      <points label="1" outside="0" occluded="0" keyframe="1" points="112.07,258.59">
      </points>
    </skeleton>
  </track>
</annotations>
"""


def test_the_sample_of_cvats_documentation_is_read(tmp_path: Path):
    path = tmp_path / "annotations.xml"
    path.write_text(CVAT)
    found = read(path, recognised(path))
    tracks = found.tracks
    assert (found.size, found.name, len(found.frames or ())) == ((480, 640), "interpolation", 4620)
    assert list(zip(tracks.frames.tolist(), tracks.ids.tolist(), strict=True)) == [
        (0, 1),
        (6, 1),
        (110, 2),
        (111, 2),
    ]
    assert tracks.inferred.tolist() == [False, False, False, True]
    assert tracks.status.tolist() == [0, 0, 1, 1]
    assert tracks.classes.tolist() == ["car"] * 4
    assert tracks.boxes[2].tolist() == np.float32([634.12, 37.68, 661.50, 71.37]).tolist()
    assert tracks.boxes[0].tolist() == np.float32([318.47, 190.00, 371.11, 237.37]).tolist()
    assert tracks.masks[0].area == pytest.approx(tracks.outlines[0].area, rel=0.02)
    assert "count from 0" in found.notes[0]
    assert found.notes[1] == "shapes that are no boxes, polygons or masks left out: 1"


def test_the_mask_of_cvats_documentation_is_read_row_by_row(tmp_path: Path):
    rle = "3, 5, 7, 7, 5, 9, 3, 11, 2, 11, 2, 12, 1, 12, 1, 26, 1, 12, 1, 12, 2, 11, 3, 9, 5, 7, 7, 5, 3"
    shape_ = f'<mask frame="4" outside="0" occluded="0" rle="{rle}" left="707" top="888" width="13" height="15"/>'
    path = tmp_path / "a.xml"
    path.write_text(f'<annotations><track id="3" label="car">{shape_}</track></annotations>')
    (mask,) = read(path, recognised(path)).tracks.masks
    assert mask.box == (707, 888, 720, 903)
    assert mask.bits[0].tolist() == [False] * 3 + [True] * 5 + [False] * 5
    assert mask.area == 5 + 7 + 9 + 11 + 11 + 12 + 12 + 26 + 12 + 12 + 11 + 9 + 7 + 5


def test_between_two_keyframes_a_box_goes_on_a_straight_line_until_it_is_outside(tmp_path: Path):
    box = '<box frame="{}" outside="{}" occluded="0" keyframe="1" xtl="{}" ytl="0" xbr="{}" ybr="8"/>'
    shapes = [(0, 0, 0), (4, 0, 8), (6, 1, 8), (9, 0, 20), (10, 0, 21)]
    listed = "".join(box.format(frame, outside, x, x + 4) for frame, outside, x in shapes)
    path = tmp_path / "a.xml"
    path.write_text(f'<annotations><track id="1" label="dog">{listed}</track></annotations>')
    tracks = read(path, recognised(path)).tracks
    told = dict(zip(tracks.frames.tolist(), tracks.boxes[:, 0].tolist(), strict=True))
    assert told == {0: 0, 1: 2, 2: 4, 3: 6, 4: 8, 5: 8, 9: 20, 10: 21}
    assert tracks.inferred.tolist() == [False, True, True, True, False, True, False, False]


def test_a_kitti_truth_is_read_and_areas_that_nobody_need_care_about_are_left_out(tmp_path: Path):
    path = tmp_path / "0000.txt"
    path.write_text(
        "0 -1 DontCare -1 -1 -10.000000 219.310000 188.490000 245.500000 218.560000 -1000 -1000 -1000 -10 -1 -1 -1\n"
        "0 0 Van 0 0 -1.793451 296.744956 161.752147 455.226042 292.372804 2.0 1.823255 4.433886 -4.5 1.8 13.4 -2.1\n"
        "0 2 Pedestrian 0 1 -2.523309 1106.137292 166.576807 1204.470628 323.876144 1.7 0.6 0.9 6.3 1.5 8.4 -1.9\n"
        "1 0 Van 0 2 -1.796862 294.898777 156.024256 452.199718 284.621269 2.0 1.823255 4.433886 -4.6 1.8 13.4 -2.1\n"
    )
    found = read(path, recognised(path))
    tracks = found.tracks
    assert (tracks.ids.tolist(), tracks.status.tolist()) == ([1, 3, 1], [0, 1, 2])
    assert tracks.classes.tolist() == ["Van", "Pedestrian", "Van"]
    assert tracks.boxes[0].tolist() == np.float32([296.744956, 161.752147, 455.226042, 292.372804]).tolist()
    assert found.notes[1] == "areas of type DontCare left out: 1"


def coco(**changes: object) -> dict[str, object]:
    """A file of CocoVID, of two films with one row each."""
    pictures = [
        {
            "id": 10 + film,
            "video_id": film,
            "frame_id": 5,
            "file_name": f"{film}.jpg",
            "width": WIDTH,
            "height": HEIGHT,
        }
        for film in (1, 2)
    ]
    rows = [
        {"id": film, "image_id": 10 + film, "category_id": 3, "instance_id": 8, "bbox": [1, 2, 3, 4], "iscrowd": 0}
        for film in (1, 2)
    ]
    films = [{"id": 1, "name": "left"}, {"id": 2, "name": "right"}]
    categories = [{"id": 3, "name": "dog"}]
    return {"videos": films, "images": pictures, "annotations": rows, "categories": categories, **changes}


def test_of_a_coco_file_with_two_films_one_is_chosen(tmp_path: Path):
    from perdure.errors import ParameterError
    from perdure.files.formats import Reading

    path = tmp_path / "a.json"
    path.write_text(json.dumps(coco()))
    format_ = recognised(path)
    with pytest.raises(ParameterError, match=r"2 videos; choose one by --video: left, right"):
        read(path, format_)
    with pytest.raises(ParameterError, match=r"no video 'middle'; it holds left, right"):
        read(path, format_, reading=Reading("middle"))
    found = read(path, format_, reading=Reading("right"))
    assert (found.tracks.frames.tolist(), found.tracks.ids.tolist(), found.images) == ([5], [8], {5: "2.jpg"})
    assert found.tracks.boxes.tolist() == [[1, 2, 4, 6]]


def test_frame_ids_count_from_1_where_pictures_know_the_one_before(tmp_path: Path):
    pictures = [{"id": 1, "frame_id": 1, "prev_image_id": -1, "width": WIDTH, "height": HEIGHT}]
    row = {"id": 1, "image_id": 1, "category_id": 3, "track_id": 4, "bbox": [0, 0, 2, 2]}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(coco(videos=[], images=pictures, annotations=[row])))
    assert read(path, recognised(path)).tracks.frames.tolist() == [0]


def test_segmentations_may_be_polygons_or_plain_runs(tmp_path: Path):
    square = [[2, 2, 6, 2, 6, 6, 2, 6]]
    runs = {"size": [HEIGHT, WIDTH], "counts": [0, 2, HEIGHT * WIDTH - 2]}
    rows = [
        {"id": k, "image_id": 11, "category_id": 3, "track_id": k, "segmentation": one, "bbox": [0, 0, 1, 1]}
        for k, one in enumerate((square, runs), 1)
    ]
    path = tmp_path / "a.json"
    path.write_text(
        json.dumps(coco(videos=[], images=[{"id": 11, "width": WIDTH, "height": HEIGHT}], annotations=rows))
    )
    masks = read(path, recognised(path)).tracks.masks
    assert masks[0] == Mask(2, 2, np.ones((4, 4), bool))
    assert masks[1] == Mask(0, 0, np.ones((2, 1), bool))


def test_a_sequence_of_motchallenge_brings_its_size_and_rate(tmp_path: Path):
    (tmp_path / "gt").mkdir()
    (tmp_path / "gt/gt.txt").write_text("1,1,11,21,30,40,1,1,1\n2,1,11,21,30,40,0,8,0.5\n")
    told = "name=MOT-1\nimDir=img1\nframeRate=10\nseqLength=5\nimWidth=640\nimHeight=480\nimExt=.jpg\n"
    (tmp_path / "seqinfo.ini").write_text(f"[Sequence]\n{told}")
    found = read(tmp_path, recognised(tmp_path))
    assert (found.size, found.fps, tuple(found.frames)) == ((480, 640), 10, (0, 1, 2, 3, 4))
    assert found.tracks.times.tolist() == [0, 0.1]
    assert found.tracks.classes.tolist() == ["pedestrian", "distractor"]
    assert found.notes == (
        "rows that the truth does not ask for (flag 0), here of confidence 0: 1; of another format `score` asks for them, too",
    )


def test_what_pandas_writes_of_tracks_is_read(yard: Content, tmp_path: Path):
    pytest.importorskip("pandas")
    path = tmp_path / "a.csv"
    tracks = yard.tracks.replace(groups=[0, 9, 0, 9, 0], inferred=[False, True, False, False, False])
    tracks.to_pandas().to_csv(path, index=False)
    back = read(path, recognised(path)).tracks
    assert back.equals(tracks.replace(masks=[Mask.empty()] * 5))


def test_a_table_of_another_program_needs_six_columns_only(tmp_path: Path):
    path = tmp_path / "a.csv"
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["id", "frame", "x1", "y1", "x2", "y2", "colour"])
        table.writerow([3, 7, 1, 2, 3.5, 4, "red"])
    tracks = read(path, recognised(path)).tracks
    assert (tracks.ids.tolist(), tracks.frames.tolist(), tracks.boxes.tolist()) == ([3], [7], [[1, 2, 3.5, 4]])
