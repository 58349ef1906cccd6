"""Neural networks in ONNX files, run by onnxruntime on the CPU."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, ParameterError

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Model:
    """A network that makes a vector of a picture: crops (N, height, width, 3) RGB, 0 to 255, give (N, D)."""

    name: str
    height: int
    width: int
    size: int  # D
    run: Callable[[Float], Float]

    def __call__(self, crops: Float) -> Float:
        """Return the vectors (N, D) of crops (N, height, width, 3) float32."""
        return self.run(crops) if len(crops) else np.zeros((0, self.size), np.float32)


def read_embedding(path: str | Path) -> Model:
    """Read a re-identification network: one input of pictures of one size, one output of vectors.

    What follows the layout of PyTorch, (N, 3, H, W), is given RGB normalised as on ImageNet (torchreid); what follows
    that of TensorFlow, (N, H, W, 3), as OpenVINO's models do when they are converted, BGR from 0 to 255.

    Raises
    ------
    ParameterError
        If onnxruntime is not installed.
    FormatError
        Naming the file and what is wrong with it.
    """
    return _of_session(Path(path), open_session(Path(path)))


def open_session(place: Path, threads: int = 1) -> Any:
    """Open an ONNX file in onnxruntime, on the CPU; one thread makes the same sums in any process.

    Raises
    ------
    ParameterError
        If onnxruntime is not installed.
    FormatError
        Naming the file and what is wrong with it: not there, a folder, not whole, nothing that onnxruntime can run.
    """
    try:
        import onnxruntime
    except ImportError:
        raise ParameterError(f"the model {place} needs onnxruntime; pip install 'perdure[onnx]'") from None
    check_model_file(place, ".onnx")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(str(place), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has an exception for each of its codes, with no root but this
        raise FormatError(f"{place}: {_why_not(error, onnxruntime.__version__)}") from None


def check_model_file(place: Path, ending: str) -> None:
    """Refuse what is no file with something in it."""
    try:
        if place.is_dir():
            raise FormatError(f"the model {place} is a folder; name the {ending} file in it")
        if not place.is_file():
            raise FormatError(f"cannot read the model {place}: there is no such file")
        with place.open("rb") as file:
            if not file.read(1):
                raise FormatError(f"the model {place} is empty (0 bytes): the download or the copy failed")
    except (OSError, ValueError) as error:
        raise FormatError(
            f"cannot read the model {str(place)[:200]}: {getattr(error, 'strerror', error)}"
        ) from None


def _why_not(error: Exception, version: str) -> str:
    """Why onnxruntime does not take a file, in words of ours where they can be found."""
    said = str(error)
    if type(error).__name__ == "InvalidProtobuf" or "No graph was found" in said:
        return "not a whole ONNX model: the file is cut off, or of another kind"
    reason = re.sub(
        r"^\[ONNXRuntimeError\] : \d+ : \w+ : |Load model from .*? failed:", "", " ".join(said.split())
    )
    return f"onnxruntime {version} cannot run this model: {reason[:200] or type(error).__name__}"


def _of_session(place: Path, session: Any) -> Model:
    inputs, outputs = session.get_inputs(), session.get_outputs()
    if len(inputs) != 1 or len(outputs) != 1 or inputs[0].type != "tensor(float)":
        said = ", ".join(f"{one.name} {one.shape} {one.type}" for one in inputs)
        raise FormatError(f"{place}: an embedding has one input of float pictures and one output; this has {said}")
    shape, size = inputs[0].shape, outputs[0].shape[-1] if outputs[0].shape else None
    first = len(shape) == 4 and shape[1] == 3
    if not (first or (len(shape) == 4 and shape[3] == 3)):
        raise FormatError(f"{place}: its input {shape} is not (N, 3, H, W) or (N, H, W, 3)")
    height, width = (one if isinstance(one, int) and one > 0 else usual for one, usual in zip(
        shape[2:] if first else shape[1:3], _USUAL, strict=True))  # fmt: skip
    if len(outputs[0].shape) != 2 or not isinstance(size, int):
        raise FormatError(f"{place}: its output {outputs[0].shape} is not (N, D), one vector a picture")
    batch = shape[0] if isinstance(shape[0], int) and shape[0] > 0 else _MOST

    def run(crops: Float) -> Float:
        given = (crops / 255.0 - _MEAN) / _SPREAD if first else crops[..., ::-1]
        given = np.ascontiguousarray(given.transpose(0, 3, 1, 2) if first else given, np.float32)
        found = []
        for start in range(0, len(given), batch):
            part = given[start : start + batch]
            count = len(part)
            if isinstance(shape[0], int) and count < batch:  # a model for so many at once
                part = np.concatenate([part, np.zeros((batch - count, *part.shape[1:]), np.float32)])
            found.append(session.run(None, {inputs[0].name: part})[0][:count])
        return np.asarray(np.concatenate(found), np.float32)

    return Model(place.name, height, width, size, run)


_USUAL = (256, 128)  # pixels, of a model that takes any
_MOST = 16  # pictures at once
_MEAN = np.array([0.485, 0.456, 0.406], np.float32)
_SPREAD = np.array([0.229, 0.224, 0.225], np.float32)
