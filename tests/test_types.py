"""The nouns: read-only, of equal length, finite."""

from __future__ import annotations

import numpy as np
import pytest
from format_rows import everything

from perdure.types import Frame, Mask, Regions, Scene, Status, Tracks


def some() -> Tracks:
    return Tracks.of(
        frames=[0, 0, 1, 1],
        times=[0, 0, 0.1, 0.1],
        ids=[1, 2, 1, 3],
        boxes=np.arange(16).reshape(4, 4),
        status=[Status.VISIBLE, Status.LOST, Status.OCCLUDED, Status.AMBIGUOUS],
        confidence=[1, 1, 0.3, 1],
        groups=[0, 0, 3, 0],
    )


def test_arrays_cannot_be_written_through_and_the_callers_own_stays_writable():
    mine = np.zeros((1, 4), np.float32)
    regions = Regions.of(mine)
    with pytest.raises(ValueError, match="read-only"):
        regions.boxes[0, 0] = 1
    mine[0, 0] = 5


@pytest.mark.parametrize("boxes", [[[0, 0, np.nan, 1]], [[0, 0, np.inf, 1]], [[0, 0, 1]], [0, 0, 1, 1]])
def test_boxes_that_are_no_boxes_are_refused(boxes):
    with pytest.raises(ValueError, match="boxes must be"):
        Regions.of(boxes)


def test_columns_of_different_length_are_refused():
    with pytest.raises(ValueError, match="scores has 2 rows, boxes has 1"):
        Regions.of([[0, 0, 1, 1]], scores=[1, 2])


def test_lost_rows_unsure_hidden_rows_and_groups_do_not_count():
    assert some().counted().ids.tolist() == [1]
    assert some().counted(report_confidence=0.2).ids.tolist() == [1, 1]


def test_rows_of_a_frame_or_an_id():
    assert some().in_frame(1).ids.tolist() == [1, 3]
    assert some().of_id(1).frames.tolist() == [0, 1]
    assert Tracks.join([some().in_frame(0), some().in_frame(1)]).equals(some())


def test_joining_nothing_is_empty():
    assert len(Tracks.join([])) == 0
    assert Tracks.join([Tracks.empty(), Tracks.empty()]).equals(Tracks.empty())


def test_a_mask_is_put_into_a_picture_and_cut_at_its_border():
    mask = Mask(-1, 3, np.ones((3, 4), bool))
    picture = mask.to_image(5, 5)
    assert picture.sum() == 2 * 2
    assert Mask.of_image(picture).box == (3, 0, 5, 2)


def test_visibility_is_the_share_of_the_believed_silhouette_that_is_seen():
    rows = (
        some()
        .in_frame(0)
        .replace(
            masks=(Mask(0, 0, np.ones((2, 2), bool)), Mask.empty()),
            believed=(Mask(0, 0, np.ones((4, 2), bool)), None),
        )
    )
    assert rows.visibility.tolist() == [0.5, 1.0]


def test_tracks_become_a_table():
    table = some().to_pandas()
    assert list(table["id"]) == [1, 2, 1, 3]
    assert table["status"][1] == "lost"


def test_a_frame_that_is_no_colour_picture_is_refused():
    with pytest.raises(ValueError, match="H, W, 3"):
        Frame(0, 0.0, np.zeros((4, 4), np.uint8))


def test_an_roi_of_another_size_is_refused():
    with pytest.raises(ValueError, match="the roi is 4x3, the scene 5x3"):
        Scene(5, 3, roi=np.ones((3, 4), bool))


def test_an_arrow_table_has_every_column_and_reads_back_as_the_same_tracks():
    pytest.importorskip("pyarrow")
    table = everything().to_arrow()
    assert Tracks.of_arrow(table).equals(everything())
    assert Tracks.of_arrow(Tracks.empty().to_arrow()).equals(Tracks.empty())
    assert table.column("status").to_pylist() == [
        "visible", "visible", "partly_occluded", "ambiguous", "visible", "lost",
    ]  # fmt: skip
    assert table.column("ground_x").to_pylist() == [1.5, -3.0, None, None, None, None]
    assert table.column("mask").to_pylist()[4] is None


def test_of_an_arrow_table_only_frame_id_and_box_are_needed():
    pyarrow = pytest.importorskip("pyarrow")
    columns = {"frame": [3], "id": [1], "x1": [0.5], "y1": [1.0], "x2": [2.0], "y2": [3.0]}
    assert Tracks.of_arrow(pyarrow.table(columns)).boxes.tolist() == [[0.5, 1, 2, 3]]
    with pytest.raises(ValueError, match="no column 'x2'"):
        Tracks.of_arrow(pyarrow.table({name: values for name, values in columns.items() if name != "x2"}))
