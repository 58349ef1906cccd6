"""Scenarios in a file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.errors import FormatError, ParameterError
from perdure.files.scenarios import KEYS, read_rules, rules_of, rules_to_json, usual_rules
from perdure.scene.beliefs import USUAL
from perdure.scene.scenarios import Bounds, Rules, Scenario

GATE = """
[[scenario]]
name = "waits_at_the_gate"
who = "person"
zone = "gate"
pace = {below = 0.3}
lasts = 10
interesting = true
"""


def test_a_scenario_of_ones_own_is_read(tmp_path: Path):
    (tmp_path / "own.toml").write_text(GATE)
    rules = read_rules(tmp_path / "own.toml")
    own = Scenario(
        "waits_at_the_gate", who=("person",), zone=("gate",), pace=Bounds(below=0.3), lasts=10.0, interesting=True
    )
    assert rules.scenarios == (own,)
    assert rules.kinds == USUAL


def test_those_that_come_with_perdure_are_taken_along_and_may_be_replaced():
    names = [one.name for one in usual_rules().scenarios]
    assert {"enters", "leaves", "stays", "loiters", "runs", "stops", "meets", "parts", "crosses"} <= set(names)
    assert {"leaves_behind", "takes_away"} <= set(names)
    both = rules_of(
        'usual = true\n[[scenario]]\nname = "runs"\npace = {above = 9}\n[line.kerb]\npoints = [[0, 1], [9, 1]]',
        "x",
    )
    assert sorted(one.name for one in both.scenarios) == sorted(names)
    runs = next(one for one in both.scenarios if one.name == "runs")
    assert runs.pace == Bounds(above=9.0)
    assert [one.name for one in both.lines] == ["kerb"]
    assert "crosses" not in [one.name for one in rules_of("usual = true", "x").scenarios], "there is no line"


def test_classes_may_be_changed_and_added():
    rules = rules_of(
        '[class.person]\nratio = [1, 1.5, 4, inf]\n[class.forklift]\nlooks = [{ratio = [0.5, 0.7, 1.2, 1.5]}]\nlabels = ["truck"]',
        "x",
    )
    assert rules.kinds["person"].labels == USUAL["person"].labels
    assert rules.kinds["person"].looks[0]["ratio"](10.0) == 1.0
    assert rules.kinds["forklift"].labels == {"truck"}


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("[[scenario]]\nname = 3", "scenario 1: name = 3 must be a word"),
        ('[[scenario]]\npace = {below = 1}', "scenario 1: it needs a name"),
        ('[[scenario]]\nname = "a b"', r"scenario 1 \(a b\): name = 'a b' must be letters"),
        ('[[scenario]]\nname = "a"\nspede = {above = 1}', r"scenario 1 \(a\): .*'spede'.*did you mean 'speed'"),
        ('[[scenario]]\nname = "a"\non = "enter"', "did you mean 'enters'"),
        ('[[scenario]]\nname = "a"\nwho = "persn"', "did you mean 'person'"),
        ('[[scenario]]\nname = "left"', "is what trackers call an event of theirs"),
        ('[[scenario]]\nname = "a"\nafter = "a"', "cannot come after itself"),
        ('[[scenario]]\nname = "a"\npace = {beneath = 3}', "'beneath' is not a end of a range|did you mean 'below'"),
        ('[[scenario]]\nname = "a"\npace = 3', "pace = 3 must be a range, such as"),
        ('[[scenario]]\nname = "a"\npace = {above = 3, below = 2}', "above = 3 must be less than below = 2"),
        ('[[scenario]]\nname = "a"\nlasts = -1', "lasts = -1 is out of range: it must be 0 to 3600"),
        ('[[scenario]]\nname = "a"\nlasts = nan', "lasts = .* must be a number"),
        ('[[scenario]]\nname = "a"\nnear = 3', "apart = 2 must not be less than near = 3"),
        ('[[scenario]]\nname = "a"\non = "crosses"', "on = 'crosses' needs a line"),
        ('[[scenario]]\nname = "a"\non = "enters"', "on = 'enters' needs a zone"),
        ('[[scenario]]\nname = "a"\nline = "x"', "line goes with on = 'crosses'"),
        ('[[scenario]]\nname = "a"\nwith = "person"', "with goes with on = 'meets'"),
        ('[[scenario]]\nname = "a"\nafter = "b"', r"a: 'b' is not a scenario \(after\)"),
        ('[[scenario]]\nname = "a"\n[[scenario]]\nname = "a"', "two scenarios are called 'a'"),
        ('[[scenario]]\nname = "a"\ninteresting = "yes"', "interesting = 'yes' must be true or false"),
        ("[scenario]\nname = 3", r"scenario must be written \[\[scenario\]\]"),
        ("[[senario]]", "did you mean 'scenario'"),
        ("usual = 1", "usual must be true or false"),
        ("[class.cat]\nratoi = [1, 2, 3, 4]", "class cat: .*did you mean 'ratio'"),
        ("[class.cat]\nratio = [1, 2, 3]", "class cat: ratio = .* must be four numbers in order"),
        ("[class.cat]\nratio = [1, 5, 3, 7]", "class cat: a trapezoid must be four numbers in order"),
        ("[class.cat]", "class cat: a class needs a look"),
        ("[line.kerb]\npoints = [[1, 2]]", "line kerb = .* must be two points or more"),
        ("[line.kerb]\npoints = [[1, 2], [1, 2]]", "line 'kerb' has no length"),
        ("name = ", "is not TOML"),
    ],
)  # fmt: skip
def test_a_fault_names_the_scenario_and_what_would_do(text: str, wrong: str):
    with pytest.raises(FormatError, match=wrong):
        rules_of(text, "own.toml")


def test_a_file_that_is_none_is_refused(tmp_path: Path):
    with pytest.raises(FormatError, match="there is no file"):
        read_rules(tmp_path / "none.toml")
    with pytest.raises(FormatError, match="is a folder"):
        read_rules(tmp_path)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="cannot be read"):
        read_rules(tmp_path / "bytes.toml")


def test_zones_that_a_place_has_not_are_refused():
    rules = rules_of(GATE, "x")
    with pytest.raises(
        ParameterError, match="scenario waits_at_the_gate: there is no zone 'gate': no zones are given"
    ):
        rules.check_zones(())
    with pytest.raises(ParameterError, match="did you mean 'gates'"):
        rules.check_zones(("gates",))
    rules.check_zones(("gate",))


def test_rules_are_plain_values_for_run_json():
    value = json.loads(json.dumps(rules_to_json(usual_rules()), allow_nan=False))
    assert {"name": "runs", "who": ["person"]}.items() <= value["scenarios"][4].items()
    assert value["classes"] == ["animal", "group", "person", "vehicle"]


_VALUES = st.one_of(
    st.integers(-5, 5), st.floats(), st.booleans(), st.text(max_size=5), st.lists(st.integers(), max_size=3)
)


@given(st.dictionaries(st.sampled_from([*KEYS, "other"]), _VALUES, max_size=5))
def test_whatever_a_table_holds_is_read_or_refused_in_words(table: dict):
    lines = [f"{key} = {_toml(value)}" for key, value in table.items()]
    text = "\n".join(["[[scenario]]", *lines])
    if (wrong := _fault(text)) is not None:
        assert wrong.startswith("x.toml")


def _fault(text: str) -> str | None:
    """What is wrong with a text; None if it is read."""
    try:
        assert isinstance(rules_of(text, "x.toml"), Rules)
    except FormatError as error:
        return str(error)
    return None


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return {"inf": "inf", "-inf": "-inf", "nan": "nan"}.get(str(value), repr(value))
    return json.dumps(value)
