"""Write the pages that are read off the code: `python docs/reference.py` writes docs/parameters.md and docs/api.md."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import perdure
from perdure import params
from perdure.detect import DETECTORS
from perdure.features.covariance import ColourCovariance
from perdure.features.displacement import Displacement
from perdure.features.dominant import DominantColours
from perdure.features.embedding import Embedding
from perdure.features.ground_displacement import GroundDisplacement
from perdure.features.histogram import ColourHistogram
from perdure.features.hog import HogPoints
from perdure.files.live_source import Patience
from perdure.files.runs import Reporting
from perdure.files.whole import whole_file
from perdure.interpret import Feedback
from perdure.learn import Learning
from perdure.trackers import TRACKERS

DOCS = Path(__file__).parent
FAMILIES: Mapping[str, tuple[str, Mapping[str, type[Any]]]] = {
    "Trackers": ("Of `perdure track` and `live`, by `--tracker`.", dict(sorted(TRACKERS.items()))),
    "Detectors": (
        "Of `perdure track`, `live`, `detect`, `calibrate` and `context`, by `--detector`.",
        {"background": DETECTORS["background"], "people": DETECTORS["people"], "recorded": DETECTORS["recorded"]}
        | {"onnx, openvino": DETECTORS["onnx"], "function": DETECTORS["function"]},
    ),
    "Runs": (
        "What counts holds for `track`, `live`, `score`, `export` and `count`; scenarios for `track` and `live`; the "
        "source for `live`; learning for `learn`.",
        {"what counts": Reporting, "scenarios": Feedback, "the live source": Patience, "learning": Learning},
    ),
    "Features": (
        "What things are compared by with `--tracker multifeature` ([multi-feature.md](multi-feature.md)). These have no "
        "option: they are given where a feature is made in Python, `perdure.features.hog.HogPoints(stride=0.2)`.",
        {
            "displacement_3d": GroundDisplacement,
            "displacement_2d": Displacement,
            "histogram": ColourHistogram,
            "hog": HogPoints,
            "covariance": ColourCovariance,
            "dominant": DominantColours,
            "embedding": Embedding,
        },
    ),
}
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Whole films, and frame by frame": ("track", "follow", "plan", "Online"),
    "What is seen, believed and said": (
        "Frame",
        "Regions",
        "Mask",
        "Outline",
        "Tracks",
        "Status",
        "Event",
        "Scene",
    ),
    "A tracker is a fold": ("Tracker", "Detector", "Step", "Report", "settle", "save", "load"),
    "Beside supervision": ("to_regions", "to_supervision"),
    "Errors": (
        "PerdureError",
        "ParameterError",
        "VideoError",
        "DamagedVideo",
        "FormatError",
        "DetectorError",
        "OutputError",
        "StateError",
    ),
}


def main() -> None:
    """Write both pages."""
    for name, text in (("parameters.md", parameters_page()), ("api.md", api_page())):
        with whole_file(DOCS / name) as file:
            file.write(text)


def parameters_page() -> str:
    """Every parameter as it is declared, by what has it."""
    return "\n".join(
        [
            "# Every parameter",
            "",
            "Each is declared once, in the code of what has it; the command line, the checks and this page are read off that",
            "declaration (`python docs/reference.py` writes the page). `least_area` is `--least-area 0.001` on the command line,",
            '`{"least_area": 0.001}` in a file for `--parameters`, and `least_area=0.001` in Python. Yes or no is `--steady` or',
            "`--no-steady`. A letter is the paper's. [What to change](command-line.md#parameters) when something looks wrong",
            "begins with what you see.",
            *(line for heading in FAMILIES for line in _family(heading)),
            "",
        ]
    )


def _family(heading: str) -> Iterator[str]:
    told, kinds = FAMILIES[heading]
    yield from ("", f"## {heading}", "", told)
    for name, kind in kinds.items():
        declared = params.describe(kind)
        yield from ("", f"### {name}", "")
        if not declared:
            yield "None."
            continue
        yield from ("| parameter | default | range | meaning |", "|---|---|---|---|")
        yield from (_row(one) for one in declared)


def _row(one: params.Parameter) -> str:
    symbol = f"; {one.symbol}" if one.symbol else ""
    shown = {True: "yes", False: "no"}.get(one.default) if one.kind is bool else _number(one)
    span = "yes or no" if one.kind is bool else one.range_text
    return "| " + " | ".join(_cell(text) for text in (f"`{one.name}`", str(shown), span, one.help + symbol)) + " |"


def _number(one: params.Parameter) -> str:
    return f"{one.default:g}" if one.kind in (int, float) else str(one.default)


def _cell(text: str) -> str:
    return text.replace("|", "\\|") or "–"


def api_page() -> str:
    """Every public name with its first sentence; the site puts the whole docstring at the comments."""
    return "\n".join(
        [
            "# The Python API",
            "",
            "What `import perdure` has. [From Python](python.md) shows how it is used, by examples that run; trackers and",
            "detectors are in `perdure.trackers` and `perdure.detect`, with the [parameters](parameters.md) that they declare.",
            "Read `help(perdure.track)` for signatures and units; the site has them here.",
            *(line for heading in GROUPS for line in _group(heading)),
            "",
        ]
    )


def _group(heading: str) -> Iterator[str]:
    yield from ("", f"## {heading}", "", "| name | |", "|---|---|")
    yield from (f"| `perdure.{name}` | {_cell(_summary(getattr(perdure, name)))} |" for name in GROUPS[heading])
    yield ""
    yield from (f"<!-- api: {getattr(perdure, name).__module__}.{name} -->" for name in GROUPS[heading])


def _summary(value: Any) -> str:
    """The first sentence of a docstring, in one line."""
    return (inspect.getdoc(value) or "").partition("\n\n")[0].replace("\n", " ")


if __name__ == "__main__":
    main()
