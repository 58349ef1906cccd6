"""Corrections in words."""

from __future__ import annotations

from perdure.files.corrections import Correction


def looked_words(do: str | None) -> str:
    """Return what somebody said of a doubt by an action; nothing where nobody did."""
    return "" if do is None else "right" if do == "confirm" else "repaired"


def words_of(one: Correction) -> str:
    """Return a correction in few words."""
    ids = one.ids
    span = f"from frame {one.begin} on" if one.end is None else f"in frames {one.begin} to {one.end}"
    if one.do == "confirm":
        return "marked as right: " + " ".join(map(str, ids))
    if one.do == "swap":
        return f"swapped {ids[0]} and {ids[1]} {span}"
    if one.do == "join":
        return f"joined {ids[0]} into {ids[1]}" + ("" if one.begin == 0 and one.end is None else f" {span}")
    if one.do == "cut":
        return f"cut {ids[0]} {span}: now {ids[1]}"
    return f"deleted {ids[0]}" + ("" if one.begin == 0 and one.end is None else f" {span}")
