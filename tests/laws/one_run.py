"""Run one tracker over a drawn world into a folder: `one_run.py TRACKER FOLDER THREADS`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import cv2
from worlds import crossing

from perdure import pipeline
from perdure.cli.running import run
from perdure.files.runs import Reporting, RunFolder

if __name__ == "__main__":
    tracker, folder, threads = sys.argv[1:]
    cv2.setNumThreads(int(threads))
    world = crossing()
    plan = pipeline.plan([frame.image for frame in world.frames()], tracker=tracker, fps=world.fps)
    run(plan, RunFolder.create(Path(folder), overwrite=False), Reporting(), film=False)
