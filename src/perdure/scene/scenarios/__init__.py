"""Scenarios: what targets do, by rules, recognised as it happens (the interpretation of III.C and IV.D)."""

from perdure.scene.scenarios.moment import Moment
from perdure.scene.scenarios.recogniser import Recognised, Recognition, finished, recognise
from perdure.scene.scenarios.rules import Bounds, Rules, Scenario

__all__ = ["Bounds", "Moment", "Recognised", "Recognition", "Rules", "Scenario", "finished", "recognise"]
