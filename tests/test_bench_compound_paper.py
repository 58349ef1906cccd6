"""The bench of `compound`'s paper counts what it says: who stands on whom, who has the id back, the same boxes."""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import compound_paper as bench
import numpy as np
import peers
import pytest

from perdure.types import Event, Frame, Mask, Regions, Renamed, Report, Rows, Status, Tracks

LEFT, RIGHT, ABOVE = (0, 0, 30, 80), (60, 0, 90, 80), (0, 100, 30, 180)
PYTHON = peers.ENVIRONMENT / "bin" / "python"


def rows(frame: int = 0, **boxes: tuple[float, ...]) -> Tracks:
    """Rows of a frame: id1=box, id2=box, …"""
    ids = [int(name.removeprefix("id")) for name in boxes]
    return Tracks.of(frames=frame, times=frame / 12.5, ids=ids, boxes=np.array([*boxes.values()], np.float32))


def found_in_g(ids: list[int], own: int = 1) -> bench.Found:
    """What was found of A in a film of phase g alone; an id each frame, 0 where nobody stands on him."""
    frames = range(len(ids))
    one = bench.PhaseFound(
        bench.PHASES[-1], frames, 1.0, 0, {"A": len(ids)}, {"A": Counter(ids)}, {}, Counter(), 0, Counter()
    )
    stands = {(frame, "A"): name for frame, name in enumerate(ids)}
    return bench.Found((one,), (), Tracks.empty(), 0, stands, 0, {"A": own})


@cache
def film() -> bench.Film:
    return bench.figure_film()


# the film


def test_the_film_shows_what_its_phases_say():
    phases = bench.watch(film()).phases
    merged = {one.phase.name: one.merged / len(one.frames) for one in phases}
    assert merged["a"] == merged["d"] == 0.0
    assert min(merged[name] for name in "bce") > 0.7
    assert merged["f"] == 1.0
    assert all(one.seen["A"] == one.seen["B"] == len(one.frames) for one in phases)
    assert [one.phase.name for one in phases if one.seen["C"]] == ["f", "g"]
    assert phases[2].regions > 3  # shadows and specks


def test_the_third_is_never_seen_alone_before_all_part():
    assert bench.third_alone(film()) == 0
    last = len(film().frames) - 1
    assert not bench.shared(film().regions[last], film().truth.in_frame(last))
    assert len(film().regions[last]) == 3


def test_shadows_are_seen_as_moving_and_are_darker_in_the_picture():
    mask = Mask(70, 180, np.ones((80, 30), np.bool_))
    added = []
    for number in range(10):
        frame = Frame(number, number / 12.5, np.full((240, 400, 3), 120, np.uint8))
        truth = Tracks.of(frames=number, times=frame.time, ids=[1], boxes=[mask.box], masks=[mask])
        seen = bench.silhouettes(truth, 240, 400)
        darker, more = bench.shadowed(frame, seen, truth, seed=3)
        assert more[seen].all()
        assert np.array_equal((darker.image == 60).all(axis=2), more & ~seen)
        assert (frame.image == 120).all()
        added.append(int(more.sum() - seen.sum()))
    assert np.median(added) > 100
    assert len(set(added)) == 10  # never twice the same


# who stands on whom


def test_a_row_stands_on_whom_it_overlaps_by_half_and_a_group_on_nobody():
    said = rows(id7=LEFT, id8=(50, 0, 80, 80), id9=(0, 0, 90, 80)).replace(groups=np.array([9, 9, 0]))
    truth = rows(id1=LEFT, id2=RIGHT, id3=ABOVE)
    assert bench.standing(said, truth) == {(0, "A"): 7, (0, "B"): 8, (0, "C"): 0}


def test_who_is_hidden_is_not_asked_for():
    truth = rows(id1=LEFT, id2=RIGHT).replace(status=np.array([Status.VISIBLE, Status.OCCLUDED], np.int8))
    assert bench.standing(rows(id5=RIGHT), truth) == {(0, "A"): 0}


def test_two_share_a_region_if_both_lie_in_it_most():
    masks = [Mask(0, 0, np.ones((80, 30), np.bool_)), Mask(0, 60, np.ones((80, 30), np.bool_))]
    truth = rows(id1=LEFT, id2=RIGHT).replace(masks=tuple(masks))
    assert not bench.shared(Regions.of([LEFT, RIGHT]), truth)
    assert bench.shared(Regions.of([(0, 0, 90, 80), (200, 0, 210, 10)]), truth)
    assert not bench.shared(Regions.empty(), truth)


@pytest.mark.parametrize(
    ("ids", "verdict"),
    [([1, 1, 1], "yes"), ([0, 2, 1, 1], "from frame 2"), ([1, 1, 2], "no"), ([1, 0], "no")],
)
def test_somebody_has_the_id_back_if_it_stands_there_to_the_end(ids: list[int], verdict: str):
    assert [one.verdict for one in bench.fates(found_in_g(ids))] == [verdict]


def test_the_id_before_is_the_commonest_and_nobody_has_none():
    assert bench.commonest(Counter({0: 9, 4: 2, 3: 1})) == 4
    assert bench.commonest(Counter({0: 9})) == 0


def test_ids_are_written_with_their_frames():
    assert bench.in_words(Counter({1: 20, 0: 3, 2: 2}), 25) == "1 20/25, 2 2/25, none 3"
    assert bench.in_words(Counter(), 25) == "-"


def test_events_are_told_in_order_with_settled_ids():
    reports = [
        Report(rows(0, id2=LEFT), events=(Event("entered", 0, 0, (2,)),)),
        Report(renamed=(Renamed(2, 1, 0, 0),), events=(Event("exchanged", 0, 1, (1, 2)), Event("x", 0, 0))),
    ]
    assert [(one.kind, one.ids) for one in bench.settled_events(reports)] == [
        ("entered", (1,)),
        ("x", ()),
        ("exchanged", (1, 2)),
    ]


def test_tables_and_json_say_the_same(tmp_path: Path):
    found = bench.watch(film())
    told = bench.figure_json(found)
    table = bench.phase_table(found)
    assert [one["phase"] for one in told["phases"]] == [row[0][0] for row in table.rows] == list("abcdefg")
    assert all(len(row) == len(table.head) for row in table.rows)
    assert len(bench.fate_table(found).rows) == 5  # two in d, three in g
    assert len(bench.event_table(found).rows) == len(found.events)
    assert len(bench.variation_table({7.0: found}).rows[0]) == len(bench.variation_table({}).head)
    bench.draw(tmp_path, film(), found)
    assert [path.name[0] for path in sorted(tmp_path.glob("*.png"))] == list("abcdefg")


# cost and step


def test_every_part_of_the_chain_is_timed_and_the_share_is_the_trackers():
    given = film().frames[:12]
    cost = bench.run_chain("film", film().scene, given, lambda: given[::4])
    assert cost.frames == 12
    assert cost.tracking > 0
    assert cost.whole == pytest.approx(cost.decode + cost.first_look + cost.detection + cost.tracking)
    assert cost.share == pytest.approx(cost.tracking / cost.whole)
    table = bench.cost_table([cost])
    assert table.rows[0][-1] == "8.0%"  # the paper's: 0.2 s of 2.5 s
    assert all(len(row) == len(table.head) for row in table.rows)


def test_a_video_that_is_not_there_is_left_out_with_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert bench.cost_of_video(tmp_path / "video.avi") == []
    assert "video.avi is not there" in capsys.readouterr().err


def test_a_crowd_is_the_same_every_time_and_stays_in_the_picture():
    one, again = bench.crowd(10, 30), bench.crowd(10, 30)
    assert all(a.equals(b) for a, b in zip(one.regions, again.regions, strict=True))
    assert len(one.truth) == 300
    assert one.truth.boxes.min() >= 0
    assert (one.truth.boxes[:, [2, 3]] <= (3840, 2160)).all()
    assert 250 < sum(map(len, one.regions)) < 300  # a few are missed
    moved = np.diff(one.truth.boxes.reshape(30, 10, 4), axis=0)
    assert 0 < np.abs(moved).max() < 10


def test_the_best_of_all_rounds_counts_and_a_fault_is_told():
    slow, fast = (peers.Outcome(Rows.of(frames=[0], ids=[1], boxes=[LEFT]), seconds) for seconds in (2.0, 1.0))
    assert bench.best("x", [slow, fast]) is fast
    pair = bench.paired_times(bench.crowd(10, 30), slow, fast)
    assert (pair.walkers, pair.frames, pair.ratio) == (10, 30, 0.5)
    assert bench.step_table([pair]).rows[0][5] == "0.50"
    with pytest.raises(peers.PeersError, match="x: it broke"):
        bench.best("x", [slow, peers.Outcome(None, 0.0, "it broke")])


@pytest.mark.skipif(not PYTHON.exists(), reason="no environment of the peers; python bench/peers.py makes it")
def test_both_run_on_the_same_boxes():
    (pair,) = bench.race({"3": bench.crowd(3, 20)}, PYTHON, rounds=1)
    assert pair.our_ids == pair.peer_ids == 3
    assert pair.ratio > 0


# the page


def test_the_section_is_put_at_the_end_and_then_replaced_in_place():
    first = bench.replaced("# Benchmarks\n\nText.\n", "old")
    assert first == f"# Benchmarks\n\nText.\n\n{bench.HEADING}\n\n{bench.BEGIN}\nold\n{bench.END}\n"
    assert bench.replaced(first + "\n## After\n", "new") == first.replace("old", "new") + "\n## After\n"
    with pytest.raises(peers.PeersError, match="without the other"):
        bench.replaced(f"{bench.BEGIN}\nold\n", "new")


def test_an_unknown_part_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("sys.argv", ["compound_paper.py", "--parts", "coast"])
    with pytest.raises(SystemExit) as left:
        bench.main()
    said = capsys.readouterr().err
    assert left.value.code == 2
    assert said.count("\n") == 1
    assert "figure, cost, step" in said
