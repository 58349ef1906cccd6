"""A run as the viewer has it, asked without a browser."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from web.conftest import CROSSING, FILM

from perdure.errors import ParameterError
from perdure.files.corrections import Correction, append_correction
from perdure.files.runs import RunFolder
from perdure.web.run import OpenRun


@pytest.fixture
def opened(run: RunFolder) -> Iterator[OpenRun]:
    one = OpenRun(run)
    while not one.ledger.complete:
        one.refresh()
    yield one
    one.close()


def test_what_somebody_else_corrects_is_seen(opened: OpenRun):
    assert opened.state()["corrections"] == 0
    append_correction(opened.folder.corrections, Correction("delete", (2,), 0))
    assert opened.state()["corrections"] == 1
    assert set(opened.tracks()["spans"]["id"]) == {1, 3}
    opened.folder.corrections.unlink()
    assert set(opened.tracks()["spans"]["id"]) == {1, 3}  # until it is looked at again
    opened.state()
    assert set(opened.tracks()["spans"]["id"]) == {1, 2, 3}


def test_a_cut_gets_an_id_that_nobody_has_had(opened: OpenRun):
    assert opened.correct({"do": "cut", "ids": [1, 0], "begin": 9})["done"]["ids"] == [1, 4]
    opened.correct({"do": "delete", "ids": [4], "begin": 0})
    assert opened.correct({"do": "cut", "ids": [2, 0], "begin": 9})["done"]["ids"] == [2, 5]


def test_who_is_not_there_any_more_cannot_be_corrected(opened: OpenRun):
    opened.correct({"do": "join", "ids": [3, 1], "begin": 0})
    with pytest.raises(ParameterError, match="no id 3"):
        opened.correct({"do": "delete", "ids": [3], "begin": 0})


def test_a_doubt_is_open_until_it_is_called_right_or_repaired(opened: OpenRun):
    told = opened.events()
    assert (told["doubtful"], told["open"]) == (2, 2)
    first = told["doubts"][0]
    assert (first["kind"], first["begin"], first["ids"], first["partners"]) == ("resolved", CROSSING, (1,), (2,))
    opened.correct({"do": "confirm", "ids": [1], "begin": CROSSING, "event": list(first["key"])})
    assert opened.events()["open"] == 1
    opened.correct({"do": "undo"})
    opened.correct({"do": "swap", "ids": [1, 2], "begin": CROSSING, "event": list(first["key"])})
    assert [one["looked"] for one in opened.events()["doubts"]] == ["repaired", ""]


def test_silhouettes_come_under_the_ids_that_rows_have_now(opened: OpenRun):
    before = opened.shapes(30, 31)["30"]
    opened.correct({"do": "swap", "ids": [1, 2], "begin": CROSSING})
    after = opened.shapes(30, 31)["30"]
    assert (after["1"], after["2"]) == (before["2"], before["1"])


def test_a_damaged_silhouette_is_left_out_and_the_row_stays(run: RunFolder):
    run.log.write_text(run.log.read_text().replace('"runs":[0,560]', '"runs":[0,9]'))
    one = OpenRun(run)
    one.refresh()
    assert one.ledger.damage == ""
    assert one.state()["frames"] == FILM
    assert "1" not in one.shapes(0, 1).get("0", {})
