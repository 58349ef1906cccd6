"""Numba kernels, each with a NumPy or SciPy twin of the same signature."""
