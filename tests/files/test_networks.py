"""Networks in files: what is read, with what words others are refused, and what they see."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
pytest.importorskip("onnx", reason="onnx is not installed, by which networks are drawn")

from networks import cells, network, red_meter

import perdure
from perdure.detect import Network
from perdure.errors import FormatError, ParameterError, PerdureError
from perdure.files.models import read_embedding
from perdure.files.networks import names_of, read_class_names, read_network
from perdure.types import Frame, Regions, Scene

N = cells(64)


def yolov8(path: Path, classes: int = 3, **more) -> Path:
    answer = np.zeros((1, 4 + classes, N), np.float32)
    answer[0, :6, 11] = [16, 32, 16, 32, 0.1, 0.8]
    return network(path, {"output0": answer}, **more)


def of_coco(path: Path) -> Path:
    answer = np.zeros((1, 84, cells(96)), np.float32)
    answer[0, :6, 11] = [16, 32, 16, 32, 0.1, 0.8]
    return network(path, {"output0": answer}, shape=(1, 3, 96, 96))


def seen(detector: Network, image: np.ndarray, frame: int = 0) -> Regions:
    scene = Scene(image.shape[1], image.shape[0])
    return detector.step(detector.start(scene), Frame(frame, 0.0, image))[1]


def test_a_thing_is_told_where_it_is_in_the_picture_with_the_name_that_the_file_gives(tmp_path):
    place = yolov8(tmp_path / "m.onnx", metadata={"names": "{0: 'cat', 1: 'dog', 2: 'bird'}", "task": "detect"})
    model = read_network("onnx", place)
    regions = seen(Network(model=model), np.zeros((32, 128, 3), np.uint8))  # a half, and 24 rows of grey above it
    assert regions.boxes.tolist() == [[16, 0, 48, 32]]  # what reaches beyond the picture is cut
    assert regions.classes.tolist() == ["dog"]
    assert regions.scores.tolist() == pytest.approx([0.8])
    assert regions.data["class_id"].tolist() == [1]
    assert model.known == ("cat", "dog", "bird")


@pytest.mark.parametrize(
    "text",
    ["{0: 'cat', 1: 'hot dog'}", '{"0": "cat", "1": "hot dog"}', "['cat', 'hot dog']", '["cat", "hot dog"]'],
)
def test_names_are_read_as_python_or_json_says_them(text):
    assert names_of({"names": text}) == ("cat", "hot dog")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "cat",
        "{1: 'cat'}",
        "{'a': 'cat'}",
        "[1, 2]",
        "[[[",
        "__import__('os').getcwd()",
        "(" * 5000,
        "{0: ''}",
        "7",
    ],
)
def test_what_are_no_names_is_none(text):
    assert names_of({"names": text}) == ()
    assert names_of({"labels": "cat hot_dog"}) == ("cat", "hot_dog")


def test_eighty_classes_are_those_of_coco_and_others_are_numbers(tmp_path):
    coco = read_network("onnx", of_coco(tmp_path / "coco.onnx")).known
    assert (len(coco), coco[0], coco[24], coco[79]) == (80, "person", "backpack", "toothbrush")
    assert len(set(coco)) == 80
    assert read_network("onnx", yolov8(tmp_path / "own.onnx")).known == ("0", "1", "2")


def test_names_that_are_given_go_before_those_of_the_file_and_must_be_as_many(tmp_path):
    place = yolov8(tmp_path / "m.onnx", metadata={"names": "{0: 'a', 1: 'b', 2: 'c'}"})
    assert read_network("onnx", place, names=("x", "y", "z")).known == ("x", "y", "z")
    with pytest.raises(FormatError, match="there are 2 names of classes, its output has 3"):
        read_network("onnx", place, names=("x", "y"))
    with pytest.raises(FormatError, match="its file gives 1 names of classes, its output has 3"):
        read_network("onnx", yolov8(tmp_path / "n.onnx", metadata={"names": "{0: 'a'}"}))


def test_names_of_classes_come_one_a_line_or_as_json(tmp_path):
    (tmp_path / "lines.txt").write_text("person\ntraffic light\n")
    (tmp_path / "list.json").write_text('["person", "traffic light"]')
    for name in ("lines.txt", "list.json"):
        assert read_class_names(tmp_path / name) == ("person", "traffic light")
    (tmp_path / "gap.txt").write_text("person\n\ncar\n")
    (tmp_path / "empty.txt").write_text("\n")
    (tmp_path / "bytes.txt").write_bytes(b"\xff\xfe\x00x")
    for name in ("gap.txt", "empty.txt", "bytes.txt", "none.txt", "."):
        with pytest.raises(FormatError, match=r"names of classes|name of a class"):
            read_class_names(tmp_path / name)


@pytest.mark.parametrize(("colour", "score"), [((255, 0, 0), 1.0), ((0, 0, 255), 0.0)])
def test_rows_after_suppression_are_given_red_first_from_0_to_1(tmp_path, colour, score):
    place = red_meter(tmp_path / "m.onnx", [8, 8, 40, 40, 0, 0], at=4, most=1.0, shape=(1, 3, 64, 64))
    regions = seen(
        Network(network_score=0.01, model=read_network("onnx", place)), np.full((64, 64, 3), colour, np.uint8)
    )
    assert regions.scores.tolist() == ([score] if score else [])


def test_ssd_is_given_blue_first_from_0_to_255_also_with_channels_last(tmp_path):
    place = red_meter(tmp_path / "m.onnx", [0, 1, 0, 0.25, 0.25, 0.5, 0.5], at=2, most=255.0, shape=(1, 3, 64, 64))
    blue = np.full((32, 128, 3), (0, 0, 255), np.uint8)
    regions = seen(Network(model=read_network("onnx", place)), blue)
    assert regions.scores.tolist() == [1.0]
    assert regions.boxes.tolist() == [[32, 8, 64, 16]]  # stretched
    assert regions.classes.tolist() == ["1"]


@pytest.mark.parametrize(
    ("shape", "kind"), [((1, 64, 64, 3), "float16"), ((1, 64, 64, 3), "uint8"), ((3, 64, 64), "float32")]
)
def test_inputs_of_other_numbers_and_orders_are_served(tmp_path, shape, kind):
    place = yolov8(tmp_path / "m.onnx", shape=shape, kind=kind)
    assert len(seen(Network(model=read_network("onnx", place)), np.zeros((64, 64, 3), np.uint8))) == 1


def test_a_network_for_several_pictures_at_once_is_given_one_several_times(tmp_path):
    answer = np.zeros((4, 7, N), np.float32)
    answer[:, :6, 11] = [16, 32, 16, 32, 0.1, 0.8]
    model = read_network("onnx", network(tmp_path / "m.onnx", {"output0": answer}, shape=(4, 3, 64, 64)))
    assert len(seen(Network(model=model), np.zeros((64, 64, 3), np.uint8))) == 1


def test_a_network_that_takes_any_size_is_given_the_one_that_it_names_or_the_user(tmp_path):
    free = {"shape": ("n", 3, "h", "w"), "declared": {"output0": (1, 7, "cells")}}
    assert read_network("onnx", yolov8(tmp_path / "m.onnx", **free), size=64).layout.fit.width == 64
    named = yolov8(tmp_path / "n.onnx", metadata={"imgsz": "[64, 64]"}, **free)
    assert read_network("onnx", named).layout.fit.height == 64
    with pytest.raises(FormatError, match="no known layout"):  # cells of 64, of a picture of 640
        read_network("onnx", tmp_path / "m.onnx")
    with pytest.raises(ParameterError, match="takes pictures of 64x64 only"):
        read_network("onnx", yolov8(tmp_path / "o.onnx"), size=320)


def test_boxes_that_cannot_be_and_too_many_are_left_out_and_told(tmp_path):
    answer = np.zeros((1, 300, 6), np.float32)
    answer[0, :5] = [
        [8, 8, 40, 40, 0.9, 0], [np.nan, 8, 40, 40, 0.9, 0], [40, 40, 8, 8, 0.9, 0], [8, 8, 40, 40, 0.5, 0], [8, 8, 40, 40, 0.7, 0],
    ]  # fmt: skip
    model = read_network("onnx", network(tmp_path / "m.onnx", {"output0": answer}))
    regions = seen(Network(most_objects=2, model=model), np.zeros((64, 64, 3), np.uint8), frame=7)
    assert regions.scores.tolist() == pytest.approx([0.9, 0.7])
    (event,) = regions.events
    assert (event.kind, event.begin) == ("unusable", 7)
    assert event.why == (
        "3 boxes left out: 1 with a number that is not finite, 1 without an area, 1 after the surest 2"
    )


def test_ten_thousand_boxes_and_nothing_but_nan_do_not_end_a_run(tmp_path):
    crowd = np.zeros((1, 10_000, 6), np.float32)
    crowd[0] = [8, 8, 40, 40, 0.9, 0]
    for name, answer, words in (
        ("crowd", crowd, "29100 boxes that the detector gave were left out"),
        ("nan", np.full((1, 7, N), np.nan, np.float32), f"{3 * N} boxes that the detector gave were left out"),
    ):
        place = network(tmp_path / f"{name}.onnx", {"output0": answer})
        with pytest.warns(RuntimeWarning, match=words):
            perdure.track([np.zeros((64, 64, 3), np.uint8)] * 3, detector=f"onnx:{place}", tracker="overlap")


def truncated(path: Path) -> Path:
    whole = yolov8(path).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    return path


def said(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


WRONG = {
    "missing": (lambda folder: folder / "none.onnx", "there is no such file"),
    "folder": (lambda folder: folder, r"is a folder; name the \.onnx file in it"),
    "empty": (lambda folder: said(folder / "m.onnx", b""), r"is empty \(0 bytes\)"),
    "text": (lambda folder: said(folder / "m.onnx", b"hello, world"), "not a whole ONNX model"),
    "truncated": (lambda folder: truncated(folder / "m.onnx"), "not a whole ONNX model: the file is cut off"),
}


@pytest.mark.parametrize(
    "read", [read_embedding, lambda place: read_network("onnx", place)], ids=["embedding", "network"]
)
@pytest.mark.parametrize(("make", "words"), WRONG.values(), ids=WRONG)
def test_a_file_that_is_no_model_is_refused_in_our_words(tmp_path, read, make, words):
    with pytest.raises(FormatError, match=words) as error:
        read(make(tmp_path))
    assert str(tmp_path) in str(error.value)
    assert "ONNXRuntimeError" not in str(error.value)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((1, 64), "is not"),
        ((1, 1, 64, 64), "a picture in colour"),
        ((1, 3, 64, 9000), "wants pictures of 9000x64"),
    ],
)
def test_an_input_that_is_no_picture_is_refused(tmp_path, shape, words):
    with pytest.raises(FormatError, match=words):
        read_network("onnx", yolov8(tmp_path / "m.onnx", shape=shape))


def test_without_an_engine_the_extra_is_named(tmp_path, monkeypatch):
    for engine, module in (("onnx", "onnxruntime"), ("openvino", "openvino")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ParameterError, match=rf"pip install 'perdure\[{engine}\]'"):
            read_network(engine, tmp_path / "any")


def test_a_model_of_openvino_that_is_not_whole_is_refused(tmp_path):
    pytest.importorskip("openvino", reason="openvino is not installed")
    place = said(tmp_path / "m.xml", b"<net name='x'><layers>")
    with pytest.raises(FormatError, match=r"its weights m\.bin are not beside it"):
        read_network("openvino", place)
    said(tmp_path / "m.bin", b"0")
    with pytest.raises(FormatError, match="not a whole model of OpenVINO"):
        read_network("openvino", place)
    with pytest.raises(FormatError, match=r"is a folder; name the \.xml file"):
        read_network("openvino", tmp_path)
    with pytest.raises(FormatError, match=r"reads an \.xml file"):
        read_network("openvino", tmp_path / "m.bin")


def test_openvino_sees_what_onnxruntime_sees(tmp_path):
    pytest.importorskip("openvino", reason="openvino is not installed")
    place = red_meter(tmp_path / "m.onnx", [0, 1, 0, 0.25, 0.25, 0.5, 0.5], at=2, most=255.0, shape=(1, 3, 64, 64))
    image = np.random.default_rng(3).integers(0, 256, (48, 96, 3)).astype(np.uint8)
    one, other = (
        seen(Network(network_score=0.1, model=read_network(engine, place)), image)
        for engine in ("onnx", "openvino")
    )
    np.testing.assert_allclose(one.scores, other.scores, rtol=1e-5)
    assert one.boxes.tolist() == other.boxes.tolist()


def test_a_class_that_the_network_does_not_have_is_refused_with_the_nearest(tmp_path):
    film = [np.zeros((64, 64, 3), np.uint8)] * 2
    place = of_coco(tmp_path / "m.onnx")
    with pytest.raises(ParameterError, match="'persn' is not a class of the network; did you mean 'person'"):
        perdure.plan(film, detector=f"onnx:{place}", classes=["persn"])
    made = perdure.plan(film, detector=f"onnx:{place}", classes="bicycle")
    assert [regions.classes.tolist() for _, regions in made.seen()] == [["bicycle"]] * 2
    assert all(
        len(regions) == 0 for _, regions in perdure.plan(film, detector=f"onnx:{place}", classes="car").seen()
    )


def test_of_a_network_that_names_no_classes_only_numbers_can_be_wanted(tmp_path):
    film = [np.full((64, 64, 3), 255, np.uint8)]
    place = red_meter(tmp_path / "m.onnx", [0, 1, 0, 0.25, 0.25, 0.5, 0.5], at=2, most=255.0, shape=(1, 3, 64, 64))
    with pytest.raises(ParameterError, match="'person' is none; give --class-names FILE"):
        perdure.plan(film, detector=f"onnx:{place}", classes="person")
    by_number = perdure.plan(film, detector=f"onnx:{place}", classes="1")
    by_name = perdure.plan(film, detector=f"onnx:{place}", classes="person", class_names=["floor", "person"])
    for made, said in ((by_number, "1"), (by_name, "person")):
        assert [regions.classes.tolist() for _, regions in made.seen()] == [[said]]


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("onnx", "--detector onnx:FILE"),
        ("onnx:", "--detector onnx:FILE"),
        ("m.onnx", "give it as --detector onnx:m.onnx"),
        ("m.xml", "give it as --detector openvino:m.xml"),
        ("onnxx:m", "onnx:FILE"),
        (7, "is no detector"),
    ],
)
def test_a_word_that_means_no_detector_says_which_would(word, words):
    with pytest.raises(PerdureError, match=words):
        perdure.plan([np.zeros((64, 64, 3), np.uint8)], detector=word)
