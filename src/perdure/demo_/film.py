"""The film of `perdure demo`: people on a square who pass, meet, walk together and are hidden for a while.

    world = demo_world()
    for frame in world.frames(): ...
    truth = world.truth()

What a tracker meets in it:

=====  ==============================================================================================
s      what happens
=====  ==============================================================================================
0-1    an empty square
2-8    two people (1, 2) cross in the middle; each is cut in two by the trunk of the tree
4-12   two others (3, 4) meet, stand together, and part: each goes on past the other
3-13   a couple (5, 6) walks in the shade, behind lamp, tree and kiosk: hidden wholly for a second
9-12   a cyclist (7) passes through sun and shade
10-14  a dog (8) runs behind the hedge; a woman (9) comes towards it in front of the tree
=====  ==============================================================================================
"""

from __future__ import annotations

from perdure.drawn import Occluder, Walker, Waypoint, World
from perdure.figures import Clothes

__all__ = ["Occluder", "Walker", "Waypoint", "World", "demo_world"]

_SMOOTH = 0.5


def demo_world() -> World:
    """Return the film of `perdure demo`: 15 s of 640x480 at 25 frames per second, nine walkers."""
    return World(
        width=640,
        height=480,
        fps=25.0,
        count=375,
        walkers=(*_crossing(), *_meeting(), *_couple(), *_others()),
        occluders=(
            Occluder("kiosk", 150, 292, 92, 158, (74, 104, 112)),
            Occluder("lamp", 566, 330, 7, 232, (58, 62, 66)),
            Occluder("trunk", 432, 346, 27, 236, (98, 76, 60)),
            Occluder("hedge", 84, 480, 216, 98, (70, 108, 58)),
        ),
        backdrop="square",
        horizon=40.0,
        noise=2.0,
        flicker=0.006,
        shadows=True,
        seed=7,
    )


def _person(clothes: Clothes, *path: tuple[float, float, float], tall: float = 190.0) -> Walker:
    return Walker("person", path, 0.36 * tall, tall, clothes, _SMOOTH)


def _crossing() -> tuple[Walker, ...]:
    return (
        _person(Clothes((196, 64, 52), (62, 70, 96), hair=(48, 36, 30)), (1.2, -40, 300), (9.0, 690, 304)),
        _person(
            Clothes((60, 110, 166), (186, 170, 140), (150, 104, 78), (30, 26, 26), bag=(214, 150, 56)),
            (1.6, 690, 324),
            (9.2, -50, 318),
            tall=184,
        ),
    )


def _meeting() -> tuple[Walker, ...]:
    return (
        _person(
            Clothes((236, 196, 88), (70, 62, 60), hair=(120, 84, 48)),
            (2.4, -50, 402),
            (4.6, 222, 402),
            (8.6, 224, 402),
            (12.6, 700, 396),
            tall=182,
        ),
        _person(
            Clothes((70, 128, 98), (42, 46, 58), hair=(176, 170, 164)),
            (2.2, 700, 412),
            (5.4, 272, 410),
            (8.8, 270, 410),
            (12.2, -60, 412),
            tall=194,
        ),
    )


def _couple() -> tuple[Walker, ...]:
    return (
        _person(
            Clothes((226, 224, 220), (122, 56, 86), hair=(86, 50, 34), skirt=True),
            (3.0, 670, 236),
            (13.0, -40, 236),
            tall=180,
        ),
        _person(
            Clothes((44, 60, 92), (104, 98, 92), hair=(40, 34, 32)), (3.0, 698, 242), (13.4, -40, 242), tall=196
        ),
    )


def _others() -> tuple[Walker, ...]:
    rider = Clothes((232, 122, 48), (48, 50, 60), hair=(214, 214, 210), bag=(168, 48, 52))
    coat = Clothes(top=(150, 104, 66), bottom=(196, 52, 48))
    dress = Clothes((178, 92, 140), (108, 62, 120), (124, 84, 62), (34, 28, 28), skirt=True)
    return (
        Walker("cyclist", ((8.8, -70, 270), (12.2, 720, 264)), 196, 190, rider),
        Walker("dog", ((9.8, 700, 446), (14.2, -70, 440)), 104, 66, coat),
        _person(dress, (8.6, 690, 356), (14.4, 60, 372), (14.8, -10, 374), tall=184),
    )
