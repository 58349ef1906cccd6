"""Every format both ways: what a format holds comes back as it was, and what does not is told."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from format_rows import FPS, SIZE, at_rate, content, everything, said
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.files.formats import FORMATS, WRITTEN, Content, Format, Trait, lost, read, recognised
from perdure.types import Mask, Status, Tracks

STEP = 0.25  # a multiple of what MOT and CSV round to
WORD = {"mots": "pedestrian", "kitti": "Misc"}  # of who has no class
PLACES = itertools.count()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("formats")


def there_and_back(folder: Path, format_: Format, what: Content) -> Content:
    """Write what is to be written, and read it as what it is recognised to be."""
    path = folder / f"{next(PLACES)}{format_.suffixes[0] if format_.suffixes else ''}"
    rows = format_.write(path, what, overwrite=False)
    back = read(path, recognised(path), fps=None if what.timed and Trait.TIME in format_.holds else FPS)
    assert len(back.tracks) == rows
    return back


def fitting(tracks: Tracks, format_: Format) -> Tracks:
    """The rows without what the format does not hold, as its table says."""
    holds = format_.holds
    first = np.array([np.flatnonzero(tracks.ids == one)[0] for one in tracks.ids], int)
    changes: dict[str, object] = {}
    if Trait.STATUS not in holds:
        changes["status"] = np.zeros(len(tracks), int)
    if Trait.CONFIDENCE not in holds:
        changes["confidence"] = np.ones(len(tracks))
    elif Trait.CHANGING_CONFIDENCE not in holds:
        changes["confidence"] = tracks.confidence[first]
    if Trait.CLASS not in holds:
        changes["classes"] = np.full(len(tracks), "")
    else:
        classes = tracks.classes if Trait.CHANGING_CLASS in holds else tracks.classes[first]
        changes["classes"] = np.where(classes == "", WORD.get(format_.name, ""), classes)
    return tracks.replace(**changes)


def rows_for(format_: Format) -> st.SearchStrategy[Tracks]:
    """Rows of whose places the format loses nothing."""
    seen = Trait.BOX not in format_.holds
    classes = ("", "car", "pedestrian") if format_.classes else ("", "dog", 'a<&">\u00fc')
    return said(step=STEP if format_.rounds else None, seen=seen, classes=classes).map(
        lambda tracks: fitting(tracks, format_)
    )


@pytest.mark.parametrize("name", WRITTEN)
@settings(max_examples=30)
@given(data=st.data())
def test_what_a_format_holds_comes_back_as_it_was(folder: Path, name: str, data: st.DataObject):
    format_ = FORMATS[name]
    tracks = data.draw(rows_for(format_).filter(is_disjoint if name == "mask-png" else lambda one: True))
    if name == "geojson":  # what has no area is left out, and said to be
        tracks = tracks.take((tracks.boxes[:, :2] < tracks.boxes[:, 2:]).all(axis=1))
    back = there_and_back(folder, format_, content(tracks, frames=tuple(range(7))))
    assert back.tracks.equals(tracks)
    assert back.size in (SIZE, None)


def is_disjoint(tracks: Tracks) -> bool:
    for frame in np.unique(tracks.frames):
        pictures = [mask.to_image(*SIZE).astype(int) for mask in tracks.in_frame(frame).masks]
        if np.max(sum(pictures)) > 1:
            return False
    return True


@pytest.mark.parametrize("name", WRITTEN)
@settings(max_examples=15)
@given(data=st.data())
def test_nothing_is_told_to_be_lost_that_comes_back(folder: Path, name: str, data: st.DataObject):
    format_ = FORMATS[name]
    tracks = data.draw(rows_for(format_))
    told = {loss.what.split(" (")[0] for loss in lost(content(tracks), format_)}
    assert told <= {Trait.OVERLAP.value, *(one for one in told if one.startswith("that no class"))}


SAYS = {  # column → the traits of which one must be told if the column does not come back
    "boxes": (Trait.BOX,),
    "masks": (Trait.MASK, Trait.MASK_TOO, Trait.OVERLAP),
    "believed": (Trait.BELIEVED,),
    "outlines": (Trait.OUTLINE,),
    "classes": (Trait.CLASS, Trait.CHANGING_CLASS),
    "confidence": (Trait.CONFIDENCE, Trait.CHANGING_CONFIDENCE),
    "status": (Trait.STATUS, Trait.LOST),
    "groups": (Trait.GROUP,),
    "inferred": (Trait.INFERRED,),
    "hidden_side": (Trait.SIDE,),
    "ground": (Trait.GROUND,),
    "links": (Trait.LINKS,),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_of_rows_with_everything_exactly_what_does_not_come_back_is_told(tmp_path: Path, name: str):
    format_, before = FORMATS[name], everything()
    before = before.replace(classes=np.where(before.classes == "", "car", before.classes))
    told = {loss.what for loss in lost(content(before), format_)}
    path = tmp_path / f"a{format_.suffixes[0] if format_.suffixes else ''}"
    rows = format_.write(path, content(before), overwrite=False)
    back = read(path, recognised(path))
    here = before.take([row for row in range(len(before)) if row_of(back.tracks, before, row) is not None])
    assert len(here) == len(back.tracks) == rows
    assert rows == (4 if Trait.BOX not in format_.holds else 6)
    for column, traits in SAYS.items():
        one, other = getattr(here, column), getattr(back.tracks, column)
        same = one == other if isinstance(one, tuple) else np.array_equal(one, other)
        is_told = any(trait.value in told for trait in traits)
        if column == "outlines" and not same and not is_told:
            assert name == "csv"  # to a thousandth of a pixel
        if rows == len(before):
            assert same != is_told, f"{column}: {told}"
        else:
            assert same or is_told, f"{column}: {told}"
    times_are_back = np.allclose(back.tracks.times, here.times, atol=1e-9)
    assert times_are_back != any(one.startswith("times") for one in told)


def row_of(tracks: Tracks, other: Tracks, row: int) -> int | None:
    same = np.flatnonzero((tracks.frames == other.frames[row]) & (tracks.ids == other.ids[row]))
    return int(same[0]) if len(same) else None


def test_parquet_loses_nothing_at_all(tmp_path: Path):
    before = content(everything(), frames=(0, 1, 2, 3, 4), fps=20.0)
    assert lost(before, FORMATS["parquet"]) == []
    back = there_and_back(tmp_path, FORMATS["parquet"], before)
    assert back.tracks.equals(before.tracks)
    assert (back.size, back.frames, back.fps, back.name) == (SIZE, (0, 1, 2, 3, 4), 20.0, "yard")


@pytest.mark.parametrize("name", WRITTEN)
def test_no_rows_are_a_file_without_rows(tmp_path: Path, name: str):
    back = there_and_back(tmp_path, FORMATS[name], content(Tracks.empty(), frames=(0, 1)))
    assert len(back.tracks) == 0


@pytest.mark.parametrize("name", ["mask-png", "coco-vis", "coco-video", "parquet"])
def test_frames_without_a_row_are_frames_of_the_film(tmp_path: Path, name: str):
    tracks = at_rate(everything().take([0, 1]))
    back = there_and_back(tmp_path, FORMATS[name], content(tracks, frames=(0, 1, 2)))
    assert tuple(back.frames) == (0, 1, 2)


@pytest.mark.parametrize("name", ["coco-vis", "coco-video"])
def test_coco_keeps_the_rate_and_the_names_of_pictures(tmp_path: Path, name: str):
    images = {0: "left/7.jpg", 1: "left/8.jpg", 2: "left/9.jpg", 3: "left/10.jpg"}
    back = there_and_back(
        tmp_path, FORMATS[name], content(everything(), fps=20.0, frames=(0, 1, 2, 3), images=images)
    )
    assert (back.images, back.fps, back.name) == (images, FPS, "yard")  # as `there_and_back` asks for 25
    again = read(tmp_path / sorted(one.name for one in tmp_path.iterdir())[0], FORMATS[name])
    assert np.array_equal(again.tracks.times, everything().times)


def test_what_mot_rounds_is_off_by_half_a_hundredth_at_most_and_told(tmp_path: Path):
    tracks = Tracks.of(frames=0, times=0.0, ids=[1, 2], boxes=[[1.237, 2, 10, 20], [1.25, 2, 10, 20]])
    assert [str(one) for one in lost(content(tracks), FORMATS["mot"])] == ["boxes finer than 0.01 px (1 row)"]
    back = there_and_back(tmp_path, FORMATS["mot"], content(tracks)).tracks
    assert np.abs(back.boxes - tracks.boxes).max() <= 0.0051


def test_overlapping_silhouettes_are_told_where_a_pixel_can_have_one_id_only():
    both = Tracks.of(
        frames=0, times=0.0, ids=[1, 2, 3], boxes=[[0, 0, 2, 2], [1, 1, 3, 3], [8, 8, 9, 9]],
        masks=[Mask(0, 0, np.ones((2, 2), bool)), Mask(1, 1, np.ones((2, 2), bool)), Mask(8, 8, np.ones((1, 1), bool))],
    )  # fmt: skip
    (loss,) = lost(content(both), FORMATS["mask-png"])
    assert (loss.what, loss.rows) == (Trait.OVERLAP.value, 1)
    assert lost(content(both.replace(classes=["car"] * 3)), FORMATS["mots"]) == []


def test_a_lost_target_becomes_an_occluded_one_in_kitti(tmp_path: Path):
    tracks = Tracks.of(frames=0, times=0.0, ids=[1], boxes=[[0, 0, 5, 5]], status=[Status.LOST], classes=["car"])
    assert [one.what for one in lost(content(tracks), FORMATS["kitti"])] == [Trait.LOST.value]
    assert there_and_back(tmp_path, FORMATS["kitti"], content(tracks)).tracks.status.tolist() == [Status.OCCLUDED]
