"""Peak memory of `perdure track` on a video repeated to 2 000 and to 20 000 frames.

    python bench/memory.py VIDEO [--short 2000] [--long 20000] [--film] [--json]

The video's packets are repeated into a file without decoding them; each length runs in a process of its own, whose
peak resident memory the operating system tells. `growth` is peak(long) / peak(short) - 1.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import av


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video", type=Path)
    parser.add_argument("--short", type=int, default=2000)
    parser.add_argument("--long", type=int, default=20000)
    parser.add_argument("--film", action="store_true", help="draw the film too")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    peaks = {}
    with tempfile.TemporaryDirectory() as folder:
        for length in (arguments.short, arguments.long):
            film = Path(folder) / f"{length}{arguments.video.suffix}"
            repeat(arguments.video, film, length)
            peaks[length], frames = peak(film, Path(folder) / str(length), film=arguments.film)
            print(f"{frames:>6} frames  {peaks[length]:8.1f} MiB", flush=True)
    growth = peaks[arguments.long] / peaks[arguments.short] - 1
    print(f"growth         {growth:8.1%}")
    if arguments.json:
        names = {"short": arguments.short, "long": arguments.long}
        result = {f"peak_{name}_mib": round(peaks[length], 1) for name, length in names.items()}
        print(json.dumps({"video": arguments.video.name, **names, **result, "growth": round(growth, 4)}))


def repeat(source: Path, target: Path, length: int) -> None:
    """Write the packets of a video again and again until there are `length` of them."""
    with av.open(str(target), "w") as out:
        stream, written, shift = None, 0, 0
        while written < length:
            with av.open(str(source)) as container:
                video = container.streams.video[0]
                if stream is None:
                    stream = out.add_stream_from_template(video)
                last = 0
                for packet in container.demux(video):
                    if packet.dts is None or written == length:
                        continue
                    last = max(last, packet.dts + (packet.duration or 1))
                    packet.dts += shift
                    packet.pts = packet.dts if packet.pts is None else packet.pts + shift
                    packet.stream = stream
                    out.mux(packet)
                    written += 1
                shift += last


def peak(video: Path, run: Path, *, film: bool) -> tuple[float, int]:
    """Track a video in a process of its own; its peak resident memory in MiB and its frames."""
    command = [sys.executable, "-c", "from perdure.cli import main; main()", "track", str(video), "-o", str(run)]
    process = subprocess.Popen([*command, "--json", *([] if film else ["--no-video"])], stdout=subprocess.PIPE)
    with process.stdout as told:
        printed = told.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"perdure track ended with status {process.returncode}")
    return usage.ru_maxrss / 1024, json.loads(printed.splitlines()[-1])["frames"]


if __name__ == "__main__":
    main()
