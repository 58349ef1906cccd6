"""How a context is learnt: the parameters, and the paper's own."""

from __future__ import annotations

from dataclasses import dataclass

from perdure.params import parameter


@dataclass(frozen=True)
class Learning:
    """How a context is learnt."""

    rounds: int = parameter(30, "rounds of boosting at most", low=1, high=10_000, symbol="Z")
    similar: float = parameter(
        0.0, "least similarity of what counts as the same, for all features; 0: learnt", low=0.0, high=1.0,
        symbol="Th1",
    )  # fmt: skip
    kept: float = parameter(
        0.98, "share of the same pairs that a learnt threshold lets be linked", low=0.5, high=1.0
    )
    gap: float = parameter(
        2.0, "how far apart two things of a pair may be seen; 0: in consecutive frames", unit="s", low=0.0,
        high=60.0, symbol="T2",
    )  # fmt: skip
    gated: bool = parameter(True, "only pairs that are near enough in the picture to be linked")
    carried: float = parameter(
        1.0, "for how long back a motion is fitted that carries on the earlier thing; 0: it stays", unit="s",
        low=0.0, high=60.0,
    )  # fmt: skip
    balanced: bool = parameter(True, "same and different pairs weigh the same on the whole")
    levels: bool = parameter(True, "similarities count between those usual for different and for same pairs")
    least_weight: float = parameter(
        0.05, "a feature that would weigh less is left out, and need not be computed", low=0.0, high=0.5
    )
    least_score: float = parameter(0.0, "detections of a lower score are left out", low=0.0, high=1.0)
    ours: bool = parameter(True, "features beyond the paper's eight may be chosen too")
    most: int = parameter(100_000, "pairs that are kept, half of them same ones", low=100, high=10_000_000)


PAPER = Learning(
    similar=0.5, gap=0.0, gated=False, carried=0.0, balanced=False, levels=False, least_weight=0.0, ours=False
)
