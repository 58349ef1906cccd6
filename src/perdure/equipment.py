"""What a tracker is given beside its parameters: learnt contexts, and a network that tells looks apart."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from perdure.errors import ParameterError
from perdure.features.pool import EMBEDDING
from perdure.files.contexts import library, read_context
from perdure.files.models import read_embedding
from perdure.scene.context import ON_GROUND, Context, needs_pixels
from perdure.trackers import TRACKERS
from perdure.trackers.multifeature.weights import weights_of
from perdure.types import Event

T = TypeVar("T")

AUTO, OWN = "auto", "default"
USUAL = OWN  # contexts where none is named: AUTO those that come with Perdure, OWN the tracker's own weights

AnyContext = str | Path | Context


def equipped(
    tracker: T,
    name: str,
    context: AnyContext | Sequence[AnyContext] | None = None,
    embedding: str | Path | None = None,
) -> T:
    """Return a tracker with the contexts and the network that are named; as it is, if it takes none and none is named.

    Parameters
    ----------
    tracker : dataclass
        One of `TRACKERS`.
    name : str
        Its name there.
    context : str, Path, Context, sequence of them, or None
        Files of contexts, of which the nearest to the video is in force; 'auto', those that come with Perdure; or
        'default', the tracker's own weights. None: `USUAL`, or the weights given as a parameter.
    embedding : str, Path or None
        An ONNX file of a re-identification network.

    Raises
    ------
    ParameterError, FormatError
        If the tracker takes none of it, weights are given beside a context, or a file cannot be read.
    """
    words = _words(context)
    if not _takes_contexts(type(tracker)):
        for option, there in (("--context", bool(words)), ("--embedding", embedding is not None)):
            if there:
                known = [one for one, kind in TRACKERS.items() if _takes_contexts(kind)]
                raise ParameterError(f"{option} goes with --tracker {' or '.join(known)}; {name} takes none")
        return tracker
    weights = getattr(tracker, "weights", "")
    if weights and words:
        raise ParameterError(f"weights = {weights!r} and --context both say what features weigh; leave one out")
    contexts = () if weights else _read(words or [USUAL])
    network = None if embedding is None else read_embedding(embedding)
    for what, one in _weighing(contexts, weights).items():
        if one.get(EMBEDDING, 0.0) > 0 and network is None:
            raise ParameterError(
                f"{what} an embedding, which needs a network; name its ONNX file with --embedding"
            )
    beside: dict[str, Any] = {"contexts": contexts, "network": network}
    return dataclasses.replace(tracker, **beside)  # type: ignore[type-var]


def check_looks(tracker: object, source: str) -> None:
    """Refuse weights on looks alone, for a source that has no pictures."""
    contexts, weights = getattr(tracker, "contexts", ()), getattr(tracker, "weights", "")
    if len(contexts) > 1:
        return  # the nearest is chosen, and one that can be used is nearer
    for what, one in _weighing(contexts, weights).items():
        if all(needs_pixels(feature) for feature, weight in one.items() if weight > 0):
            raise ParameterError(f"{what} looks alone, and {source} has no images; weigh displacement_2d, too")


def notes(tracker: object, given: Sequence[str], *, pictures: bool, ground: bool) -> tuple[str, ...]:
    """Return what the user should know of the contexts that he named and of a network, with a source as it is."""
    found = []
    weights = getattr(tracker, "weights", "")
    contexts = getattr(tracker, "contexts", ()) if set(given) - {AUTO, OWN} else ()
    for who, used in _weighing(contexts, weights).items():
        features = [feature for feature, weight in used.items() if weight > 0]
        looks = [] if pictures else [feature for feature in features if needs_pixels(feature)]
        metres = [] if ground else [feature for feature in features if feature == ON_GROUND]
        for without, what in ((looks, "pictures, which the source has not"), (metres, "a known ground plane")):
            if without:
                found.append(f"{who} {', '.join(without)}: nothing without {what}")
    if getattr(tracker, "network", None) is not None and not pictures:
        found.append("the source has no images; the embedding tells nothing")
    return tuple(found)


def words_of(context: AnyContext | Sequence[AnyContext] | None) -> tuple[str, ...]:
    """Return which contexts were named, in words."""
    return tuple(one.name if isinstance(one, Context) else str(one) for one in _words(context))


def about(tracker: object, given: Sequence[str], name: str = "") -> dict[str, Any]:
    """Return for `run.json` which contexts a tracker has to choose from, and which of them, by name, is in force."""
    if not _takes_contexts(type(tracker)):
        return {}
    chosen: Context = tracker.in_force(name)  # type: ignore[attr-defined]
    value = {
        "given": list(given),
        "of": [one.name for one in tracker.contexts],  # type: ignore[attr-defined]
        "chosen": chosen.name,
        "weights": dict(chosen.weights),
        "similar": chosen.similar,
    }
    return {"context": value}


def chosen_by(tracker: object, event: Event) -> str:
    """Return the name of the context that an event says is in force from now on; empty for another event."""
    contexts: Iterable[Context] = getattr(tracker, "contexts", ())
    named = [one.name for one in contexts if event.kind == "context" and event.why.startswith(f"{one.name}: ")]
    return max(named, key=len, default="")


def _takes_contexts(kind: type) -> bool:
    return any(one.name == "contexts" for one in dataclasses.fields(kind))


def _words(context: AnyContext | Sequence[AnyContext] | None) -> list[AnyContext]:
    if context is None:
        return []
    return [context] if isinstance(context, (str, Path, Context)) else list(context)


def _read(words: Sequence[AnyContext]) -> tuple[Context, ...]:
    found: dict[str, tuple[Context, str]] = {}
    for word in words:
        if word == OWN and len(words) > 1:
            raise ParameterError(f"--context {OWN} are the tracker's own weights; leave out the other --context")
        for one in _contexts(word):
            if one.name in found and found[one.name][0] != one:
                raise ParameterError(
                    f"{found[one.name][1]} and {_place(word)} both hold a context {one.name!r}; change the name in one"
                )
            found[one.name] = (one, _place(word))
    return tuple(one for one, _ in found.values())


def _contexts(word: AnyContext) -> tuple[Context, ...]:
    if isinstance(word, Context):
        return (word,)
    if word == AUTO:
        return library()
    return () if word == OWN else (read_context(word),)


def _place(word: AnyContext) -> str:
    return "one that is given" if isinstance(word, Context) else "the library" if word == AUTO else str(word)


def _weighing(contexts: Sequence[Context], weights: str) -> dict[str, Mapping[str, float]]:
    """Weights, by who says them."""
    given: dict[str, Mapping[str, float]] = (
        {f"weights = {weights!r} weigh": weights_of(weights)} if weights else {}
    )
    return given | {f"the context {one.name} weighs": one.weights for one in contexts}
