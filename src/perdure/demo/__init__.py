"""A drawn film with its own truth: what `perdure demo` shows, and what tests are drawn with."""

from perdure.demo.film import demo_world
from perdure.demo.world import Occluder, Walker, Waypoint, World

__all__ = ["Occluder", "Walker", "Waypoint", "World", "demo_world"]
