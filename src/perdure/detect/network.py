"""Objects as a neural network sees them, which somebody has trained to: boxes, scores and classes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.detect.layouts import Found, Layout
from perdure.detect.letterbox import Fit
from perdure.detect.plausible import MOST, MOST_HELP, centred_in, plausible, surest, told
from perdure.detect.suppression import one_each
from perdure.errors import DetectorError, ParameterError
from perdure.params import parameter
from perdure.types import Bits, Frame, Regions, Scene


@dataclass(frozen=True)
class Model:
    """A network that was read from a file (`perdure.files.networks`)."""

    name: str  # of the file
    layout: Layout
    names: tuple[str, ...]  # of the classes; empty where not known
    run: Callable[
        [NDArray[np.float32]], Sequence[NDArray[Any]]
    ]  # (H, W, 3) as the layout's fit makes it -> outputs

    @property
    def known(self) -> tuple[str, ...]:
        """The names of all classes that it may tell of; numbers where they have none, empty where it does not say."""
        return self.names or tuple(str(number) for number in range(self.layout.classes or 0))


@dataclass(frozen=True, eq=False)
class NetworkState:
    """Where something may be seen; nothing is carried along."""

    roi: Bits | None


@dataclass(frozen=True)
class Network:
    """What a network sees in each picture, the surest first; inside the picture and the roi only.

    A class is told by its name, by its number where the model names none and nobody else does.
    """

    network_score: float = parameter(0.25, "objects with a lower score are left out", low=0.0, high=1.0)
    same_object: float = parameter(
        0.45,
        "of two boxes of a class that overlap by more the surer one stays, unless the network sees to that itself",
        unit="IoU",
        low=0.0,
        high=1.0,
    )
    most_objects: int = parameter(MOST, MOST_HELP, low=1, high=100_000)
    input_size: int = parameter(
        0,
        "side of the pictures for a network that takes any size; 0: the one that its file names, else 640",
        unit="px",
        low=0,
        high=4096,
    )
    network_threads: int = parameter(
        1, "threads of the network; with more, equal bytes in every run are not promised", low=1, high=256
    )
    model: Model | None = field(default=None, repr=False, compare=False)

    needs_pixels = True

    @property
    def class_names(self) -> tuple[str, ...]:
        """What its regions' classes may be; empty where that is not known."""
        return self.model.known if self.model is not None else ()

    def start(self, scene: Scene) -> NetworkState:
        """Return the state before the first frame.

        Raises
        ------
        ParameterError
            Without a model.
        """
        if self.model is None:
            raise ParameterError("a network needs a model; name its file as --detector onnx:FILE or openvino:FILE")
        return NetworkState(scene.roi)

    def step(self, state: NetworkState, frame: Frame) -> tuple[NetworkState, Regions]:
        """Return what the network sees in one picture, and an event for boxes that cannot be.

        Raises
        ------
        DetectorError
            If the network fails, or answers something else than it did at first.
        """
        if frame.image is None or self.model is None:
            return state, Regions.empty()
        layout = self.model.layout
        try:
            found = layout.decode(self.model.run(layout.fit.fitted(frame.image)))
        except Exception as error:  # an engine's own, or of outputs that have another shape now
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise DetectorError(
                f"the network {self.model.name} failed in frame {frame.index} ({frame.time:.2f} s): {said:.200}; its outputs "
                "must keep one layout: export it with fixed sizes",
                frame.index,
            ) from error
        found = _taken(
            found, np.flatnonzero(~(found.scores < self.network_score))
        )  # what is no number stays, to be told
        sifted = plausible(found.boxes, found.scores, self.most_objects if layout.suppressed else _CANDIDATES)
        found = _in_picture(_taken(found, sifted.rows), layout.fit, *frame.image.shape[:2])
        found = _taken(found, self._one_each(found))
        reasons = dict(sifted.reasons)
        kept = surest(np.arange(len(found.boxes)), found.scores, self.most_objects)
        if len(kept) < len(found.boxes):
            reasons[f"after the surest {self.most_objects}"] = len(found.boxes) - len(kept)
        found = _taken(found, kept)
        found = _taken(found, np.flatnonzero(centred_in(found.boxes, state.roi)))
        regions = Regions.of(found.boxes, found.scores, self._named(found.kinds), data={"class_id": found.kinds})
        return state, dataclasses.replace(regions, events=told(frame.index, reasons))

    def _one_each(self, found: Found) -> NDArray[np.intp]:
        """The boxes that stay, the surest first."""
        if self.model is not None and self.model.layout.suppressed:
            return np.asarray(np.argsort(-found.scores, kind="stable"), np.intp)
        return one_each(found.boxes, found.scores, found.kinds, self.same_object)

    def _named(self, kinds: NDArray[np.int64]) -> list[str]:
        names = self.model.names if self.model is not None else ()
        return [names[kind] if 0 <= kind < len(names) else str(kind) for kind in kinds.tolist()]


_CANDIDATES = 3000  # boxes in a picture that are compared with one another


def _in_picture(found: Found, fit: Fit, height: int, width: int) -> Found:
    """What is found, in pixels of the picture (height, width), cut to it; what lies outside is left out."""
    boxes = np.clip(fit.back(found.boxes, height, width), 0, np.array([width, height, width, height], np.float32))
    inside = np.flatnonzero((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
    return _taken(found._replace(boxes=boxes), inside)


def _taken(found: Found, rows: NDArray[np.intp]) -> Found:
    return Found(found.boxes[rows], found.scores[rows], found.kinds[rows])
