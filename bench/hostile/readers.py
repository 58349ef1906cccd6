"""Every reader of files, once: how it is read and looked at, what to begin from, and words of its format.

To add one: a function in `looks.py` that reads a file as the program does and refuses (`want`) what cannot be; a line
here; `python bench/fuzz.py NAME --seconds 60 --keep`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hostile import looks, seeds
from hostile.looks import Look

KEPT = Path(__file__).parents[2] / "tests" / "kept"


@dataclass(frozen=True)
class Reader:
    """A reader of files.

    Parameters
    ----------
    name : str
        As it is chosen by, and as its kept inputs are named.
    look : (folder, bytes) -> None
        Puts the input into an empty folder, reads it, and raises `Insane` for what cannot be.
    seeds : () -> tuple of bytes
        Good files to begin from.
    covers : tuple of str
        The functions that it calls, as `module.function` below `perdure`.
    words : tuple of str
        Words of the format, for a dictionary.
    """

    name: str
    look: Look
    seeds: Callable[[], seeds.Seeds]
    covers: tuple[str, ...]
    words: tuple[str, ...] = ()


_NUMBERS = (
    "-1",
    "0",
    "1e9",
    "1e400",
    "NaN",
    "inf",
    "-0.0",
    "9007199254740993",
    "2147483648",
    "99999999999999999999",
)
_JSON = (
    *_NUMBERS,
    "null",
    "true",
    "[",
    "]",
    "{",
    "}",
    '"',
    ":",
    ",",
    "Infinity",
    "\\ud800",
    "\\u0000",
    "[]",
    "{}",
)
_TOML = (
    *_NUMBERS,
    "[[scenario]]",
    "[class.a]",
    "[line]",
    "name",
    "who",
    "pace",
    "above",
    "below",
    "lasts",
    "zone",
    "= ",
)
_COCO = (
    *_JSON,
    '"counts"',
    '"size"',
    '"segmentation"',
    '"bbox"',
    '"track_id"',
    '"iscrowd"',
    '"score"',
    '"frame_id"',
)
_LOG = (*_JSON, '"rows"', '"renamed"', '"dropped"', '"events"', '"begun"', '"explanations"', '"mask"', '"outline"')
_LOG += (
    '"believed"',
    '"ground"',
    '"links"',
    '"group"',
    '"inferred"',
    '"hidden_side"',
    '"class"',
    '"frame"',
    '"time"',
)
_ZONE = (*_JSON, '"rules"', '"never"', '"within"', '"after"', '"MultiPolygon"', '"kind"', '"exit"', '"occluder"')


def _several(*texts: str) -> Callable[[], seeds.Seeds]:
    return lambda: tuple(text.encode() for text in texts)


def _formatted(name: str, *more: str) -> Callable[[], seeds.Seeds]:
    return lambda: (seeds.of_format(name), *(one.encode() for one in more))


_ROWS = "1,1,4,3,4,3,1,-1,-1,-1\n1,2,10,7,3,3,0.5,-1,-1,-1\n2,1,4.5,3.25,4.5,3.75,1,-1,-1,-1\n"
_KITTI = "0 1 Car 0 0 -1.57 3 2 7 5 1.5 1.6 3.9 1 1.4 8 0.1 0.95\n0 -1 DontCare -1 -1 -10 5 5 6 6 -1 -1 -1 -1000 -1000 -1000 -10 0\n"
_POLYGONS = '<annotations><meta><task><size>9</size><original_size><width>16</width><height>12</height></original_size></task></meta><track id="0" label="dog"><polygon frame="0" outside="0" occluded="1" keyframe="1" points="1,1;5,1;5,4"/><polygon frame="3" keyframe="1" outside="1" points="2,1;6,1;6,4"/></track><track id="1" label="cat"><box frame="0" xtl="1" ytl="2" xbr="3" ybr="4" rotation="30"/><box frame="2" xtl="2" ytl="2" xbr="4" ybr="4"/></track></annotations>'
_DETECTED = {
    "images": [{"id": 1, "width": 16, "height": 12, "frame_index": 0}],
    "categories": [{"id": 1, "name": "a"}],
}
_DETECTED |= {
    "annotations": [
        {"id": 1, "image_id": 1, "category_id": 1, "track_id": 3, "segmentation": [[1, 1, 5, 1, 5, 4]]}
    ]
}
_CORNERS = [[[200, 400], [0, 12]], [[1000, 420], [9, 11]], [[1100, 700], [7.5, 4]], [[100, 690], [1.5, 4]]]
_PLANE = {"frame": [1280, 720], "points": [{"image": one, "ground": other} for one, other in _CORNERS]}
_TAPE = {
    "frame": [1280, 720],
    "tape": 0.05,
    "points": [{"name": n, "image": one} for n, (one, _) in zip("abcd", _CORNERS, strict=True)],
}
_TAPE |= {
    "distances": [
        ["a", "b", 10.1],
        ["b", "c", 7.3],
        ["c", "d", 4.4],
        ["d", "a", 8.0],
        ["a", "c", 11.3],
        ["b", "d", 9.3],
    ]
}
_CAMERA = {"frame": [1280, 720], "camera": {"focal": 900, "height": 5, "tilt_degrees": 30, "roll_degrees": 1}}
_POSE = {
    "frame": [1280, 720],
    "camera": {
        "focal": [900, 900],
        "centre": [640, 360],
        "distortion": [-0.1, 0.01],
        "rotation": [2.0, 0, 0],
        "translation": [0, 2, 9],
    },
}
_MATRIX = {
    "frame": [1280, 720],
    "homography": [[-0.0083, 0.0006, 5.1], [0.0004, 0.0002, -7.4], [-0.0001, -0.0017, 0.137]],
}
_SCENARIO = '[[scenario]]\nname = "waits"\nwho = "person"\nzone = "gate"\npace = {below = 0.3}\nlasts = 10\ninteresting = true\n[class.person]\nlabels = ["man"]\nheight = [1.1, 1.6, 2.0, inf]\n[line]\ngate = [[10, 200], [300, 210]]\n'
_CLIP = {
    "width": 16,
    "height": 12,
    "events": [
        {"type": "merge", "frame": 2, "ids": [1, 2]},
        {"type": "occluded", "begin": 2, "end": 4, "ids": [1]},
    ],
}
_REGION = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "geometry": {"type": "MultiPolygon", "coordinates": [[[[0, 0], [8, 0], [8, 8]]]]}}
    ],
}

READERS: Mapping[str, Reader] = {
    one.name: one
    for one in (
        Reader(
            "mot",
            looks.mot,
            _several(_ROWS, _ROWS.replace(",", " "), "1,1,4,3,4,3,1,1,0.86\n1,2,4,3,4,3,0,7,0.5\n"),
            (
                *("files.mot_table.read_table", "files.mot_table.read_lines", "files.mot.read_detections"),
                *(
                    "files.mot.read_said",
                    "files.mot.read_tracks",
                    "files.mot.read_truth",
                    "files.formats.mot.read",
                ),
                *("files.scored.read_result", "files.formats.known.read", "files.formats.known.recognised"),
            ),
            (*_NUMBERS, ",", "\n", " ", "\r\n", "1_0", "\ufeff"),
        ),
        Reader(
            "mots",
            looks.mots_text,
            _formatted("mots", "3 -1 10 12 16 0P6\n"),
            (
                *("files.mots.read_masks", "files.mots.read_lines", "files.mots.unpacked_runs"),
                *("files.formats.mots.read", "files.scored.read_scored_truth"),
            ),
            (*_NUMBERS, " 12 16 ", "\n", "oooooo0"),
        ),
        Reader(
            "kitti",
            looks.format_named("kitti"),
            _formatted("kitti", _KITTI),
            ("files.formats.kitti.read",),
            (*_NUMBERS, " ", "\n", "DontCare", "Car"),
        ),
        Reader(
            "csv",
            looks.format_named("csv"),
            _formatted("csv", "frame,id,x1,y1,x2,y2\n0,1,2,3,4,5\n"),
            ("files.formats.table.read", "files.formats.table.outline_of_wkt"),
            (
                *_NUMBERS,
                "POLYGON ((0 0, 1 0, 1 1, 0 0))",
                "MULTIPOLYGON",
                "EMPTY",
                "True",
                '"',
                ",",
                "\n",
                "ground_x",
                "visible",
            ),
        ),
        Reader(
            "parquet",
            looks.format_named("parquet"),
            lambda: (seeds.parquet(),),
            ("files.formats.parquet.read", "types.arrow.of_arrow"),
            ("PAR1", "frame", "id", "runs"),
        ),
        Reader(
            "geojson",
            looks.format_named("geojson"),
            _formatted("geojson"),
            ("files.formats.geojson.read", "files.formats.jsons.read_json"),
            (*_LOG, '"Polygon"', '"MultiPolygon"', '"outline":"seen"', '"outline":"believed"', '"box"'),
        ),
        Reader(
            "coco-video",
            looks.format_named("coco-video"),
            lambda: (seeds.of_format("coco-video"), json.dumps(_DETECTED).encode()),
            (
                "files.formats.coco_video.read",
                "files.formats.coco.read_document",
                "files.formats.coco.read_categories",
            ),
            _COCO,
        ),
        Reader(
            "coco-vis",
            looks.format_named("coco-vis"),
            _formatted("coco-vis"),
            ("files.formats.coco_vis.read",),
            (*_COCO, '"length"', '"bboxes"', '"segmentations"', '"file_names"'),
        ),
        Reader(
            "cvat",
            looks.format_named("cvat"),
            lambda: (seeds.of_format("cvat"), seeds.of_format("cvat-mask"), _POLYGONS.encode()),
            ("files.formats.cvat_reading.read",),
            (
                *_NUMBERS,
                "<track ",
                "<box ",
                "<polygon ",
                "<mask ",
                "</track>",
                'outside="1"',
                'keyframe="0"',
                "<!DOCTYPE a>",
                "<!ENTITY",
                "&#55555;",
                'frame="',
                'rle="',
                'rotation="',
            ),
        ),
        Reader(
            "log",
            looks.run_log,
            lambda: (seeds.lines_of_log(),),
            (
                "files.log.read_log",
                "files.reports.report_of_json",
                "files.lines.read_lines",
                "files.formats.run.read",
                "web.ledger.Ledger.refresh",
            ),
            _LOG,
        ),
        Reader(
            "run",
            looks.run_about,
            lambda: (seeds.about(),),
            ("files.runs.RunFolder.read_about",),
            (*_JSON, '"reporting"', '"window"', '"report_confidence"', '"scenarios"', '"width"'),
        ),
        Reader(
            "corrections",
            looks.by_hand,
            lambda: (seeds.corrections(),),
            (
                "files.corrections.read_corrections",
                "files.corrections.correction_of_json",
                "files.runs.RunFolder.read",
            ),
            (
                *_JSON,
                '"do"',
                '"undo"',
                '"redo"',
                '"swap"',
                '"join"',
                '"cut"',
                '"ids"',
                '"begin"',
                '"end"',
                '"event"',
            ),
        ),
        Reader(
            "regions",
            looks.recorded("given.jsonl"),
            lambda: (seeds.regions("given.jsonl"),),
            ("files.regions.read_regions", "files.lines.line_at", "files.lines.mask_of_json"),
            (*_JSON, '"boxes"', '"masks"', '"scores"', '"runs"', '"size"', '"events"', '"blind"'),
        ),
        Reader(
            "detections",
            looks.recorded("given.txt"),
            lambda: (seeds.regions("given.txt"),),
            ("files.regions.read_regions", "files.mot.read_detections"),
            (*_NUMBERS, ",", "\n"),
        ),
        Reader(
            "zones",
            looks.zone_file,
            lambda: (seeds.zones(),),
            ("files.zones.read_zones", "files.zones.zones_of_json"),
            _ZONE,
        ),
        Reader(
            "context",
            looks.context_file,
            seeds.contexts,
            ("files.contexts.read_context", "files.contexts.context_of_json"),
            (*_JSON, '"weights"', '"levels"', '"similar"', '"training"', '"alone"'),
        ),
        Reader(
            "calibration",
            looks.ground_plane,
            lambda: tuple(json.dumps(one).encode() for one in (_PLANE, _TAPE, _CAMERA, _POSE, _MATRIX)),
            ("files.calibration.read_calibration", "files.calibration.calibration_of_json"),
            (
                *_JSON,
                '"covariance"',
                '"mirrored":true',
                '"on_ground"',
                '"noise"',
                '"tape"',
                '"distortion"',
                '"body"',
            ),
        ),
        Reader(
            "scenarios",
            looks.rules,
            _several(_SCENARIO),
            ("files.scenarios.read_rules", "files.scenarios.rules_of"),
            _TOML,
        ),
        Reader(
            "state",
            looks.tracker_state(),
            seeds.saved_states,
            ("states.load",),
            ("PK\x03\x04", "state.json", "0.npy", "PK\x01\x02"),
        ),
        Reader(
            "state-inside",
            looks.tracker_state(seeds.sealed),
            lambda: tuple(map(seeds.entries, seeds.saved_states())),
            ("states.load",),
            (*_JSON, "'descr': '<f4'", "'|O'", "'fortran_order': True", "'shape': (2,)", '{"array":0}'),
        ),
        Reader(
            "picture",
            looks.pictures(seeds.resealed),
            lambda: (seeds.png(seeds.picture_lines()[:13], seeds.picture_lines()[13:]),),
            (
                "files.mask_pngs.read_indices",
                "files.mask_pngs.read_masks",
                "files.images.read_pixels",
                "files.formats.mask_png.read",
            ),
            ("IHDR", "PLTE", "IDAT", "tRNS", "IEND", "gAMA"),
        ),
        Reader(
            "picture-inside",
            looks.pictures(lambda data: seeds.png(data[:13], data[13:])),
            lambda: (seeds.picture_lines(), seeds.picture_lines(16), seeds.picture_lines(8, 3)),
            ("files.mask_pngs.read_indices", "files.mask_pngs.read_masks", "files.marks.read_marks"),
            (),
        ),
        Reader(
            "roi",
            looks.region_of_interest,
            lambda: (json.dumps(_REGION).encode(), b"0,0 8,0 8,8\n# a line\n2,2 9,2 9,9 2,9\n"),
            ("files.roi.read_roi",),
            (*_JSON, '"Polygon"', '"GeometryCollection"', '"geometries"', "0,0 8,0 8,8"),
        ),
        Reader(
            "typed",
            looks.typed,
            _several("2,2,5,5@3", "1,1 5,1 5,5", "gate=1,1,9,9", "yard=1,1 9,1 9,9", "0:01:02.5", "300f"),
            (
                "files.marks.read_marks",
                "files.roi.read_roi",
                "files.counting.lines_of",
                "files.counting.zones_of",
                "files.shapes.read_shape",
                "files.shapes.read_ring",
                "files.span.read_span",
                "files.span.read_moment",
            ),
            (*_NUMBERS, ",", " ", "@", "=", ":", "f", "\u0664"),
        ),
        Reader(
            "clip",
            looks.clip,
            _several(json.dumps(_CLIP)),
            ("files.clip.read_clip",),
            (*_JSON, '"split"', '"stands"'),
        ),
        Reader(
            "blobs",
            looks.blobs,
            _several("1 1+2 3\n2 1 2 3\n"),
            ("files.clip.read_blobs",),
            (*_NUMBERS, "+", " ", "\n", "\u0664", "1_0"),
        ),
        Reader(
            "settings",
            looks.settings,
            _several('{"least_overlap": 0.2, "patience": 2, "on_ground": false}'),
            ("files.settings.read_settings", "cli.options.read_parameters", "params.build"),
            (*_JSON, '"patience"', '"wander"'),
        ),
        Reader(
            "seqinfo",
            looks.sequence,
            _several(
                "[Sequence]\nname=yard\nimDir=img1\nframeRate=25\nseqLength=4\nimWidth=16\nimHeight=12\nimExt=.jpg\n"
            ),
            ("files.images.read_seqinfo",),
            (*_NUMBERS, "[", "]", "=", "imDir", "../..", "%(", "\n "),
        ),
        Reader(
            "names",
            looks.class_names,
            _several("person\ncar\n", '["person", "car"]', '{"0": "person", "1": "car"}'),
            ("files.networks.read_class_names", "files.networks.names_of"),
            (*_JSON, "(1,)", "{0: 'a'}", "b''"),
        ),
    )
}
