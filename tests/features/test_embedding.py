"""Embeddings: by a network drawn in the test, and by the real ones where they are."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from perdure.errors import FormatError, ParameterError
from perdure.features import pool
from perdure.features.embedding import Embedding
from perdure.files.models import read_embedding
from perdure.types import Frame, Regions, Scene

MODELS = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared" / "data")) / "models"
REAL = ("osnet_x0_25_msmt17.onnx", "person-reid-retail-0288.onnx")
SCENE = Scene(60, 40)


@dataclass(frozen=True)
class MeanColour:
    """A network that tells of a crop its mean colour."""

    height: int = 8
    width: int = 4
    size: int = 3

    def __call__(self, crops):
        assert crops.shape[1:] == (8, 4, 3)
        return crops.mean(axis=(1, 2))


def picture() -> Frame:
    image = np.zeros((40, 60, 3), np.uint8)
    image[:, :20], image[:, 20:40], image[:, 40:] = (200, 0, 0), (0, 200, 0), (100, 0, 0)
    return Frame(0, 0.0, image)


def test_looks_are_compared_by_direction_and_what_is_not_in_the_picture_is_not_known():
    feature = Embedding(MeanColour())
    boxes = [[0, 0, 20, 40], [20, 0, 40, 40], [40, 0, 90, 40], [-9, 0, -1, 9], [5, 5, 5, 9]]
    _, rows = feature.describe(feature.start(SCENE), picture(), Regions.of(boxes))
    assert pool.known(rows).tolist() == [True, True, True, False, False]
    one, other = rows[[0, 0, 0]], rows[[0, 1, 2]]
    np.testing.assert_allclose(feature.similarity(one, other, np.ones(3)), [1, 0, 1], atol=1e-6)
    _, blind = feature.describe({}, Frame(0, 0.0), Regions.of(boxes))
    assert not blind.any()
    assert feature.describe({}, picture(), Regions.empty())[1].shape == (0, 3)


def test_a_cosine_between_strangers_is_the_zero_of_the_scale():
    feature = Embedding(MeanColour(), strange=0.6)
    one, other = np.float32([[1, 0, 0]] * 2), np.float32([[0.8, 0.6, 0], [0.6, 0.8, 0]])
    np.testing.assert_allclose(feature.similarity(one, other, np.ones(2)), [0.5, 0], atol=1e-6)


def test_the_pool_has_an_embedding_where_a_network_is_named_only():
    assert list(pool.made(["area", "embedding"], SCENE, MeanColour())) == ["area", "embedding"]
    with pytest.raises(ParameterError, match="needs a network"):
        pool.made(["embedding"], SCENE)
    with pytest.raises(ParameterError, match="embeding"):
        pool.made(["embeding"], SCENE)


def test_without_onnxruntime_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ParameterError, match=r"perdure\[onnx\]"):
        read_embedding(tmp_path / "any.onnx")


def test_a_file_that_is_no_model_or_is_not_there_is_refused_by_name(tmp_path):
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    (tmp_path / "broken.onnx").write_bytes(b"\x08\x07\x12")
    with pytest.raises(FormatError, match=r"broken\.onnx"):
        read_embedding(tmp_path / "broken.onnx")
    with pytest.raises(FormatError, match="there is no such file"):
        read_embedding(tmp_path / "none.onnx")


@pytest.mark.parametrize("name", REAL)
def test_a_real_network_knows_a_picture_again_and_refuses_to_be_cut_off(name, tmp_path):
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    if not (MODELS / name).is_file():
        pytest.skip(f"no model {MODELS / name}; set PERDURE_DATA")
    network = read_embedding(MODELS / name)
    assert (network.height, network.width) == (256, 128)
    feature = Embedding(network)
    boxes = Regions.of([[0, 0, 20, 40], [20, 0, 40, 40], [0, 0, 20, 40]])
    _, rows = feature.describe({}, picture(), boxes)
    said = feature.similarity(rows[[0, 0]], rows[[2, 1]], np.ones(2))
    assert said[0] == pytest.approx(1.0, abs=1e-5)
    assert said[1] < 0.95
    (tmp_path / name).write_bytes((MODELS / name).read_bytes()[:-1000])
    with pytest.raises(FormatError, match="not a whole ONNX model"):
        read_embedding(tmp_path / name)


def test_a_network_that_asks_for_something_else_is_refused():
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    if not (MODELS / "yolox_nano_416.onnx").is_file():
        pytest.skip(f"no models at {MODELS}; set PERDURE_DATA")
    with pytest.raises(FormatError, match=r"is not \(N, D\)"):
        read_embedding(MODELS / "yolox_nano_416.onnx")
