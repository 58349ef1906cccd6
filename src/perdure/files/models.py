"""Neural networks in ONNX files, run by onnxruntime on the CPU."""

from __future__ import annotations

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
    place = Path(path)
    try:
        import onnxruntime
    except ImportError:
        raise ParameterError(f"the model {place} needs onnxruntime; pip install 'perdure[onnx]'") from None
    if not place.is_file():
        raise FormatError(f"cannot read the model {place}: there is no such file")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # the same sums in any process
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(place), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has an exception for each of its codes, with no root but this
        reason = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise FormatError(f"{place}: not a whole ONNX model ({reason})") from None
    return _of_session(place, session)


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
