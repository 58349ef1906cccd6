"""Mathematics that knows arrays, not videos; each function is tested against an oracle."""
