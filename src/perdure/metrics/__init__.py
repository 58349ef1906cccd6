"""Tracks against tracks: numbers."""
