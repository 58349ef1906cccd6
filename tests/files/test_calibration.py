"""The calibration file: its forms, and every fault with its remedy."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from perdure.errors import FormatError
from perdure.files.calibration import read_calibration, write_calibration
from perdure.scene.ground import of_camera
from perdure.scene.lens import Lens

SIZE = (1280, 720)
CAMERA = {"focal": 1000, "height": 5.0, "tilt_degrees": 17.2, "roll_degrees": 2.0}
GROUND = of_camera(
    Lens(np.array([1000.0, 1000]), np.array([640.0, 360]), np.zeros(5)), 5.0, np.radians(17.2), np.radians(2), SIZE
)
POINTS = [[200, 400], [1000, 420], [1100, 700], [100, 690]]


def read(tmp_path, value):
    path = tmp_path / "calibration.json"
    path.write_text(value if isinstance(value, str) else json.dumps({"frame": list(SIZE), **value}))
    return read_calibration(path, *SIZE)


def test_every_form_says_the_same(tmp_path):
    places = GROUND.places(POINTS)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # level, then tilted and rolled about the camera's axes
    sine, cosine = np.sin(np.radians(17.2)), np.cos(np.radians(17.2))
    tilted = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    rolled = np.array(
        [
            [np.cos(np.radians(2)), np.sin(np.radians(2)), 0],
            [-np.sin(np.radians(2)), np.cos(np.radians(2)), 0],
            [0, 0, 1],
        ]
    )
    rotation = rolled @ tilted @ turn
    forms = [
        {"camera": CAMERA},
        {"camera": {"focal": [1000, 1000], "centre": [640, 360], "rotation": rotation.tolist(),
                    "translation": (-rotation @ [0, 0, 5.0]).tolist()}},
        {"homography": (-2 * GROUND.homography).tolist()},
        {"points": [{"image": p, "ground": list(g)} for p, g in zip(POINTS, places.tolist(), strict=True)]},
    ]  # fmt: skip
    for form in forms:
        ground = read(tmp_path, form)
        assert ground.places([[300, 500], [900, 640]]) == pytest.approx(GROUND.places([[300, 500], [900, 640]]))
        assert ground.heights([[500, 300, 540, 500]]) == pytest.approx(GROUND.heights([[500, 300, 540, 500]]))


def test_distances_and_a_rotation_vector_are_read(tmp_path):
    places, names = GROUND.places(POINTS), "abcd"
    far = [
        [names[i], names[j], float(np.linalg.norm(places[i] - places[j]))]
        for i in range(4)
        for j in range(i + 1, 4)
    ]
    points = [{"image": image, "name": name} for image, name in zip(POINTS, names, strict=True)]
    ground = read(tmp_path, {"points": points, "distances": far})
    assert np.linalg.norm(np.diff(ground.places(POINTS[:2]), axis=0)) == pytest.approx(far[0][2])
    down = {
        "focal": 900,
        "rotation": [np.pi, 0, 0],
        "translation": [0, 0, 10.0],
    }  # straight down, Y up the picture
    assert read(tmp_path, {"camera": down}).places([[640, 360], [730, 270]]) == pytest.approx(
        np.array([[0, 0], [1.0, 1.0]]), abs=1e-9
    )


def test_distortion_is_heeded(tmp_path):
    bent = read(tmp_path, {"camera": {**CAMERA, "distortion": {"k1": -0.2}}})
    same = read(tmp_path, {"camera": {**CAMERA, "distortion": [-0.2, 0, 0, 0, 0]}})
    straight = read(tmp_path, {"camera": CAMERA})
    assert np.linalg.norm(bent.places([[100, 700]]) - straight.places([[100, 700]])) > 0.1
    assert bent.places([[100, 700]]) == pytest.approx(same.places([[100, 700]]))


def test_what_is_written_is_read_again(tmp_path):
    value = {
        "frame": list(SIZE),
        "camera": CAMERA,
        "covariance": np.diag([0.01, 0.02, 0.03, 0.04]).tolist(),
        "body": 1.7,
    }
    write_calibration(tmp_path / "written.json", value)
    ground = read_calibration(tmp_path / "written.json", *SIZE)
    assert ground.body == 1.7
    assert ground.covariance.any()
    assert ground.places([[300, 500]]) == pytest.approx(GROUND.places([[300, 500]]))


SQUARE = [{"image": p, "ground": g} for p, g in zip(POINTS, [[0, 5], [5, 5], [5, 0], [0, 0]], strict=True)]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{", "line 1: not JSON"),
        ("[]", "must be a JSON object"),
        ({}, "one of 'homography', 'camera', 'points'; this one holds none"),
        ({"homografy": 1}, "did you mean 'homography'"),
        ({"camera": CAMERA, "points": SQUARE}, "holds camera and points"),
        ({"camera": CAMERA, "homograph": 1}, "'homograph' is not a key of a calibration by camera"),
        ({"camera": {**CAMERA, "tilt_degree": 3}}, "did you mean 'tilt_degrees'"),
        ({"camera": CAMERA, "frame": [640, 480]}, "of 640x480, the source has 1280x720; calibrate anew"),
        ('{"camera": {}}', r'"frame" is missing: .* \[1280, 720\]'),
        ({"camera": {"height": 5, "tilt_degrees": 9}}, '"focal" is missing'),
        ({"camera": {"focal": 900, "height": 5}}, 'by "height" and "tilt_degrees"'),
        ({"camera": {**CAMERA, "rotation": [0, 0, 0]}}, 'by "rotation" and "translation"'),
        ({"camera": {**CAMERA, "height": -2}}, "height = -2 is out of range: it must be above 0"),
        ({"camera": {**CAMERA, "focal": "long"}}, "focal = long is not a number"),
        ({"camera": {**CAMERA, "focal": 0}}, "above 0 pixels"),
        ({"camera": {**CAMERA, "centre": [960, 1080]}}, "lies outside the picture of 1280x720"),
        ({"camera": {"focal": 900, "rotation": [[1, 0, 0], [0, 2, 0], [0, 0, 1]], "translation": [0, 0, 1]}}, "no rotation"),
        ({"camera": {"focal": 900, "rotation": [1, 0, 0], "translation": [0, 0, 0]}}, "lies in the ground"),
        ({"homography": [[1, 2], [3, 4]]}, "3 rows of 3 numbers"),
        ({"homography": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]}, "singular"),
        ('{"frame": [1280, 720], "homography": [[NaN, 2, 3], [2, 4, 6], [0, 0, 1]]}', "not a finite number"),
        ({"homography": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 1]]}, '"mirrored": true'),
        ({"homography": [[0.01, 0, 0], [0, -0.01, 0], [0, 0, 1]], "mirrored": True}, 'leave out "mirrored"'),
        ({"homography": GROUND.homography.tolist(), "mirrored": 1}, "true or false"),
        ({"points": SQUARE[:3]}, "needs four"),
        ({"points": [*SQUARE[:3], {"image": [1300, 2], "ground": [1, 2]}]}, r"point 4, image = \[1300, 2\], is outside the picture of 1280x720"),
        ({"points": [*SQUARE[:3], {"image": [1, 2]}]}, 'point 4 has no "ground"'),
        ({"points": [*SQUARE[:3], {"image": [1, 2], "grund": [1, 2]}]}, "did you mean 'ground'"),
        ({"points": [{**one, "ground": one["ground"][::-1]} for one in SQUARE]}, "exchange X and Y"),
        ({"points": [{"image": p, "name": "a"} for p in POINTS], "distances": []}, '"name" of its own'),
        ({"points": [{"image": p, "name": n} for p, n in zip(POINTS, "abcd", strict=True)], "distances": [["a", "e", 2]]},
         "'e' is not a name of a point"),
    ],
)  # fmt: skip
def test_faults_are_named_with_the_remedy(tmp_path, value, words):
    with pytest.raises(FormatError, match=words) as caught:
        read(tmp_path, value)
    assert "calibration.json" in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FormatError, match="cannot read the calibration"):
        read_calibration(tmp_path / "none.json", *SIZE)


def test_the_examples_of_the_page_can_be_read(tmp_path):
    page = (Path(__file__).parents[2] / "docs/ground.md").read_text(encoding="utf-8")
    examples = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    grounds = [read(tmp_path, example) for example in examples]
    assert {ground.origin for ground in grounds} == {"points", "distances", "homography", "camera"}
    for ground in grounds:
        assert np.isfinite(ground.places([[640, 600]])).all()
