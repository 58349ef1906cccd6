"""The bench of learnt contexts: what is learnt from drawn pairs tells them apart better than equal weights."""

from __future__ import annotations

import contexts
import numpy as np

from perdure.features.pool import POOL
from perdure.learn import Samples


def drawn(seed: int) -> Samples:
    """Pairs that displacement and area tell apart, and nothing else."""
    rng, names = np.random.default_rng(seed), list(POOL)
    labels = np.where(rng.random(300) < 0.5, 1, -1).astype(np.int8)
    similarities = rng.random((300, len(names)))
    for name in ("displacement_2d", "area"):
        similarities[:, names.index(name)] = np.clip(rng.normal(0.5 + 0.15 * labels, 0.2), 0, 1)
    return Samples(similarities, np.ones(similarities.shape, bool), labels, np.ones(300))


def test_every_way_makes_a_context_and_learning_beats_equal_weights_and_displacement():
    train, test = drawn(1), drawn(2)
    found = {way: contexts.tested(make(train), test) for way, make in contexts.WAYS.items()}
    assert found["learnt"] < found["equal"] - 2.0
    assert found["learnt"] < found["displacement"] - 2.0


def test_equal_weights_are_those_of_what_is_known():
    samples = drawn(1)
    known = samples.known.copy()
    known[:, list(POOL).index("hog")] = False
    context = contexts.alike(Samples(samples.similarities, known, samples.labels, samples.weights))
    assert set(context.weights) == set(POOL) - {"hog"}
