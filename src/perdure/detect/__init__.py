"""Detectors: pixels in, regions out; each is a fold with a state of its own."""
