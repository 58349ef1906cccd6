"""TrackEval's figures for MOT and MOTS text; run by the peers' interpreter, which has it.

    python oracle.py JOB.json

The job: {"kind": "boxes" or "masks", "benchmark": "MOT15" or "MOT17", "folder": ..., "sequences": {name: frames}}.
The folder holds `truth/NAME.txt` and `said/tracker/data/NAME.txt`. Prints one JSON object: the figures of each
sequence and of "COMBINED_SEQ", and the seconds that reading and scoring took.
"""

import contextlib
import io
import json
import sys
import time

import numpy as np
from trackeval.datasets import MotChallenge2DBox, MOTSChallenge
from trackeval.metrics import CLEAR, HOTA, Identity

RATIOS = ("HOTA", "DetA", "AssA", "LocA", "DetRe", "DetPr", "AssRe", "AssPr")
RATIOS += ("MOTA", "MOTP", "sMOTA", "IDF1", "IDP", "IDR")
COUNTS = {"CLR_TP": "TP", "CLR_FP": "FP", "CLR_FN": "FN"}
COUNTS |= {name: name for name in ("IDSW", "Frag", "MT", "PT", "ML")}


def main() -> None:
    with open(sys.argv[1], encoding="utf-8") as file:
        job = json.load(file)
    begun = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        scores = scored(job)
    print(json.dumps({"seconds": time.perf_counter() - begun, "figures": scores}))


def scored(job: dict) -> dict:
    """The figures by sequence; each sequence is prepared as TrackEval prepares the benchmark."""
    kind = MotChallenge2DBox if job["kind"] == "boxes" else MOTSChallenge
    dataset = kind(
        {
            "GT_FOLDER": f"{job['folder']}/truth",
            "TRACKERS_FOLDER": f"{job['folder']}/said",
            "SEQ_INFO": job["sequences"],
            "GT_LOC_FORMAT": "{gt_folder}/{seq}.txt",
            "SKIP_SPLIT_FOL": True,
            "BENCHMARK": job.get("benchmark", "MOT17"),
            "PRINT_CONFIG": False,
        }
    )
    metrics = [HOTA(), CLEAR({"PRINT_CONFIG": False}), Identity({"PRINT_CONFIG": False})]
    parts = {}
    for name in job["sequences"]:
        prepared = dataset.get_preprocessed_seq_data(dataset.get_raw_seq_data("tracker", name), "pedestrian")
        parts[name] = [metric.eval_sequence(prepared) for metric in metrics]
    if len(parts) > 1:
        parts["COMBINED_SEQ"] = [
            metric.combine_sequences({name: parts[name][place] for name in job["sequences"]})
            for place, metric in enumerate(metrics)
        ]
    return {name: figures(results) for name, results in parts.items()}


def figures(results: list) -> dict:
    every = {key: value for result in results for key, value in result.items()}
    ratios = {name: float(np.mean(every[name])) for name in RATIOS}
    return ratios | {name: int(every[key]) for key, name in COUNTS.items()}


main()
