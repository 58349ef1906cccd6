"""The viewer: a page, served on this machine only, in which a run is seen, doubted and repaired."""
