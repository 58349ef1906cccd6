"""What is drawn by hand of the place: zones and the ground plane, kept in files that `perdure track` reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.files.calibration import calibration_of_json, read_calibration, write_calibration
from perdure.files.zones import read_zones, write_zones, zones_of_json, zones_to_json
from perdure.scene.ground import Ground
from perdure.scene.zones import KINDS, Zones
from perdure.web.run import OpenRun

Json = Any
_LINES = 13  # of the grid, each way
_STEPS = 24  # points of a line


def kinds() -> dict[str, dict[str, dict[str, Json]]]:
    """Return the kinds of zones, and of each its settings with default, range and meaning."""
    return {
        kind: {
            name: {"default": one.default, "low": one.low, "high": one.high, "help": one.help}
            for name, one in settings.items()
        }
        for kind, settings in KINDS.items()
    }


def zones_file(run: OpenRun, given: Path | None) -> Path:
    """Return where a run's drawn zones are kept."""
    return run.folder.path / "zones.json" if given is None else given


def calibration_file(run: OpenRun, given: Path | None) -> Path:
    """Return where a run's drawn calibration is kept."""
    return run.folder.path / "calibration.json" if given is None else given


def read_drawn(run: OpenRun, path: Path) -> dict[str, Json]:
    """Return the zones of a file, or where there is none those of the run; with a note where they cannot be read."""
    note = ""
    if path.exists():
        try:
            return {"file": str(path), "zones": zones_to_json(read_zones(path, *run.size)), "note": ""}
        except FormatError as error:
            note = str(error)
    own = run.about.get("zones")
    try:
        zones = zones_of_json(own, *run.size) if own is not None else Zones(())
    except FormatError as error:
        zones, note = Zones(()), note or f"the zones in run.json: {error}"
    return {"file": str(path), "zones": zones_to_json(zones), "note": note}


def save_drawn(run: OpenRun, path: Path, value: Json) -> dict[str, Json]:
    """Check zones, write them into a file that appears whole, and return them as they were written.

    Raises
    ------
    FormatError
        Naming the zone or rule, and what would do.
    OutputError
        If the file cannot be written.
    """
    zones = zones_of_json(value, *run.size)
    if not zones.zones:
        raise FormatError("there is no zone to save; draw one")
    write_zones(path, zones)
    return {"file": str(path), "zones": zones_to_json(zones), "note": ""}


def read_plane(run: OpenRun, path: Path) -> dict[str, Json]:
    """Return the ground plane of a calibration file as a grid in the picture; none where there is no file."""
    if not path.exists():
        return {"file": str(path), "grid": [], "note": "", "value": None}
    try:
        return {"file": str(path), **_shown(read_calibration(path, *run.size)), "value": None}
    except FormatError as error:
        return {"file": str(path), "grid": [], "note": str(error), "value": None}


def check_plane(run: OpenRun, value: Json) -> dict[str, Json]:
    """Return the grid of a calibration that is not written yet; FormatError says what is wrong with it."""
    try:
        return _shown(calibration_of_json(value, *run.size))
    except ValueError as error:
        raise FormatError(str(error)) from None


def save_plane(run: OpenRun, path: Path, value: Json) -> dict[str, Json]:
    """Check a calibration and write it into a file that appears whole.

    Raises
    ------
    FormatError
        If it describes no ground plane.
    OutputError
        If the file cannot be written.
    """
    shown = check_plane(run, value)
    write_calibration(path, {key: one for key, one in value.items() if key not in ("format", "version")})
    return {"file": str(path), **shown, "value": None}


def _shown(ground: Ground) -> dict[str, Json]:
    """A grid of the ground as lines in the picture, each a metre, or 2, 5, 10, … from the next."""
    width, height = ground.size
    across, down = np.meshgrid(np.linspace(0, width, 9), np.linspace(0, height, 9))
    seen = ground.places(np.stack([across.ravel(), down.ravel()], 1))
    seen = seen[np.isfinite(seen).all(axis=1)]
    near = ground.places([[width / 2, height]])[0]
    if not len(seen) or not np.isfinite(near).all():
        return {"grid": [], "step": 0, "note": ""}
    extent = float(np.median(np.hypot(*(seen - near).T))) * 2
    raw = max(extent / (_LINES - 1), 1e-6)
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(power * next(one for one in (1, 2, 5, 10) if one * power >= raw - 1e-12))
    centre = np.round(np.median(seen, axis=0) / step) * step
    ticks = (np.arange(_LINES) - _LINES // 2) * step
    along = np.linspace(ticks[0], ticks[-1], _STEPS)
    lines = []
    for tick in ticks:
        for fixed in (0, 1):
            places = np.empty((_STEPS, 2))
            places[:, fixed], places[:, 1 - fixed] = centre[fixed] + tick, centre[1 - fixed] + along
            lines += _visible(ground.seen(places), width, height)
    return {"grid": lines, "step": step, "note": ""}


def _visible(points: Any, width: int, height: int) -> list[list[list[float]]]:
    """The pieces of a line (N, 2) that lie near the picture."""
    inside = np.isfinite(points).all(axis=1)
    inside &= (np.abs(points - (width / 2, height / 2)) < (2 * width, 2 * height)).all(axis=1)
    pieces = np.split(np.arange(len(points)), np.flatnonzero(np.diff(inside.astype(int))) + 1)
    return [points[one].round(1).tolist() for one in pieces if inside[one[0]] and len(one) > 1]
