"""`perdure explain`: a run and an id in, why its rows are its own out."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from perdure.cli import options
from perdure.cli.tables import aligned
from perdure.errors import ParameterError
from perdure.files.runs import RunFolder
from perdure.files.span import frame_of
from perdure.reasons import Reason, Told, as_value, most_doubtful, told
from perdure.types import Event, Status

LINK_COLUMNS = ["frame", "score", "margin", "runner-up", "other region", "least alike"]
MOST = 10  # links that are shown where nobody says how many


def explain(
    run: options.RunArgument,
    identity: Annotated[
        Optional[int],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--id",
            metavar="ID",
            help="Whose rows: an id of the results; without it the most doubtful links of the run.",
            show_default=False,
        ),
    ] = None,
    row: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--frame",
            metavar="N",
            help="Which row, by the source's own number of the frame, from 0 (12 or 12f); without it the most doubtful links.",
            show_default=False,
        ),
    ] = None,
    most: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            "--most", metavar="N", min=1, help="How many are shown without --frame; 10.", show_default=False
        ),
    ] = None,
    all_: Annotated[bool, typer.Option("--all", help="Show every link, in the order of frames.")] = False,
    json_: options.JsonOption = False,
) -> None:
    """Show why a target has its id: by frame the features' similarities, weights, the score, and who came next."""
    frame = None if row is None else frame_of(row, "frame")
    if frame is not None and all_:
        raise ParameterError("--all shows every frame and --frame one; leave out one of them")
    if most is not None and (all_ or frame is not None):
        raise ParameterError(
            f"--most shows some and {'--all all' if all_ else '--frame one'}; leave out one of them"
        )
    folder = RunFolder.open(run)
    if identity is None:
        if frame is not None or all_:
            raise ParameterError(f"{'--frame' if all_ is False else '--all'} goes with an id; name it by --id")
        _overview(folder, most or MOST, as_json=json_)
        return
    found = told(lambda: folder.entries(with_masks=False), identity)
    note = _note(found, folder.read_about())
    if note:
        print(f"perdure: note: {note}", file=sys.stderr)
    if frame is not None:
        found.row(frame)
    chosen = list(found.reasons.values()) if all_ else found.doubtful(most or MOST)
    if frame is not None:
        chosen = [found.reasons[frame]] if frame in found.reasons else []
    events = found.events if frame is None else found.about(frame)
    if json_:
        print(json.dumps(_value(run, found, frame, chosen, events, note)))
        return
    lines = _summary(found, chosen, sparse=not all_) if frame is None else _of_frame(found, frame)
    print("\n".join([*lines, *_words_of_events(events)]))


def _overview(folder: RunFolder, most: int, *, as_json: bool) -> None:
    """Print the most doubtful links of a run."""
    links = most_doubtful(lambda: folder.entries(with_masks=False), most)
    note = "" if links else _without_reasons(folder.read_about())
    if as_json:
        value = {
            "run": str(folder.path),
            "note": note,
            "links": [{"id": one, **as_value(why)} for one, why in links],
        }
        print(json.dumps(value))
        return
    if not links:
        raise ParameterError(note)
    table = [["id", *LINK_COLUMNS], *([str(one), *_cells(why)] for one, why in links)]
    print(f"the most doubtful links of all (more of one by --id):\n{aligned(table)}")


def _note(found: Told, about: dict[str, Any]) -> str:
    """What the user must know of a run that explains nothing."""
    return "" if found.any_reasons else _without_reasons(about)


def _without_reasons(about: dict[str, Any]) -> str:
    tracker = about.get("tracker") if isinstance(about.get("tracker"), dict) else {}
    name, parameters = (tracker or {}).get("name", ""), (tracker or {}).get("parameters", {})
    if "explain" in parameters:
        again = "track again with --explain" if not parameters["explain"] else "no link was made"
        return f"the run holds no reasons of links; {again}"
    return (
        f"the tracker {name or 'of this run'} puts down no reasons of links; only its events tell what it decided, "
        "those of one target with --id"
    )


def _of_frame(found: Told, frame: int) -> list[str]:
    """Why the row of one frame is the target's."""
    row = found.row(frame)
    rows = found.rows
    regions = ", ".join(f"region {one}" for one in rows.links[row])
    words = [
        Status(rows.status[row]).word,
        *([regions] if regions else []),
        f"confidence {rows.confidence[row]:.2f}",
    ]
    lines = [f"id {found.id} in frame {frame} ({rows.times[row]:.2f} s): {', '.join(words)}"]
    reason = found.reasons.get(frame)
    if reason is None:
        return [*lines, *filter(None, [found.remark(frame)])]
    table = [["feature", "link", "global", "weight", "counts"]]
    table += [[one.feature, *(f"{part:.2f}" for part in one[1:])] for one in reason.shares]
    if abs(reason.waned) >= _SHOWN:
        table.append(["unseen for a while", "", "", "", f"{-reason.waned:.2f}"])
    table.append(["score", "", "", "", f"{reason.score:.2f}"])
    lines += [reason.why, "", aligned(table), ""]
    rival, other = reason.runner_up, reason.other_region
    lines.append(f"runner-up     {'none' if rival is None else f'id {rival[0]} would have scored {rival[1]:.2f}'}")
    lines.append(
        f"other region  {'none' if other is None else f'region {other[0]} would have scored {other[1]:.2f}'}"
    )
    return lines


def _summary(found: Told, chosen: Sequence[Reason], *, sparse: bool) -> list[str]:
    """Where the target was, and its links, a line each."""
    rows, links = found.rows, len(found.reasons)
    unseen = int(rows.inferred.sum())
    lines = [
        f"id {found.id}: frames {rows.frames[0]} to {rows.frames[-1]}, seen in {len(rows) - unseen}, "
        f"not seen in {unseen}; {links} {'link' if links == 1 else 'links'} explained"
    ]
    if not chosen:
        return lines
    table = [LINK_COLUMNS, *(_cells(one) for one in chosen)]
    order = ", the most doubtful first" if sparse and len(chosen) > 1 else ""
    return [*lines, "", f"links{order}:", aligned(table)]


def _cells(one: Reason) -> list[str]:
    """A link, in `LINK_COLUMNS`."""
    least = min(one.shares, key=lambda part: part.whole, default=None)
    return [
        str(one.frame),
        f"{one.score:.2f}",
        "-" if one.margin is None else f"{one.margin:.2f}",
        "-" if one.runner_up is None else f"id {one.runner_up[0]}: {one.runner_up[1]:.2f}",
        "-" if one.other_region is None else f"{one.other_region[0]}: {one.other_region[1]:.2f}",
        "-" if least is None else f"{least.feature} {least.whole:.2f}",
    ]


def _words_of_events(events: Sequence[Event]) -> list[str]:
    if not events:
        return []
    table = [["event", "frames", "ids"]]
    for one in events:
        span = str(one.begin) if one.begin == one.end else f"{one.begin} to {one.end}"
        table.append([one.kind, span, " ".join(map(str, one.ids))])
    shown = aligned(table).splitlines()
    why = ["", *(" ".join(filter(None, (one.zone and f"[{one.zone}]", one.why))) for one in events)]
    wide = max(len(one) for one in shown)
    return ["", *(f"{one:{wide}}  {text}".rstrip() for one, text in zip(shown, why, strict=True))]


def _value(
    run: Path, found: Told, frame: int | None, chosen: Sequence[Reason], events: Sequence[Event], note: str
) -> dict[str, Any]:
    rows = found.rows
    value: dict[str, Any] = {
        "run": str(run),
        "id": found.id,
        "frames": {"first": int(rows.frames[0]), "last": int(rows.frames[-1])},
        "seen": int((~rows.inferred).sum()),
        "not_seen": int(rows.inferred.sum()),
        "note": note,
        "links": [as_value(one) for one in chosen],
        "events": [dataclasses.asdict(one) for one in events],
    }
    if frame is not None:
        row = found.row(frame)
        before, after = found.around(frame)
        value["row"] = {
            "frame": frame,
            "time": float(rows.times[row]),
            "status": Status(rows.status[row]).word,
            "box": [round(float(one), 2) for one in rows.boxes[row]],
            "confidence": round(float(rows.confidence[row]), 4),
            "inferred": bool(rows.inferred[row]),
            "regions": list(rows.links[row]),
            "seen_before": before,
            "seen_after": after,
            "remark": "" if frame in found.reasons else found.remark(frame),
        }
    return value


_SHOWN = 0.005  # of a score: what is less is rounded away
