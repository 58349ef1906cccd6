"""Detection networks in files: ONNX run by onnxruntime, and OpenVINO's own, both on the CPU."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.detect.coco import COCO
from perdure.detect.layouts import Port, recognised
from perdure.detect.letterbox import GREY
from perdure.detect.network import Model
from perdure.errors import FormatError, ParameterError
from perdure.files.lines import json_with_nan
from perdure.files.models import check_model_file, open_session

ENGINES = ("onnx", "openvino")
_USUAL = 640  # px, of a network that takes any size and names none


@dataclass(frozen=True)
class _Opened:
    """A network that an engine has taken, before anybody knows what it means."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: Mapping[str, str]
    run: Callable[[NDArray[Any]], Sequence[NDArray[Any]]]  # the one input -> all outputs


def read_network(
    engine: str, path: str | Path, *, names: Sequence[str] = (), size: int = 0, threads: int = 1
) -> Model:
    """Read a detection network, run it once, and find out what its outputs mean.

    Parameters
    ----------
    engine : str
        One of `ENGINES`.
    path : str or Path
        `.onnx`; for OpenVINO `.xml`, with the weights in `.bin` beside it.
    names : sequence of str
        Of the classes, from number 0; empty: those that the file tells, COCO's for 80 classes, else numbers.
    size : int
        Pixels of a side, for a network that takes any; 0: what the file says, else 640.
    threads : int
        Of the engine.

    Raises
    ------
    ParameterError
        If the engine is not installed, or a size is given to a network that has one.
    FormatError
        Naming the file and what is wrong with it.
    """
    place = Path(path)
    opened = (_open_onnx if engine == "onnx" else _open_openvino)(place, threads)
    port = _picture_port(place, opened)
    first = port.shape[-3] == 3  # channels before rows
    shape = _size_of(place, port.shape[-2:] if first else port.shape[-3:-1], size, opened.metadata)
    run = _runner(opened.run, port, first)
    grey = np.full((*shape, 3), GREY / 255.0 if port.kind != "uint8" else GREY, np.float32)
    try:
        answer = run(grey)
    except Exception as error:  # engines have exceptions of their own, with no root but this
        raise FormatError(f"{place}: it loads, but fails on a picture ({_short(error)})") from None
    try:
        layout = recognised(opened.outputs, answer, shape, opened.metadata, port.kind)
        told = tuple(names) or names_of(opened.metadata)
        if layout.classes is not None and told and len(told) != layout.classes:
            whose = "there are" if names else "its file gives"
            raise FormatError(f"{whose} {len(told)} names of classes, its output has {layout.classes} classes")
    except FormatError as error:
        raise FormatError(f"{place}: {error}") from None
    if not told and layout.classes == len(COCO):
        told = COCO
    return Model(place.name, layout, told, run)


def names_of(metadata: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of classes that a model's metadata tell, in the order of their numbers; none where they do not.

    Ultralytics writes a Python or JSON dictionary or list as `names`; OpenVINO has words in `labels`.
    """
    text = metadata.get("names", "")
    value: Any = metadata.get("labels", "").split()
    for read in (json_with_nan, ast.literal_eval):
        if text and len(text) <= _LONGEST:
            try:
                value = read(text)
                break
            except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
                continue
    if isinstance(value, dict):
        try:
            numbered = {int(number): name for number, name in value.items()}
        except (TypeError, ValueError):
            return ()
        value = [numbered.get(k) for k in range(len(numbered))]
    good = isinstance(value, list) and all(isinstance(name, str) and name for name in value)
    return tuple(value) if good else ()


_LONGEST = 1_000_000  # characters


def read_class_names(path: str | Path) -> tuple[str, ...]:
    """Return the names of classes in a file: one a line, the first that of number 0, or a JSON list.

    Raises
    ------
    FormatError
        Naming the file, if it cannot be read or holds no names.
    """
    place = Path(path)
    try:
        text = place.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise FormatError(f"cannot read the names of classes in {place}: {reason}") from None
    lines = [line.strip() for line in text.strip().splitlines()]
    names = names_of({"names": text}) if text.lstrip()[:1] in ("[", "{") else tuple(lines)
    if not names or not all(names):
        raise FormatError(f"{place}: wanted is the name of a class in every line, the first that of number 0")
    return names


def _picture_port(place: Path, opened: _Opened) -> Port:
    """The one input, if it takes one picture in colour."""
    there = ", ".join(map(str, opened.inputs))
    if len(opened.inputs) != 1:
        raise FormatError(f"{place}: a detector has one input, a picture; this has {len(opened.inputs)}: {there}")
    port = opened.inputs[0]
    if port.kind not in _KINDS:
        raise FormatError(f"{place}: its input {there} takes {port.kind}; known are {', '.join(_KINDS)}")
    if len(port.shape) not in (3, 4) or 3 not in (port.shape[-3], port.shape[-1]):
        raise FormatError(f"{place}: its input {there} is not (N, 3, H, W) or (N, H, W, 3), a picture in colour")
    return port


_KINDS = ("float32", "float16", "uint8")


def _size_of(
    place: Path, declared: tuple[int | None, ...], size: int, metadata: Mapping[str, str]
) -> tuple[int, int]:
    """Height and width of the pictures that a network is given."""
    fixed = [one for one in declared if one is not None and one > 0]
    if size and fixed and set(fixed) != {size}:
        raise ParameterError(
            f"input_size = {size}: {place.name} takes pictures of {declared[1] or 'any'}x{declared[0] or 'any'} only; leave it out"
        )
    told = size, size
    if not size:
        try:
            height, width = ast.literal_eval(metadata.get("imgsz", ""))
            told = int(height), int(width)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            told = _USUAL, _USUAL
    height, width = (
        one if one is not None and one > 0 else usual for one, usual in zip(declared, told, strict=True)
    )
    if not (0 < height <= _LARGEST and 0 < width <= _LARGEST):
        raise FormatError(f"{place}: it wants pictures of {width}x{height}; up to {_LARGEST}x{_LARGEST} can be")
    return height, width


_LARGEST = 8192  # px


def _runner(
    run: Callable[[NDArray[Any]], Sequence[NDArray[Any]]], port: Port, first: bool
) -> Callable[[NDArray[np.float32]], Sequence[NDArray[Any]]]:
    """What runs a network on one picture (H, W, 3); one that is made for several gets the same several times."""
    several = (port.shape[0] or 1,) if len(port.shape) == 4 else ()  # torchvision's may take one picture as it is

    def run_one(picture: NDArray[np.float32]) -> Sequence[NDArray[Any]]:
        given = picture.transpose(2, 0, 1) if first else picture
        return run(np.ascontiguousarray(np.broadcast_to(given, (*several, *given.shape)), np.dtype(port.kind)))

    return run_one


def _open_onnx(place: Path, threads: int) -> _Opened:
    session = open_session(place, threads)
    inputs, outputs = (tuple(map(_onnx_port, many)) for many in (session.get_inputs(), session.get_outputs()))
    metadata = session.get_modelmeta().custom_metadata_map

    def run(given: NDArray[Any]) -> Sequence[NDArray[Any]]:
        answer: Sequence[NDArray[Any]] = session.run(None, {inputs[0].name: given})
        return answer

    return _Opened(inputs, outputs, metadata, run)


def _onnx_port(one: Any) -> Port:
    shape = tuple(side if isinstance(side, int) and side >= 0 else None for side in one.shape)
    return Port(one.name, shape, _ONNX_KINDS.get(one.type, one.type))


_ONNX_KINDS = {"tensor(float)": "float32", "tensor(float16)": "float16", "tensor(uint8)": "uint8"}


def _open_openvino(place: Path, threads: int) -> _Opened:
    try:
        import openvino
        from openvino.frontend import FrontEndManager
    except ImportError:
        raise ParameterError(f"the model {place} needs OpenVINO; pip install 'perdure[openvino]'") from None
    check_model_file(place, ".xml")
    if place.suffix.lower() not in (".xml", ".onnx"):
        raise FormatError(
            f"{place}: OpenVINO reads an .xml file, with its weights in .bin beside it, or an .onnx file"
        )
    if place.suffix.lower() == ".xml" and not place.with_suffix(".bin").is_file():
        raise FormatError(
            f"{place}: its weights {place.with_suffix('.bin').name} are not beside it; put them there"
        )
    core = openvino.Core()
    settings = {"INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32", "NUM_STREAMS": 1}
    try:
        reader = FrontEndManager().load_by_framework(place.suffix.lower().strip(".").replace("xml", "ir"))
        model = reader.convert(reader.load(str(place)))  # each other reader would say its part of a damaged file
        compiled = core.compile_model(model, "CPU", settings)
    except Exception as error:  # RuntimeError, or whatever a part of it throws
        raise FormatError(
            f"{place}: not a whole model of OpenVINO, or not one that it can run ({_short(error)})"
        ) from None
    inputs, outputs = (tuple(map(_openvino_port, many)) for many in (compiled.inputs, compiled.outputs))
    request = compiled.create_infer_request()

    def run(given: NDArray[Any]) -> Sequence[NDArray[Any]]:
        answer = request.infer({0: given})
        return [np.array(answer[one]) for one in compiled.outputs]

    return _Opened(inputs, outputs, _openvino_metadata(model), run)


def _openvino_port(one: Any) -> Port:
    shape = tuple(side.get_length() if side.is_static else None for side in one.get_partial_shape())
    kind = {"f32": "float32", "f16": "float16", "u8": "uint8"}.get(one.get_element_type().get_type_name())
    return Port(one.get_any_name() if one.get_names() else "output", shape, kind or str(one.get_element_type()))


def _openvino_metadata(model: Any) -> Mapping[str, str]:
    """The names of the classes, where the model tells them."""
    where = ["model_info", "labels"]
    return {"labels": str(model.get_rt_info(where).astype(str))} if model.has_rt_info(where) else {}


def _short(error: Exception) -> str:
    """The last line that an engine says, which is the one about the matter."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1][:200] if lines else type(error).__name__
