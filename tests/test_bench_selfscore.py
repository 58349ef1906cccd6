"""The bench of scores without truth: it ranks by what runs tell of themselves, and holds that against the truth."""

from __future__ import annotations

import math

import pytest
import selfscore
from selfscore import Told

from perdure import params
from perdure.trackers import TRACKERS


def told(whole: float, idf1: float) -> Told:
    return Told({"agreement": whole, "explained": 1 - whole, "sureness": 0.9, "whole": whole}, idf1)


def test_a_clip_whose_settings_rank_themselves_as_the_truth_does_has_correlation_1_and_the_best_is_chosen():
    row = selfscore.row_of([told(0.5, 0.6), told(0.4, 0.5), told(0.9, 0.8), told(0.7, 0.7)])
    assert row[:2] == pytest.approx([1.0, -1.0])
    assert math.isnan(row[2])  # all alike: nothing is ranked
    assert row[5:] == pytest.approx([80.0, 60.0, 65.0, 80.0])


def test_the_same_seed_draws_the_same_settings_and_all_are_allowed():
    settings = selfscore.drawn("compound", 4, seed=7)
    assert settings == selfscore.drawn("compound", 4, seed=7)
    assert settings[0] == {}
    for one in settings:
        params.check(params.build(TRACKERS["compound"], one))
