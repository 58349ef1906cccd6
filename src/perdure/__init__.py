"""Perdure: follow every moving thing in a video."""
