"""What TrackEval's own readers make of a file: rows as JSON on standard output.

    python bench/peers/reading.py KIND FOLDER FRAMES

KIND is mot, mots, kitti or coco-vis; FOLDER holds the file as that benchmark lays it out, as truth and as the result of a
tracker named `ours` (coco-vis: as truth only). Run by tests/files/formats/test_other_readers.py in the environment of
the peers, which has TrackEval.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys

from trackeval import datasets


def main(kind: str, folder: str, frames: int) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        rows = {"mot": mot, "mots": mots, "kitti": kitti, "coco-vis": vis}[kind](folder, frames)
    print(json.dumps(rows))


def mot(folder: str, frames: int) -> dict:
    return rows_of(datasets.MotChallenge2DBox(challenge(folder, frames) | {"BENCHMARK": "MOT15"}), boxes)


def mots(folder: str, frames: int) -> dict:
    return rows_of(datasets.MOTSChallenge(challenge(folder, frames)), silhouettes)


def challenge(folder: str, frames: int) -> dict:
    return {
        "GT_FOLDER": f"{folder}/truth",
        "TRACKERS_FOLDER": f"{folder}/said",
        "GT_LOC_FORMAT": "{gt_folder}/{seq}.txt",
        "SEQ_INFO": {"yard": frames},
        "SKIP_SPLIT_FOL": True,
        "DO_PREPROC": False,
        "PRINT_CONFIG": False,
    }


def kitti(folder: str, frames: int) -> dict:
    config = {"GT_FOLDER": f"{folder}/truth", "TRACKERS_FOLDER": f"{folder}/said", "PRINT_CONFIG": False}
    return rows_of(datasets.Kitti2DBox(config), boxes)


def vis(folder: str, frames: int) -> dict:
    config = {
        "GT_FOLDER": f"{folder}/",
        "TRACKERS_FOLDER": f"{folder}/",
        "TRACKERS_TO_EVAL": [],
        "PRINT_CONFIG": False,
    }
    benchmark = datasets.YouTubeVIS(config | {"SPLIT_TO_EVAL": "all"})
    raw = benchmark._load_raw_file("", benchmark.seq_list[0], is_gt=True)
    return {"gt": [[one.tolist() for one in raw["gt_ids"]], [silhouettes(one) for one in raw["gt_dets"]]]}


def rows_of(benchmark: object, place: object) -> dict:
    """Ids and places frame by frame, of the truth and of the tracker."""
    found = {}
    for side, is_truth in (("gt", True), ("tracker", False)):
        raw = benchmark._load_raw_file("ours", benchmark.seq_list[0], is_gt=is_truth)
        ids = [one.tolist() for one in raw[f"{side}_ids"]]
        found[side] = [ids, [place(one) for one in raw[f"{side}_dets"]]]
    return found


def boxes(of_frame: object) -> list:
    return of_frame.tolist()


def silhouettes(of_frame: list) -> list:
    counts = [one["counts"] for one in of_frame]
    return [one.decode("ascii") if isinstance(one, bytes) else one for one in counts]


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
