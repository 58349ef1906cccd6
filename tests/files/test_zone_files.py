"""Files of zones: read, checked, written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from perdure.errors import FormatError
from perdure.files.zones import read_zones, write_zones, zones_of_json, zones_to_json
from perdure.scene.zones import Rule, Zone, Zones, rectangle

SQUARE = [[10, 10], [50, 10], [50, 40], [10, 40], [10, 10]]


def feature(kind: object = "entry", name: object = "door", ring: object = SQUARE, **more: object) -> dict:
    geometry = more.pop("geometry", {"type": "Polygon", "coordinates": [ring]})
    return {"type": "Feature", "properties": {"kind": kind, "name": name, **more}, "geometry": geometry}


def collection(*features: object, **more: object) -> dict:
    return {"type": "FeatureCollection", "features": list(features), **more}


def refused(written: object, tmp_path: Path) -> str:
    file = tmp_path / "zones.json"
    file.write_text(written if isinstance(written, str) else json.dumps(written), encoding="utf-8")
    with pytest.raises(FormatError) as caught:
        read_zones(file, 100, 60)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_written_is_read_again(tmp_path: Path):
    hole = (((0.0, 0.0), (60.0, 0.0), (60.0, 50.5), (0.0, 50.5)), ((20.0, 20.0), (30.0, 20.0), (30.0, 30.0)))
    zones = Zones(
        (
            Zone("entry", "west door", rectangle(0, 0, 20, 60), evidence=2.5),
            Zone("occlusion", "bus & co", (hole, *rectangle(70, 0, 90, 60)), patience=30),
            Zone("ground", "Straße", rectangle(0, 0, 100, 60)),
        ),
        (Rule("west door", "bus & co", 2, 8.5), Rule("west door", "*", never=True)),
        (60, 100),
    )
    write_zones(tmp_path / "zones.json", zones)
    assert read_zones(tmp_path / "zones.json", 100, 60) == zones
    assert zones_of_json(zones_to_json(zones), 100, 60) == zones


def test_a_ring_is_one_line_of_the_file(tmp_path: Path):
    write_zones(
        tmp_path / "zones.json", Zones((Zone("entry", "[1,\\n2]", rectangle(10, 10, 50, 40)),), (), (60, 100))
    )
    lines = (tmp_path / "zones.json").read_text().splitlines()
    assert sum(line.strip() == "[[10, 10], [50, 10], [50, 40], [10, 40], [10, 10]]" for line in lines) == 1
    assert read_zones(tmp_path / "zones.json").zones[0].name == "[1,\\n2]"


def test_a_file_without_a_zone_is_refused(tmp_path: Path):
    assert "holds no zone" in refused(collection(), tmp_path)


def test_a_ring_need_not_be_closed_and_foreign_properties_stay_out(tmp_path: Path):
    file = tmp_path / "zones.json"
    file.write_text(json.dumps(collection(feature(ring=SQUARE[:-1], stroke="#f00", id=7))))
    (zone,) = read_zones(file, 100, 60).zones
    assert zone == Zone("entry", "door", rectangle(10, 10, 50, 40))


def test_no_zone_is_a_value():
    assert not zones_of_json(collection())


CROSSED = [[10, 10], [50, 40], [50, 10], [10, 40]]
ZERO = [[10, 10], [50, 10], [30, 10]]
FAULTS = {
    "not JSON": ('{"type": ', "line 1: not JSON"),
    "not GeoJSON": ([1, 2], "not GeoJSON of zones"),
    "one feature": (feature(), 'wanted is {"type": "FeatureCollection"'),
    "features": ({"type": "FeatureCollection", "features": {}}, '"features" must be a list'),
    "feature": (collection(3), "zone 1 is no GeoJSON Feature"),
    "no properties": (collection({"type": "Feature"}), 'zone 1 has no "properties"'),
    "no name": (collection(feature(name="")), "zone 1 has the name ''"),
    "star": (collection(feature(name="*")), "zone 1 has the name '*'"),
    "kind": (collection(feature(), feature("entri", "two")), "zone 2 'two': 'entri' is not a kind of zone; did you mean 'entry'?"),
    "kind of no word": (collection(feature(4)), "zone 1 'door': '4' is not a kind of zone; there are: entry, exit"),
    "no kind": (collection({"type": "Feature", "properties": {"name": "door"}}), "zone 1 'door' has no kind; give it one"),
    "rules of another name": ({**collection(feature()), "rule": []}, "'rule' is not a member of a file of zones; did you mean 'rules'?"),
    "line": (collection(feature(geometry={"type": "LineString"})), "zone 1 'door': its geometry is 'LineString'; wanted is a Polygon"),
    "no geometry": (collection(feature(geometry=None)), "zone 1 'door': its geometry is nothing"),
    "no ring": (collection(feature(ring=7)), "zone 1 'door': a ring must be a list of points [x, y]"),
    "two points": (collection(feature(ring=SQUARE[:2])), "zone 1 'door': a ring has 2 different points; three"),
    "words": (collection(feature(ring=[["a", 1], [2, 3], [4, 5]])), "zone 1 'door': 'a' is not a finite number"),
    "NaN": (collection(feature(ring=[[float("nan"), 1], [2, 3], [4, 5]])), "zone 1 'door': nan is not a finite number"),
    "infinite": (collection(feature(ring=[[float("inf"), 1], [2, 3], [4, 5]])), "is not a finite number of pixels"),
    "crossed": (collection(feature(ring=CROSSED)), "zone 1 'door': its outline crosses itself at [30, 25]"),
    "flat": (collection(feature(ring=ZERO)), "zone 1 'door': "),
    "outside": (collection(feature(ring=[[10, 10], [101, 10], [50, 40]])), "zone 1 'door': its point [101, 10] lies outside the picture of 100x60; x must be 0 to 100"),
    "doubled": (collection(feature(), feature("exit")), "zones 1 and 2 have one name, 'door'"),
    "setting": (collection(feature(evidence=-1)), "zone 1 'door': evidence = -1 must be a number from 0 to 3600"),
    "nearly a setting": (collection(feature(evidense=1)), "zone 1 'door': 'evidense' is no setting of a zone; did you mean 'evidence'?"),
    "another kind's": (collection(feature(longer=2)), "zone 1 'door': longer belongs to the kinds exit, low-contrast"),
    "rules": (collection(feature(), rules={}), '"rules" must be a list'),
    "no rule": (collection(feature(), rules=["never"]), "rule 1 is no JSON object"),
    "unknown zone": (collection(feature(), rules=[{"lost_in": "dor", "found_in": "*", "never": True}]), "rule 1, lost_in: 'dor' is not a zone; did you mean 'door'?, or '*' for anywhere"),
    "no zone": (collection(feature(), rules=[{"lost_in": "door", "never": True}]), "rule 1, found_in: 'None' is not a zone"),
    "word": (collection(feature(), rules=[{"lost": "door"}]), "rule 1: 'lost' is not a word of a rule; did you mean 'lost_in'?"),
    "no time": (collection(feature(), rules=[{"lost_in": "door", "found_in": "*"}]), 'rule 1 says neither "within"'),
    "never in time": (collection(feature(), rules=[{"lost_in": "door", "found_in": "*", "never": True, "within": 3}]), "rule 1: 'never' has no times"),
    "never of no truth": (collection(feature(), rules=[{"lost_in": "door", "found_in": "*", "never": 1}]), "rule 1: never = 1 must be true or false"),
    "no time left": (collection(feature(), rules=[{"lost_in": "door", "found_in": "*", "after": 9, "within": 3}]), "rule 1: after 9 s comes later than within 3 s"),
    "for ever": (collection(feature(), rules=[{"lost_in": "door", "found_in": "*", "within": 1e9}]), "rule 1: within = 1e+09 must be a number of seconds from 0 to 3600"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_place_and_what_would_do(fault: str, tmp_path: Path):
    written, named = FAULTS[fault]
    assert named in refused(written, tmp_path)


def test_a_file_that_is_too_large_deep_or_no_text_is_refused(tmp_path: Path):
    assert "has 8 MiB; a file of zones has 8 MiB at most" in refused(" " * (8 * 2**20 + 1), tmp_path)
    assert "nested too deep" in refused("[" * 200_000, tmp_path)
    many = collection(*(feature(name=str(number)) for number in range(1001)))
    assert "1000 zones and 1000 rules at most" in refused(many, tmp_path)
    assert "10000 at most" in refused(collection(feature(ring=[[1, 2]] * 10001)), tmp_path)
    (tmp_path / "zones.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="it is not text"):
        read_zones(tmp_path / "zones.json")
    with pytest.raises(FormatError, match="cannot read"):
        read_zones(tmp_path / "none.json")


def test_without_a_size_a_zone_may_be_anywhere():
    assert zones_of_json(collection(feature(ring=[[-5, 10], [1010, 10], [50, 40]])))
