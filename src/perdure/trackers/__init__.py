"""Trackers: regions in, reports out; none imports another."""
