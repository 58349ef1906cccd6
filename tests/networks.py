"""Networks drawn for tests: ONNX files that say what they are told to."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

KINDS = {"float32": TensorProto.FLOAT, "float16": TensorProto.FLOAT16, "uint8": TensorProto.UINT8}


def network(
    path: Path,
    outputs: Mapping[str, np.ndarray],
    shape: tuple[object, ...] = (1, 3, 64, 64),
    kind: str = "float32",
    metadata: Mapping[str, str] | None = None,
    declared: Mapping[str, tuple[object, ...]] | None = None,
) -> Path:
    """Write a network that answers every picture with these outputs; a side of a shape that is a word may be any."""
    nodes, told = [], []
    for name, values in outputs.items():
        nodes.append(helper.make_node("Constant", [], [name], value=numpy_helper.from_array(values)))
        shape_told = (declared or {}).get(name, values.shape)
        told.append(helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(values.dtype), shape_told))
    return written(path, nodes, helper.make_tensor_value_info("images", KINDS[kind], shape), told, metadata or {})


def red_meter(path: Path, row: list[float], at: int, most: float, shape: tuple[int, ...]) -> Path:
    """Write a network whose one row has, at a place, the mean of the first channel as a share of `most`."""
    nodes = [
        helper.make_node("Slice", ["images", "zero", "one", "axis"], ["first"]),
        helper.make_node("ReduceMean", ["first"], ["mean"], keepdims=0),
        helper.make_node("Div", ["mean", "most"], ["share"]),
        helper.make_node("Mul", ["place", "share"], ["filled"]),
        helper.make_node("Add", ["row", "filled"], ["said"]),
    ]
    place = np.zeros(len(row), np.float32)
    place[at] = 1
    shape_said = (1, 1, len(row)) if len(row) == 6 else (1, 1, 1, len(row))
    constants = {
        "zero": np.array([0]), "one": np.array([1]), "axis": np.array([1]), "most": np.float32(most),
        "place": place.reshape(shape_said), "row": np.float32(row).reshape(shape_said),
    }  # fmt: skip
    said = helper.make_tensor_value_info("said", TensorProto.FLOAT, shape_said)
    images = helper.make_tensor_value_info("images", TensorProto.FLOAT, shape)
    weights = [numpy_helper.from_array(np.asarray(values), name) for name, values in constants.items()]
    return written(path, nodes, images, [said], {}, weights)


def written(path: Path, nodes, images, outputs, metadata: Mapping[str, str], weights=()) -> Path:
    graph = helper.make_graph(nodes, "drawn", [images], outputs, list(weights))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, dict(metadata))
    onnx.save(model, str(path))
    return path


def cells(side: int) -> int:
    """Cells of a square input at strides 8, 16 and 32."""
    return sum((side // stride) ** 2 for stride in (8, 16, 32))
