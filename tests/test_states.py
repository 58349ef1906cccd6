"""Saved states: independent, versioned, and never code."""

from __future__ import annotations

import enum
import io
import json
import struct
import zipfile
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from perdure.detect import Background
from perdure.errors import StateError
from perdure.states import kind_of, layout, load, save, write


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


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Pair(Generic[T]):
    """A state around another's."""

    first: T
    also: Inner | None


def test_a_generic_state_comes_back_with_the_types_that_it_is_given():
    again = load(save(Pair(whole(), None)), Pair[Whole])
    assert (again.first.mood, again.also) == (Mood.SAD, None)
    nothing = load(save(Pair(None, Inner(np.float32([4])))), Pair[type(None)])
    assert (nothing.first, nothing.also.values.tolist()) == (None, [4])
    with pytest.raises(StateError, match="of Pair, not of Whole"):
        load(save(Pair(None, None)), Whole)


def test_a_state_written_into_a_file_has_the_bytes_of_a_saved_one():
    file = io.BytesIO()
    write(whole(), file)
    assert file.getvalue() == save(whole())


def test_what_a_detector_or_tracker_says_of_its_state_is_its_kind():
    assert kind_of(Background()).__name__ == "BackgroundState"

    class Silent:
        def start(self, scene): ...

    with pytest.raises(StateError, match="Silent does not say"):
        kind_of(Silent())


def test_another_layout_of_a_state_or_of_what_it_holds_is_told_apart():
    def kind(inner: type) -> type:
        @dataclass(frozen=True)
        class Outer:
            part: inner

        Outer.__annotations__["part"] = inner
        return Outer

    class Place(NamedTuple):
        x: int

    class Farther(NamedTuple):
        x: float

    Farther.__qualname__ = Place.__qualname__
    assert layout(kind(Place)) == layout(kind(Place)) != layout(kind(Farther))
    assert "values" in layout(Whole)
    assert "values" in layout(Pair[Whole])
    assert "values" in layout(Pair[None])  # by its other part


def packed(content: dict[str, bytes], packing: int) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", packing) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return out.getvalue()


def unpacked(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_an_archive_that_unfolds_is_refused_before_it_does():
    content = unpacked(save(whole()))
    assert load(packed(content, zipfile.ZIP_STORED), Whole).count == 3
    bomb = packed({**content, "0.npy": bytes(50_000_000)}, zipfile.ZIP_DEFLATED)
    assert len(bomb) < 100_000
    with pytest.raises(StateError, match="larger inside than outside"):
        load(bomb, Whole)


def test_entries_that_lie_over_each_other_are_refused():
    data = bytearray(packed({"state.json": b"{}" * 500, "0.npy": b"x" * 1000}, zipfile.ZIP_STORED))
    second = data.index(b"PK\1\2", data.index(b"PK\1\2") + 1)
    assert struct.unpack_from("<I", data, second + 42)[0] > 0
    for place in (second + 20, second + 24):  # sizes in the directory
        struct.pack_into("<I", data, place, 10**6)
    with pytest.raises(StateError, match="larger inside than outside"):
        load(bytes(data), Whole)


@pytest.mark.parametrize("shape", ["(1000000000000,)", "(3,)", "(-1,)", "(-2, -1)", "(1000000, 0)"])
def test_an_array_that_says_another_size_than_it_has_takes_no_room(shape: str):
    content = unpacked(save(whole()))
    array = content["0.npy"]
    ending, room = b", }", len(shape) + 3
    content["0.npy"] = array.replace((b"(2,)" + ending).ljust(room), (shape.encode() + ending).ljust(room))
    assert content["0.npy"] != array
    with pytest.raises(StateError, match="damaged"):
        load(packed(content, zipfile.ZIP_STORED), Whole)


@pytest.mark.parametrize("change", [b"'<f4L", b"('<f4", b"'|O8'"])
def test_an_array_whose_head_is_written_otherwise_than_ours_is_damage_and_nothing_else(change: bytes):
    content = unpacked(save(whole()))
    content["0.npy"] = content["0.npy"].replace(b"'<f4'", change.ljust(5)[:5])
    with pytest.raises(StateError, match="damaged"):
        load(packed(content, zipfile.ZIP_STORED), Whole)
