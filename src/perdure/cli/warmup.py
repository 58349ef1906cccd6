"""`perdure warmup`: compile every kernel now, so that no run has to wait."""

from __future__ import annotations

import json
import os
import time

from perdure.cli import options
from perdure.cli.progress import kernel_news


def warmup(json_: options.JsonOption = False) -> None:
    """Compile all kernels ahead: once per machine, for an image of a container, or after an update."""
    begun, worked = time.perf_counter(), sum(os.times()[:4])  # of this process and those it starts
    from perdure.maths.kernels.ahead import ready  # numba: half a second that no other command should cost

    loaded = time.perf_counter() - begun
    kernels = []
    with kernel_news(lambda: None):
        for one in ready():
            kernels.append(one)
            if one.compiled:
                print(f"compiled {one.name:<26} {one.seconds:5.2f} s")
    seconds = time.perf_counter() - begun
    compiled = sum(one.compiled for one in kernels)
    places = sorted({str(one.place) for one in kernels if one.place is not None})
    if compiled:
        print(f"{compiled} of {len(kernels)} kernels compiled in {seconds:.1f} s")
    else:
        print(f"all {len(kernels)} kernels were there already, loaded in {seconds:.2f} s")
    print(f"kept in {', '.join(places) or 'no folder: none can be written into'}")
    if json_:
        value = {
            "kernels": [
                {"name": one.name, "seconds": round(one.seconds, 3), "compiled": one.compiled} for one in kernels
            ],
            "compiled": compiled,
            "loading": round(loaded, 3),
            "seconds": round(seconds, 3),
            "processor_seconds": round(sum(os.times()[:4]) - worked, 3),
            "places": places,
        }
        print(json.dumps(value))
