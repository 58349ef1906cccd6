"""Run every tracker over a drawn world, each into a folder of its name: `one_run.py FOLDER THREADS`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import cv2
from worlds import crossing

from perdure import pipeline
from perdure.cli.running import run
from perdure.files.runs import Reporting, RunFolder
from perdure.trackers import TRACKERS

if __name__ == "__main__":
    folder, threads = sys.argv[1:]
    cv2.setNumThreads(int(threads))
    world = crossing()
    for tracker in TRACKERS:
        plan = pipeline.plan([frame.image for frame in world.frames()], tracker=tracker, fps=world.fps)
        run(plan, RunFolder.create(Path(folder) / tracker, overwrite=False), Reporting(), film=False)
