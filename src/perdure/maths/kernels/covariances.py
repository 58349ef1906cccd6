"""Covariances of what pixels look like, and how far apart two of them are (Förstner & Moonen 1999).

Descriptors of a pixel are x, y, R, G, B, and magnitude and orientation of the gradient of each channel: eleven, each
about 1 wide. A one before them makes means and counts of the same sums as products.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for, part

Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]
Float = NDArray[np.float64]
Single = NDArray[np.float32]

SIZE = 11  # descriptors
WIDE = SIZE + 1  # with the one before them
PACKED = SIZE * (SIZE + 1) // 2  # numbers of a triangle, row by row
_SMALL = float(np.finfo(np.float64).eps) ** 2
_MOST_STEPS = 30 * SIZE  # of the search for eigenvalues; two or three for each do


@kernel_for(
    given(np.uint8, 3),
    given(np.bool_, 2),
    int,
    int,
    int,
    given(np.float64),
    int,
    changed(np.float64),
    changed(np.float64, 2),
)
def add_products(
    image: Bytes, bits: Bools, top: int, left: int, step: int, box: Float, side: int, one: Float, sums: Float
) -> None:
    """Add up the products of the descriptors of a region's pixels, for each cell of its box.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture; beyond its border it goes on as at the border.
    bits : (h, w) bool
        Whether pixel (top + r step, left + c step) counts; all lie inside the picture.
    top, left, step : int
        Where the pixels are.
    box : (4,) float64
        x1, y1, x2, y2, not empty: places are parts of it.
    side : int
        Cells across and down the box.
    one : (WIDE,) float64, changed
        Scratch.
    sums : (side², WIDE²) float64, changed
        Added to; of each matrix the lower triangle only.
    """
    height, width = image.shape[0], image.shape[1]
    across, down = 1.0 / (box[2] - box[0]), 1.0 / (box[3] - box[1])
    one[0] = 1.0
    for r in range(bits.shape[0]):
        y = top + r * step
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        place = (y + 0.5 - box[1]) * down
        row = min(max(int(place * side), 0), side - 1)
        one[2] = place - 0.5
        for c in range(bits.shape[1]):
            if not bits[r, c]:
                continue
            x = left + c * step
            before, after = max(x - 1, 0), min(x + 1, width - 1)
            place = (x + 0.5 - box[0]) * across
            cell = row * side + min(max(int(place * side), 0), side - 1)
            one[1] = place - 0.5
            for k in range(3):
                one[3 + k] = image[y, x, k] * (1.0 / 255.0) - 0.5
                right = abs(float(image[y, after, k]) - float(image[y, before, k]))
                lower = abs(float(image[below, x, k]) - float(image[above, x, k]))
                one[6 + 2 * k] = np.sqrt(right * right + lower * lower) * (1.0 / 255.0)
                one[7 + 2 * k] = _turn(right, lower)
            for i in range(WIDE):
                value, begin = one[i], i * WIDE
                for j in range(i + 1):
                    sums[cell, begin + j] += value * one[j]


@part
def _turn(right: float, lower: float) -> float:
    """The angle of a gradient with the x axis, as a part of π/2, to 1e-5; 0 without one."""
    less, more = min(right, lower), max(right, lower)
    slope = less / max(more, 1.0)
    square = slope * slope
    angle = slope * (
        0.9998660 + square * (-0.3302995 + square * (0.1801410 + square * (-0.0851330 + square * 0.0208351)))
    )
    angle *= 2.0 / np.pi
    return 1.0 - angle if lower > right else angle


def add_products_twin(
    image: Bytes, bits: Bools, top: int, left: int, step: int, box: Float, side: int, one: Float, sums: Float
) -> None:
    """Do the same in NumPy: the oracle of `add_products`."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge").astype(np.float64)
    right = np.abs(padded[1:-1, 2:] - padded[1:-1, :-2])
    lower = np.abs(padded[2:, 1:-1] - padded[:-2, 1:-1])
    rows, columns = np.nonzero(bits)
    y, x = top + rows * step, left + columns * step
    places = np.stack([(x + 0.5 - box[0]) / (box[2] - box[0]), (y + 0.5 - box[1]) / (box[3] - box[1])])
    gradients = np.stack([np.hypot(right, lower) / 255.0, np.arctan2(lower, right) * 2.0 / np.pi], axis=-1)
    descriptors = np.column_stack(
        [np.ones(len(x)), *(places - 0.5), image[y, x] / 255.0 - 0.5, gradients[y, x].reshape(-1, 6)]
    )  # (n, WIDE)
    column, row = np.clip((places * side).astype(int), 0, side - 1)
    for cell in range(side * side):
        own = descriptors[row * side + column == cell]
        sums[cell] += np.tril(own.T @ own).ravel()


@kernel_for(given(np.float64, 2), int, float, float, changed(np.float64, 2), changed(np.float32, 2))
def factor(sums: Float, fewest: int, ridge: float, floor: float, room: Float, factors: Single) -> None:
    """Write the Cholesky factors of the covariances; zeros for cells of fewer pixels than `fewest`.

    Parameters
    ----------
    sums : (M, WIDE²) float64
        As `add_products` makes them.
    fewest : int
        At least 1.
    ridge, floor : float
        Added to the diagonal are `ridge` times its mean, and `floor` > 0.
    room : (SIZE, SIZE) float64, changed
        Scratch.
    factors : (M, PACKED) float32, changed
        Every element is written: lower triangles, row by row.
    """
    for m in range(len(sums)):
        count = sums[m, 0]
        if count < fewest:
            for number in range(PACKED):
                factors[m, number] = 0.0
            continue
        trace = 0.0
        for i in range(SIZE):
            for j in range(i + 1):
                product = sums[m, (i + 1) * WIDE + j + 1] / count
                room[i, j] = product - sums[m, (i + 1) * WIDE] * sums[m, (j + 1) * WIDE] / (count * count)
            trace += max(room[i, i], 0.0)
        more = ridge * trace / SIZE + floor
        number = 0
        for i in range(SIZE):
            for j in range(i + 1):
                rest = room[i, j]
                for k in range(j):
                    rest -= room[i, k] * room[j, k]
                room[i, j] = rest / room[j, j] if j < i else np.sqrt(max(rest + more, floor))
                factors[m, number] = room[i, j]
                number += 1


def factor_twin(sums: Float, fewest: int, ridge: float, floor: float, room: Float, factors: Single) -> None:
    """Do the same with LAPACK: the oracle of `factor`."""
    factors[...] = 0.0
    products = sums.reshape(-1, WIDE, WIDE)
    for m in np.flatnonzero(products[:, 0, 0] >= fewest):
        whole = np.tril(products[m]) + np.tril(products[m], -1).T
        mean = whole[0, 1:] / whole[0, 0]
        covariance = whole[1:, 1:] / whole[0, 0] - np.outer(mean, mean)
        more = ridge * np.trace(covariance) / SIZE + floor
        factors[m] = np.linalg.cholesky(covariance + more * np.eye(SIZE))[np.tril_indices(SIZE)]


@kernel_for(
    given(np.float32, 2),
    given(np.float32, 2),
    changed(np.float64, 2),
    changed(np.float64, 2),
    changed(np.float32),
)
def forstner(one: Single, other: Single, room: Float, rows: Float, distances: Single) -> None:
    """Write √Σ ln² λ, λ the generalised eigenvalues of two covariances (eq. 7); inf where one is not known.

    With A = L Lᵀ and B = K Kᵀ they are the eigenvalues of MᵀM, M = K⁻¹ L. It is made tridiagonal by reflections
    (Householder), and solved by the root-free QL iteration (Pal, Walker & Kahan).

    Parameters
    ----------
    one, other : (M, PACKED) float32
        Factors as `factor` makes them; zeros for what is not known.
    room : (2 WIDE, WIDE) float64, changed
        Scratch.
    rows : (4, WIDE) float64, changed
        Scratch.
    distances : (M,) float32, changed
        Every element is written.
    """
    for m in range(len(one)):
        if one[m, 0] <= 0.0 or other[m, 0] <= 0.0:
            distances[m] = np.inf
            continue
        _quotient(one, other, m, room)
        _tridiagonal(room, rows)
        _eigenvalues(rows)
        total = 0.0
        for k in range(SIZE):
            exponent = np.log(max(rows[0, k], _SMALL))
            total += exponent * exponent
        distances[m] = np.sqrt(total)


@part
def _quotient(one: Single, other: Single, m: int, room: Float) -> None:
    """Write M = K⁻¹ L below row WIDE of `room`, MᵀM above it."""
    begin = 0
    for i in range(SIZE):
        for j in range(WIDE):
            room[WIDE + i, j] = 0.0
            room[i, j] = 0.0
        for j in range(i + 1):
            room[WIDE + i, j] = one[m, begin + j]
        for k in range(i):
            value = np.float64(other[m, begin + k])
            for j in range(WIDE):
                room[WIDE + i, j] -= value * room[WIDE + k, j]
        value = 1.0 / other[m, begin + i]
        for j in range(WIDE):
            room[WIDE + i, j] *= value
        for k in range(i + 1):
            value = room[WIDE + i, k]
            for j in range(WIDE):
                room[k, j] += value * room[WIDE + i, j]
        begin += i + 1


@part
def _tridiagonal(room: Float, rows: Float) -> None:
    """Write the diagonal and the squares of what is beside it into rows 0 and 1, of the matrix in `room`."""
    for k in range(SIZE - 2):
        rows[0, k] = room[k, k]
        first, rest = room[k + 1, k], 0.0
        for j in range(WIDE):
            rows[2, j] = room[k, j] if j > k else 0.0
            rows[3, j] = 0.0
        for j in range(k + 2, SIZE):
            rest += rows[2, j] * rows[2, j]
        rows[1, k] = first * first + rest
        if rest == 0.0:
            continue
        norm = np.sqrt(rows[1, k])
        rows[2, k + 1] = first + norm if first > 0.0 else first - norm
        scale = 1.0 / (norm * (norm + abs(first)))
        for i in range(k + 1, SIZE):
            value = scale * rows[2, i]
            for j in range(WIDE):
                rows[3, j] += value * room[i, j]
        along = 0.0
        for j in range(k + 1, SIZE):
            along += rows[3, j] * rows[2, j]
        along *= 0.5 * scale
        for j in range(WIDE):
            rows[3, j] -= along * rows[2, j]
        for i in range(k + 1, SIZE):
            here, there = rows[2, i], rows[3, i]
            for j in range(WIDE):
                room[i, j] -= here * rows[3, j] + there * rows[2, j]
    rows[0, SIZE - 2], rows[0, SIZE - 1] = room[SIZE - 2, SIZE - 2], room[SIZE - 1, SIZE - 1]
    rows[1, SIZE - 2], rows[1, SIZE - 1] = room[SIZE - 1, SIZE - 2] ** 2, 0.0


@part
def _eigenvalues(rows: Float) -> None:
    """Write the eigenvalues of a tridiagonal matrix into row 0: LAPACK's dsterf, QL iterations only."""
    begin, steps = 0, 0
    while begin < SIZE and steps < _MOST_STEPS:
        end = begin
        while end < SIZE - 1 and rows[1, end] > _SMALL * abs(rows[0, end] * rows[0, end + 1]):
            end += 1
        if end == begin:
            begin += 1
            continue
        steps += 1
        beside = np.sqrt(rows[1, begin])
        if end == begin + 1:
            middle = 0.5 * (rows[0, begin] + rows[0, end])
            away = np.hypot(0.5 * (rows[0, begin] - rows[0, end]), beside)
            product = rows[0, begin] * rows[0, end] - rows[1, begin]
            rows[0, begin] = middle + away
            rows[0, end] = product / (middle + away)
            begin += 2
            continue
        slope = (rows[0, begin + 1] - rows[0, begin]) / (2.0 * beside)
        root = np.sqrt(slope * slope + 1.0)
        shift = rows[0, begin] - beside / (slope + root if slope >= 0.0 else slope - root)
        cosine, sine, gamma = 1.0, 0.0, rows[0, end] - shift
        square = gamma * gamma
        for i in range(end - 1, begin - 1, -1):
            off = rows[1, i]
            both = square + off
            if i != end - 1:
                rows[1, i + 1] = sine * both
            old_cosine, old_gamma = cosine, gamma
            cosine, sine = square / both, off / both
            gamma = cosine * (rows[0, i] - shift) - sine * old_gamma
            rows[0, i + 1] = old_gamma + (rows[0, i] - gamma)
            square = gamma * gamma / cosine if cosine != 0.0 else old_cosine * off
        rows[1, begin] = sine * square
        rows[0, begin] = shift + gamma


def forstner_twin(one: Single, other: Single, room: Float, rows: Float, distances: Single) -> None:
    """Do the same with LAPACK: the oracle of `forstner`."""
    from scipy.linalg import eigh

    for m, (first, second) in enumerate(zip(one, other, strict=True)):
        if first[0] <= 0 or second[0] <= 0:
            distances[m] = np.inf
            continue
        pair = []
        for packed in (first, second):
            lower = np.zeros((SIZE, SIZE))
            lower[np.tril_indices(SIZE)] = packed
            pair.append(lower @ lower.T)
        distances[m] = np.sqrt((np.log(eigh(*pair, eigvals_only=True)) ** 2).sum())
