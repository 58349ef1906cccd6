"""Our figures are TrackEval's, on every shared sequence; what it said is recorded by `bench/parity.py --record`."""

from __future__ import annotations

import json
from pathlib import Path

import parity
import pytest

pytestmark = pytest.mark.skipif(
    not parity.DATA.is_dir(), reason=f"no sequences at {parity.DATA}; set PERDURE_DATA"
)
PEERS = parity.ENVIRONMENT / "bin/python"


@pytest.mark.parametrize("group", parity.groups(parity.DATA), ids=lambda group: group.name)
def test_every_figure_is_that_of_trackeval(group: parity.Group, tmp_path: Path):
    recorded = json.loads(parity.RECORDED.read_text())[group.name]
    assert_equal(parity.ours(parity.Job.write(group, tmp_path)), recorded)


@pytest.mark.skipif(not PEERS.exists(), reason="no environment of the peers; `python bench/peers.py` makes it")
@pytest.mark.parametrize("group", parity.groups(parity.DATA), ids=lambda group: group.name)
def test_what_is_recorded_is_what_trackeval_says(group: parity.Group, tmp_path: Path):
    job = parity.Job.write(group, tmp_path)
    said, _ = parity.trackeval(job, PEERS)
    assert_equal(said, json.loads(parity.RECORDED.read_text())[group.name])


def assert_equal(ours: dict, theirs: dict) -> None:
    assert set(ours) == set(theirs)
    for name, figures in theirs.items():
        compared = {key: ours[name][key] for key in figures if key in ours[name]}
        assert len(compared) >= 17
        assert compared == pytest.approx({key: figures[key] for key in compared}, abs=1e-6), name
