"""A context goes into a file and comes out of it; a file that is none is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from perdure.errors import FormatError, OutputError
from perdure.files.contexts import context_of_json, context_to_json, library, read_context, write_context
from perdure.scene.context import Alone, Context, Training
from perdure.scene.measuring import Measures

STREET = Context(
    "street",
    {"displacement_2d": 0.75, "area": 0.25},
    0.625,
    {"area": (0.5, 0.875)},
    Measures(objects=9.5, cover=0.25, occlusion=0.5, depth=1.25, fps=30.0),
    Training(
        ("street.mp4",), 120, 360, 0.96875, ("few pairs",), {"rounds": 9, "most": 3.5, "pairs": "window"},
        {"area": Alone(0.75, 0.5, 0.25, 2, 1.0)},
    ),
)  # fmt: skip


def test_what_is_written_is_read_again(tmp_path: Path):
    write_context(tmp_path / "street.json", STREET)
    assert read_context(tmp_path / "street.json") == STREET
    assert [one.name for one in tmp_path.iterdir()] == ["street.json"]


def test_a_context_needs_no_more_than_a_name_weights_and_a_threshold():
    given = {"format": "perdure-context", "version": 1, "name": "x", "weights": {"area": 1}, "similar": 0.5}
    assert context_of_json(given) == Context("x", {"area": 1.0})


def changed(**changes) -> str:
    return json.dumps(
        {key: value for key, value in {**context_to_json(STREET), **changes}.items() if value != "-"}
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "line 1: not JSON"),
        ("[]", "must be a JSON object"),
        ("{}", "it is no context"),
        ('{"format": "perdure-context"}', "it has version nothing"),
        (changed(version=2), "it has version 2, this Perdure reads version 1; learn it anew"),
        (changed(weights={"colour": 1.0}), "'colour' is not a feature; there are"),
        (changed(weights={"area": -0.5}), "the weight of area is -0.5; it must be a number ≥ 0"),
        (changed(weights={"area": float("nan")}), "weights, area = nan must be a finite number"),
        (changed(weights={"area": "much"}), "weights, area = 'much' must be a finite number"),
        (changed(weights={"area": 0, "shape_ratio": 0.0}), "all weights are 0; one at least"),
        (changed(weights="-"), '"weights" is missing; learn it anew'),
        (changed(similar="-"), '"similar" is missing'),
        (changed(similar=2), "similar = 2 is out of range"),
        (changed(similar=True), "similar = true must be a finite number"),
        (changed(name=" "), "must be a word or more"),
        (changed(weigths={}), "did you mean 'weights'"),
        (changed(levels={"area": [0.5]}), "levels, area must be two numbers"),
        (changed(levels={"area": [0.8, 0.5]}), "they must rise"),
        (changed(levels=[]), "levels must be a JSON object"),
        (changed(measures={"objects": -1}), "objects = -1 is out of range: it must be at least 0"),
        (changed(measures={"pictures": 1}), "pictures = 1 must be true or false"),
        (changed(measures={"density": 1}), "is not a measure"),
        (changed(training={"same": 1.5}), "same = 1.5 must be a whole number"),
        (changed(training={"sources": "a"}), "sources must be a list of words"),
        (changed(training={"options": {"rounds": []}}), "options, rounds = a list must be"),
        (changed(training={"alone": {"area": {"error": 0.1}}}), 'alone, area has no "separation"'),
    ],
)
def test_a_file_that_is_no_context_is_refused_with_a_remedy(tmp_path: Path, text: str, words: str):
    path = tmp_path / "street.json"
    path.write_text(text)
    with pytest.raises(FormatError) as refused:
        read_context(path)
    assert words in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_or_not_text_is_refused(tmp_path: Path):
    with pytest.raises(FormatError, match="cannot read the context"):
        read_context(tmp_path / "none.json")
    (tmp_path / "odd.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="it is not text"):
        read_context(tmp_path / "odd.json")


def test_nothing_is_half_written(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        write_context(tmp_path / "file" / "street.json", STREET)


def test_the_library_can_be_read_and_its_names_are_those_of_its_files():
    contexts = library()
    assert len({one.name for one in contexts}) == len(contexts)
    assert all(one.training.same and one.training.different for one in contexts)
