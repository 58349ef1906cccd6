"""Numbers of one region or of a pair of regions."""
