"""The calibration file: JSON that says where the ground plane lies; docs/ground.md has the forms and an example of each."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.files.lines import json_with_nan, why_not_json
from perdure.files.whole import whole_file
from perdure.params import unknown_name
from perdure.scene.ground import PIXEL, Ground, Unusable, of_camera, of_homography, of_projection
from perdure.scene.lens import Lens
from perdure.scene.perspective import Estimate
from perdure.scene.points import of_distances, of_points

FORMAT, VERSION = "perdure-calibration", 1
Json = Any
_FORMS = ("homography", "camera", "points")
_COMMON = ("format", "version", "frame", "note", "body")
_KEYS = {
    "homography": ("homography", "on_ground", "mirrored", "covariance"),
    "camera": ("camera", "covariance"),
    "points": ("points", "distances", "noise", "tape", "mirrored"),
}
_CAMERA = ("focal", "centre", "distortion", "height", "tilt_degrees", "roll_degrees", "rotation", "translation")
_BEND = ("k1", "k2", "p1", "p2", "k3")


def read_calibration(path: str | Path, width: int, height: int) -> Ground:
    """Read a calibration file for pictures of a size.

    Raises
    ------
    FormatError
        Naming the file, what is wrong, and what would do.
    """
    place = Path(path)
    try:
        value = json_with_nan(place.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FormatError(f"cannot read the calibration {place}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        line = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise FormatError(f"{place}{line}: not JSON ({why_not_json(error)})") from None
    try:
        return calibration_of_json(value, width, height)
    except ValueError as error:
        raise FormatError(f"{place}: {error}") from None


def calibration_of_json(value: Json, width: int, height: int) -> Ground:
    """Return the ground that a calibration file's value describes; ValueError says what is wrong with it."""
    given = _object(value, "a calibration")
    form = _form(given)
    _refuse_unknown(given, (*_COMMON, *_KEYS[form]), f"key of a calibration by {form}")
    if given.get("format", FORMAT) != FORMAT or given.get("version", VERSION) != VERSION:
        raise ValueError(f'the format must be "{FORMAT}" and the version {VERSION}; leave both out or mend them')
    size = _frame(given, width, height)
    ground = _READERS[form](given, size)
    body = _number(given["body"], "body", low=0.0) if "body" in given else 0.0
    return ground if not body else dataclasses.replace(ground, body=body)


def value_of(told: Estimate, size: tuple[int, int]) -> dict[str, Json]:
    """Return the value of a calibration file that says what was estimated."""
    return {
        "frame": list(size),
        "camera": {
            "focal": round(told.focal, 3),
            "height": round(told.height, 4),
            "tilt_degrees": round(math.degrees(told.tilt), 5),
            "roll_degrees": round(math.degrees(told.roll), 5),
        },
        "covariance": [[float(f"{one:.6g}") for one in row] for row in told.covariance],
        "body": told.body,
        "note": f"estimated from {told.people} people seen whole {told.rows} times; heights scatter by "
        f"{100 * told.scatter:.1f} %",
    }


def write_calibration(path: Path, value: Mapping[str, Json]) -> None:
    """Write a calibration's value, checked before by `calibration_of_json`."""
    with whole_file(path) as file:
        json.dump({"format": FORMAT, "version": VERSION, **value}, file, indent=2)
        file.write("\n")


def _form(given: Mapping[str, Json]) -> str:
    there = [form for form in _FORMS if form in given]
    if len(there) != 1:
        what = f"holds {' and '.join(there)}" if there else "holds none of them"
        unknown = [
            key for key in given if key not in {*_COMMON, *(one for keys in _KEYS.values() for one in keys)}
        ]
        hint = f"; {unknown_name('key of a calibration', unknown[0], _FORMS)}" if unknown else ""
        raise ValueError(f"a calibration has one of {', '.join(map(repr, _FORMS))}; this one {what}{hint}")
    return there[0]


def _frame(given: Mapping[str, Json], width: int, height: int) -> tuple[int, int]:
    if "frame" not in given:
        raise ValueError(
            f'"frame" is missing: the size of the pictures it was made for, such as [{width}, {height}]'
        )
    size = _vector(given["frame"], "frame", 2)
    if tuple(size) != (width, height):
        raise ValueError(
            f"it is for pictures of {size[0]:g}x{size[1]:g}, the source has {width}x{height}; "
            "calibrate anew with pictures of that size"
        )
    return width, height


def _of_homography(given: Mapping[str, Json], size: tuple[int, int]) -> Ground:
    on_ground = _pair(given["on_ground"], "on_ground") if "on_ground" in given else None
    spread = _matrix(given["covariance"], "covariance", 9, 9) if "covariance" in given else None
    ground = of_homography(
        _matrix(given["homography"], "homography", 3, 3),
        size,
        on_ground=on_ground,
        covariance=spread,
    )
    if ground.mirrored != _flag(given, "mirrored"):
        raise Unusable(
            'the homography is not mirrored; leave out "mirrored"'
            if not ground.mirrored
            else "seen from above the metres run the other way round than in the picture: exchange the first two rows, "
            'or, if they are meant so (a plan whose Y points down), add "mirrored": true'
        )
    return ground


def _of_camera(given: Mapping[str, Json], size: tuple[int, int]) -> Ground:
    camera = _object(given["camera"], "camera")
    _refuse_unknown(camera, _CAMERA, "key of a camera")
    lens = _lens(camera, size)
    by_angles, by_pose = ("height", "tilt_degrees"), ("rotation", "translation")
    if all(key in camera for key in by_pose) and not any(key in camera for key in (*by_angles, "roll_degrees")):
        if "covariance" in given:
            raise ValueError('"covariance" goes with height and tilt_degrees; leave it out')
        return _of_pose(camera, lens, size)
    if any(key in camera for key in by_pose) or not all(key in camera for key in by_angles):
        raise ValueError(
            'a camera stands by "height" and "tilt_degrees" (and "roll_degrees"), or by "rotation" and "translation"'
        )
    tilt = _number(camera["tilt_degrees"], "tilt_degrees", low=-45.0, high=90.0)
    roll = _number(camera.get("roll_degrees", 0.0), "roll_degrees", low=-180.0, high=180.0)
    spread = _matrix(given["covariance"], "covariance", 4, 4) if "covariance" in given else None
    height = _number(camera["height"], "height", low=1e-6)
    return of_camera(lens, height, math.radians(tilt), math.radians(roll), size, covariance=spread)


def _of_pose(camera: Mapping[str, Json], lens: Lens, size: tuple[int, int]) -> Ground:
    turn = _rotation(camera["rotation"])
    moved = np.array(_vector(camera["translation"], "translation", 3))
    centre = -turn.T @ moved
    if abs(centre[2]) < 1e-9:
        raise ValueError(
            "the camera lies in the ground (Z = 0); check translation, which is that of the world, not of the camera"
        )
    ground = of_projection(lens.matrix @ np.c_[turn, moved], size, None if lens.straight else lens)
    if centre[2] > 0:
        return ground
    return dataclasses.replace(ground, vertical=-ground.vertical)  # Z points into the ground


def _rotation(value: Json) -> Any:
    if isinstance(value, list) and len(value) == 3 and not isinstance(value[0], list):
        axis = np.array(_vector(value, "rotation", 3))
        angle = float(np.linalg.norm(axis))
        x, y, z = axis / angle if angle > 0 else axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    turn = _matrix(value, "rotation", 3, 3)
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0:
        raise ValueError("rotation is no rotation: its rows must have length 1, right angles, and no mirroring")
    return turn


def _lens(camera: Mapping[str, Json], size: tuple[int, int]) -> Lens:
    if "focal" not in camera:
        raise ValueError('"focal" is missing: the focal length in pixels, one number or [along x, along y]')
    value = camera["focal"]
    focal = _vector(value, "focal", 2) if isinstance(value, list) else [_number(value, "focal")] * 2
    if min(focal) <= 0:
        raise ValueError(f"focal = {value} must be above 0 pixels")
    centre = _vector(camera["centre"], "centre", 2) if "centre" in camera else [size[0] / 2, size[1] / 2]
    if not (0 <= centre[0] <= size[0] and 0 <= centre[1] <= size[1]):
        raise ValueError(
            f"centre = [{centre[0]:g}, {centre[1]:g}] lies outside the picture of {size[0]}x{size[1]}; it is where the "
            "camera looks straight ahead, in pixels of this picture, and near its middle"
        )
    bend = camera.get("distortion", {})
    if isinstance(bend, list):
        if not 1 <= len(bend) <= 5:
            raise ValueError("distortion has one to five numbers: k1, k2, p1, p2, k3")
        bend = dict(zip(_BEND, bend, strict=False))
    _refuse_unknown(_object(bend, "distortion"), _BEND, "key of a distortion")
    terms = [_number(bend.get(name, 0.0), name) for name in _BEND]
    return Lens(np.array(focal), np.array(centre), np.array(terms))


def _of_points(given: Mapping[str, Json], size: tuple[int, int]) -> Ground:
    rows = given["points"]
    if not isinstance(rows, list):
        raise ValueError('points must be a list such as [{"image": [100, 400], "ground": [0, 0]}, …]')
    noise = _number(given.get("noise", PIXEL), "noise", low=1e-6)
    if "distances" in given:
        return _of_distances(given, rows, noise, size)
    image: list[list[float]] = []
    places: list[list[float]] = []
    for number, row in enumerate(rows, 1):
        one = _object(row, f"point {number}")
        _refuse_unknown(one, ("image", "ground", "name"), f"key of point {number}")
        for key, found, what in (("image", image, "in pixels"), ("ground", places, "in metres")):
            if key not in one:
                raise ValueError(f'point {number} has no "{key}", its place [x, y] {what}; or give "distances"')
            found.append(_vector(one[key], f"point {number}, {key}", 2))
        _check_inside(image[-1], number, size)
    if "tape" in given:
        raise ValueError('"tape" goes with "distances"; leave it out')
    return of_points(image, places, size, noise=noise, mirrored=_flag(given, "mirrored"))


def _of_distances(given: Mapping[str, Json], rows: list[Json], noise: float, size: tuple[int, int]) -> Ground:
    if "mirrored" in given:
        raise ValueError('distances have no side; leave out "mirrored"')
    names: list[str] = []
    image = []
    for number, row in enumerate(rows, 1):
        one = _object(row, f"point {number}")
        _refuse_unknown(one, ("image", "name"), f"key of point {number} beside distances")
        if "image" not in one or not isinstance(one.get("name"), str) or one["name"] in names:
            raise ValueError(f'point {number} must have an "image" [x, y] and a "name" of its own')
        names.append(one["name"])
        image.append(_vector(one["image"], f"point {number}, image", 2))
        _check_inside(image[-1], number, size)
    pairs, lengths = [], []
    for row in given["distances"] if isinstance(given["distances"], list) else [None]:
        if not (isinstance(row, list) and len(row) == 3):
            raise ValueError('distances must be a list of [name, name, metres], such as [["a", "b", 4.2], …]')
        for name in row[:2]:
            if name not in names:
                raise ValueError(unknown_name("name of a point", str(name), names))
        if row[0] == row[1]:
            raise ValueError(f"there is no distance from {row[0]!r} to itself")
        pairs.append((names.index(row[0]), names.index(row[1])))
        lengths.append(_number(row[2], f"the distance of {row[0]} and {row[1]}", low=1e-9))
    tape = _number(given.get("tape", 0.01), "tape", low=1e-6, high=0.5)
    return of_distances(image, pairs, lengths, size, noise=noise, tape=tape)


def _check_inside(place: list[float], number: int, size: tuple[int, int]) -> None:
    """Refuse a point that is not in the picture: it was taken in one of another size."""
    if not (0 <= place[0] <= size[0] and 0 <= place[1] <= size[1]):
        raise ValueError(
            f"point {number}, image = [{place[0]:g}, {place[1]:g}], is outside the picture of {size[0]}x{size[1]} pixels; "
            'take it in a frame of this film, or mend "frame"'
        )


_READERS: Mapping[str, Callable[[Mapping[str, Json], tuple[int, int]], Ground]] = {
    "homography": _of_homography,
    "camera": _of_camera,
    "points": _of_points,
}


def _object(value: Json, what: str) -> Mapping[str, Json]:
    if not isinstance(value, dict):
        raise ValueError(f"{what} must be a JSON object {{…}} of values by name")
    return value


def _refuse_unknown(given: Mapping[str, Json], known: Iterable[str], what: str) -> None:
    for key in given:
        if key not in known:
            raise ValueError(unknown_name(what, key, known))


def _number(value: Json, what: str, *, low: float = -math.inf, high: float = math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{what} = {value!s:.40} is not a number")
    if not math.isfinite(value):
        raise ValueError(f"{what} = {value} is not a finite number")
    if not low <= value <= high:
        raise ValueError(f"{what} = {value:g} is out of range: it must be {_range(low, high)}")
    return float(value)


def _range(low: float, high: float) -> str:
    if math.isfinite(high):
        return f"{low:g} to {high:g}"
    return "above 0" if low < 1e-3 else f"at least {low:g}"


def _vector(value: Json, what: str, count: int) -> list[float]:
    if not isinstance(value, list) or len(value) != count:
        raise ValueError(f"{what} must be a list of {count} numbers")
    return [_number(one, what) for one in value]


def _pair(value: Json, what: str) -> tuple[float, float]:
    x, y = _vector(value, what, 2)
    return x, y


def _matrix(value: Json, what: str, rows: int, columns: int) -> Any:
    if not isinstance(value, list) or len(value) != rows:
        raise ValueError(f"{what} must be {rows} rows of {columns} numbers")
    return np.array([_vector(row, f"{what}, row {number}", columns) for number, row in enumerate(value, 1)])


def _flag(given: Mapping[str, Json], name: str) -> bool:
    value = given.get(name, False)
    if not isinstance(value, bool):
        raise ValueError(f"{name} must be true or false")
    return value
