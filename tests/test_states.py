"""Saved states: independent, versioned, and never code."""

from __future__ import annotations

import enum
import io
import json
import zipfile
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from perdure.errors import StateError
from perdure.states import load, save


class Mood(enum.Enum):
    GLAD = "glad"
    SAD = "sad"


@dataclass(frozen=True, eq=False)
class Inner:
    values: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Whole:
    count: int
    share: float
    name: str
    mood: Mood
    size: tuple[int, int]
    parts: tuple[Inner, ...]
    table: dict[int, float]
    roi: NDArray[np.bool_] | None
    flag: bool


@dataclass(frozen=True)
class Other:
    count: int


def whole() -> Whole:
    return Whole(
        3,
        0.1,
        "ä",
        Mood.SAD,
        (4, 5),
        (Inner(np.float32([1, 2])), Inner(np.zeros(0, np.float32))),
        {7: 0.5},
        None,
        True,
    )


def test_everything_a_state_may_hold_comes_back():
    again = load(save(whole()), Whole)
    assert (again.count, again.share, again.name, again.mood, again.size) == (3, 0.1, "ä", Mood.SAD, (4, 5))
    assert [part.values.tolist() for part in again.parts] == [[1, 2], []]
    assert (again.table, again.roi, again.flag) == ({7: 0.5}, None, True)
    assert again.parts[0].values.dtype == np.float32


def test_what_is_loaded_shares_nothing_and_may_be_written_to():
    first = whole()
    again = load(save(first), Whole)
    again.parts[0].values[0] = 99
    assert first.parts[0].values[0] == 1


def test_another_kind_of_state_is_refused():
    with pytest.raises(StateError, match="of Whole, not of Other"):
        load(save(whole()), Other)


def test_another_version_is_refused():
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr(
            "state.json", json.dumps({"format": "perdure-state", "version": 99, "kind": "Other", "tree": {}})
        )
    with pytest.raises(StateError, match="version 99"):
        load(out.getvalue(), Other)


def test_damaged_bytes_are_refused_at_every_cut():
    data = save(whole())
    for cut in range(0, len(data), 7):
        with pytest.raises(StateError):
            load(data[:cut], Whole)


def test_a_pickle_in_disguise_is_not_opened():
    boxed = io.BytesIO()
    np.save(boxed, np.array([{"anything": 1}], dtype=object), allow_pickle=True)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(save(whole()))) as good, zipfile.ZipFile(out, "w") as bad:
        for name in good.namelist():
            bad.writestr(name, boxed.getvalue() if name == "0.npy" else good.read(name))
    with pytest.raises(StateError):
        load(out.getvalue(), Whole)


def test_code_cannot_be_saved():
    @dataclass(frozen=True)
    class WithCode:
        work: object

    with pytest.raises(StateError, match="function"):
        save(WithCode(lambda: None))


def test_bytes_changed_anywhere_are_refused_or_harmless():
    rng = np.random.default_rng(5)
    data = save(whole())
    for _ in range(300):
        bad = bytearray(data)
        bad[rng.integers(len(bad))] ^= int(rng.integers(1, 256))
        try:
            assert isinstance(load(bytes(bad), Whole), Whole)
        except StateError:
            continue
