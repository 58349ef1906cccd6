"""What docs/zones.md says of the file and of the kinds is so."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from perdure.files.zones import read_zones, zones_of_json
from perdure.scene.zones import KINDS, Rule

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "zones.md").read_text(encoding="utf-8")


def test_the_example_is_read():
    (example,) = re.findall(r"```json\n(.*?)```", TEXT, re.DOTALL)
    zones = zones_of_json(json.loads(example), 640, 360)
    assert [(zone.kind, zone.name) for zone in zones.zones] == [
        ("entry", "west door"), ("exit", "east door"), ("occlusion", "bus stop"), ("noise", "trees"),
    ]  # fmt: skip
    assert (zones.zones[0].evidence, zones.zones[1].patience, zones.zones[2].patience) == (1.5, 1.0, 60.0)
    assert zones.rules == (Rule("east door", "west door", 5, 40), Rule("bus stop", "west door", never=True))


@pytest.mark.parametrize("kind", KINDS)
def test_the_table_has_every_kind_with_its_settings_and_their_defaults(kind: str):
    (row,) = [line for line in TEXT.splitlines() if line.startswith(f"| `{kind}` |")]
    told = {name: float(value) for name, value in re.findall(r"`(\w+)` \(([\d.]+)", row)}
    assert told == {name: setting.default for name, setting in KINDS[kind].items()}


def test_the_zones_of_the_bench_can_be_read():
    zones = read_zones(ROOT / "bench" / "zones" / "pets09-s2l1.json", 768, 576)
    assert {zone.kind for zone in zones.zones} == {"entry", "exit", "occlusion"}
