"""The detector that the user's word means: its kind, its file, its parameters, silhouettes for its boxes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from perdure import params
from perdure.detect import DETECTORS, Background, BoxMasks, Recorded
from perdure.detect.box_masks import KINDS
from perdure.detect.own import Own
from perdure.errors import FormatError, ParameterError
from perdure.files.networks import ENGINES, read_class_names, read_network
from perdure.files.regions import read_regions
from perdure.files.shapes import is_file
from perdure.params import unknown_name

AnyDetector = str | Path | Callable[[Any], Any]
OWN = "own"  # the name of a detector that is given as an object with `start` and `step`
_NAMED = ("background", "people")
_WITH_SILHOUETTES = ("background", "marked")


def detector_name(detector: AnyDetector | None) -> str:
    """Return which kind of detector the user's word, function or object means.

    Raises
    ------
    ParameterError, FormatError
        For a word that means none, or a file that is not there.
    """
    if detector is None:
        return "background"
    if not isinstance(detector, (str, Path)):
        return _name_of_object(detector)
    word = str(detector)
    engine, colon, file = word.partition(":")
    if engine in ENGINES:
        if not colon or not file:
            raise ParameterError(f"--detector {engine} needs the file of a network: --detector {engine}:FILE")
        return engine
    if word in _NAMED:
        return word
    if colon and engine.isalnum() and len(engine) > 1 and file and "://" not in word:
        raise ParameterError(
            f"--detector {word}: {unknown_name('kind of network', engine, ENGINES)} Networks are named as onnx:FILE"
        )
    ending = Path(word).suffix.lower()
    if ending in (".onnx", ".xml"):
        engine = "onnx" if ending == ".onnx" else "openvino"
        raise ParameterError(f"{word} is a network by its name; give it as --detector {engine}:{word}")
    if is_file(detector):
        return "recorded"
    if ending in (".txt", ".jsonl", ".csv"):
        raise FormatError(f"{detector}: there is no such file of detections")
    known = [*_NAMED, *(f"{engine}:FILE" for engine in ENGINES)]
    raise ParameterError(f"{params.unknown_name('detector', word, known)}, or name a file of detections")


def _name_of_object(detector: object) -> str:
    if all(callable(getattr(detector, name, None)) for name in ("start", "step")):
        return OWN
    if callable(detector):
        return "function"
    raise ParameterError(
        f"{detector!r:.60} is no detector: give a name, a file, a function of a picture, or what has start and step"
    )


def file_of(detector: object) -> Path | None:
    """Return the file that the user's word names, where it names one that is there."""
    if not isinstance(detector, (str, Path)):
        return None
    engine, _, file = str(detector).partition(":")
    word = file if engine in ENGINES and file else detector
    return Path(word) if is_file(word) else None


def kinds_of(name: str, box_masks: str | None) -> list[type[Any]]:
    """Return the classes whose parameters a run with this detector has; silhouettes may need a background model."""
    kinds = [DETECTORS[name]] if name in DETECTORS else []
    return [*kinds, Background] if box_masks == "background" and name != "background" else kinds


def made_detector(
    detector: AnyDetector | None,
    name: str,
    given: Mapping[str, object],
    class_names: str | Path | Sequence[str] | None = None,
    box_masks: str | None = None,
) -> Any:
    """Return the detector that is meant, with its parameters, its file read, and silhouettes for its boxes if wanted.

    Parameters
    ----------
    detector, name
        The user's word, function or object, and what `detector_name` says of it.
    given : mapping
        Values of parameters by name, of the classes that `kinds_of` tells.
    class_names : str, Path, sequence of str or None
        For a network, the names of its classes, or a file of them.
    box_masks : str or None
        One of `perdure.detect.box_masks.KINDS`; None: none.

    Raises
    ------
    ParameterError, FormatError
        If a file cannot be read, or what is named does not go together.
    """
    if class_names is not None and name not in ENGINES:
        raise ParameterError("--class-names goes with --detector onnx:FILE or openvino:FILE; leave it out")
    if box_masks is not None and box_masks not in KINDS:
        raise ParameterError(f"box_masks = {box_masks!r} is not known: it must be {' or '.join(KINDS)}")
    parts = [params.build(kind, _of_kind(kind, given)) for kind in kinds_of(name, box_masks)]
    made: Any = parts[0] if name in DETECTORS else _guarded(detector)
    if name == "recorded":
        made = dataclasses.replace(made, regions=read_regions(Path(str(detector))))
    elif name == "function":
        made = dataclasses.replace(made, function=detector)
    elif name in ENGINES:
        file = str(detector).partition(":")[2]
        names = read_class_names(class_names) if isinstance(class_names, (str, Path)) else tuple(class_names or ())
        size, threads = made.input_size, made.network_threads
        made = dataclasses.replace(made, model=read_network(name, file, names=names, size=size, threads=threads))
    if box_masks in (None, "none"):
        return made
    if name in _WITH_SILHOUETTES:
        raise ParameterError(f"the detector {name} gives silhouettes by itself; leave out --box-masks")
    return BoxMasks(made, parts[-1] if box_masks == "background" else None)


def inner(detector: Any) -> Any:
    """Return the detector that sees things, without what gives silhouettes to its boxes or looks at its answers."""
    seeing = detector.detector if isinstance(detector, BoxMasks) else detector
    return seeing.detector if isinstance(seeing, Own) else seeing


def _guarded(detector: object) -> object:
    """A detector of the caller's own with what looks at its answers; one of ours as it is."""
    return detector if isinstance(detector, tuple(DETECTORS.values())) else Own(detector)


def about(detector: Any, name: str) -> dict[str, Any]:
    """Return for `run.json` what a detector is: its name and parameters, its network, how silhouettes are made."""
    seeing = inner(detector)
    value: dict[str, Any] = {"name": name, "parameters": _values(seeing)}
    model = getattr(seeing, "model", None)
    if model is not None:
        layout = model.layout
        value["network"] = {
            "file": model.name,
            "layout": layout.name,
            "input": layout.fit.about(),
            "classes": list(model.known),
        }
    if isinstance(detector, BoxMasks):
        value["box_masks"] = "cut" if detector.background is None else "background"
        if detector.background is not None:
            value["parameters"] |= params.values(detector.background)
    return value


def check_classes(detector: Any, classes: Sequence[str]) -> None:
    """Refuse a wanted class that the detector cannot tell of, where it is known which it can."""
    known = getattr(inner(detector), "class_names", ())
    numbers = getattr(inner(detector), "model", None) is not None and not known
    for name in classes:
        if numbers and not name.isdecimal():
            raise ParameterError(
                f"the network does not name its classes, so that {name!r} is none; give --class-names FILE, or its number"
            )
        if known and name not in known:
            raise ParameterError(params.unknown_name("class of the network", name, known))


def recorded(detector: Any) -> Recorded | None:
    """Return the detector if it looks regions up in a file."""
    seeing = inner(detector)
    return seeing if isinstance(seeing, Recorded) else None


def _of_kind(kind: type[Any], given: Mapping[str, object]) -> dict[str, object]:
    names = {one.name for one in params.describe(kind)}
    return {name: value for name, value in given.items() if name in names}


def _values(detector: Any) -> dict[str, Any]:
    return params.values(detector) if dataclasses.is_dataclass(detector) else {}
