"""How much memory this process has."""

from __future__ import annotations

from pathlib import Path


def memory() -> float | None:
    """Return the resident memory of this process in MB; None where the system does not tell."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except (ImportError, OSError, ValueError, IndexError):
        return None
    return round(pages * resource.getpagesize() / 1e6, 1)
