"""A source, a detector and a tracker joined into one run, by name and parameters."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import math
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure import equipment, fold, params
from perdure.detect import Mark, Marked, WithMarks
from perdure.detect.plausible import left_out
from perdure.detection import AnyDetector, check_classes, detector_name, made_detector, recorded
from perdure.equipment import AnyContext, equipped
from perdure.errors import DamagedVideo, ParameterError
from perdure.files.calibration import read_calibration
from perdure.files.live_source import LiveSource
from perdure.files.marks import AnyMark, read_marks, words_of
from perdure.files.roi import read_roi
from perdure.files.scenarios import read_rules
from perdure.files.shapes import filled
from perdure.files.video import Source, open_source
from perdure.files.zones import read_zones
from perdure.foreign import AnySettings, made_foreign
from perdure.interpret import Feedback, Interpreter, Placing
from perdure.owners import of_scenarios, split
from perdure.scene.perspective import BODY, Estimate, estimate
from perdure.scene.scenarios import Rules
from perdure.scene.zones import Zones
from perdure.states import kind_of
from perdure.trackers import TRACKERS
from perdure.types import Frame, Regions, Report, Scene, Tracks

_LEAST_COVER = 0.2  # of the frames: detections for fewer are worth a note
_SURE = 0.5  # score of regions that tell of the ground
LOOKED = 120.0  # s of a film in which people tell of the ground
AUTO = "auto"
FIRST_LOOKS = 25  # frames spread over a file that a detector may see first

AnyStanding = fold.Standing[Any, Any, Any]
AnySource = str | Path | int | Iterable[NDArray[np.uint8]] | LiveSource


@dataclass(frozen=True)
class Plan:
    """Everything a run needs, checked, before its first frame."""

    source: Source
    scene: Scene
    detector_name: str
    detector: Any
    tracker_name: str
    tracker: Any
    classes: tuple[str, ...]
    init: tuple[str, ...] = ()  # what the user marked, in words
    marks: tuple[Mark, ...] = ()  # what he marked beside the detector's regions
    body: float = 0.0  # m that people are high; above 0 where the ground is to be estimated from them
    estimate: Estimate | None = None  # what they told of it
    contexts: tuple[str, ...] = ()  # that the user named, in words
    rules: Rules | None = None  # scenarios that are to be recognised
    feedback: Feedback = dataclasses.field(default_factory=Feedback)  # and what they do to tracks
    whole: Source | None = None  # over which first looks are taken, where the source is a part of it

    def check(self) -> None:
        """Refuse a detector, tracker and source that do not go together."""
        for what, part in (("detector", self.detector), ("tracker", self.tracker)):
            if part.needs_pixels and not self.source.has_images:
                raise ParameterError(
                    f"{self.source.name} has no images and this {what} needs them; name a --detector FILE"
                )
        if not self.source.has_images:
            equipment.check_looks(self.tracker, self.source.name)
        if self.classes and self.detector_name == "marked":
            raise ParameterError("what is marked has no class; leave out --class")
        if self.classes and self.detector_name == "background":
            raise ParameterError(
                "the background detector names no classes; leave out --class or give --detector FILE"
            )
        check_classes(self.detector, self.classes)

    def prepared(self) -> Plan:
        """Return the plan with the first looks over the source taken: the detector's, and that for the ground."""
        looked = self._with_detector()
        return looked if not looked.body else looked._with_ground()

    def people(self) -> Tracks:
        """Return the rows of who goes about in the first `LOOKED` seconds, by overlap alone; of sure regions only."""

        def sure(regions: Regions) -> Regions:
            return self._wanted(regions.take(regions.scores >= _SURE))

        begin: list[float] = []

        def early() -> Iterator[Frame]:
            for frame in self.whole or self.source:
                begin.append(frame.time)
                if frame.time - begin[0] > LOOKED:
                    return
                yield frame

        reports: list[Report] = []
        with contextlib.suppress(DamagedVideo):  # what came before is enough; tracking will tell
            for step in fold.run(early(), self.detector, TRACKERS["overlap"](), self.scene, sure):
                reports.append(step.report)
        return fold.settle(reports)

    def _with_ground(self) -> Plan:
        """The plan with the ground that people tell, or the verdict why they do not."""
        told = estimate(self.people(), (self.scene.width, self.scene.height), body=self.body)
        scene = dataclasses.replace(self.scene, ground=told.ground)
        return dataclasses.replace(self, scene=scene, body=0.0, estimate=told)

    def _with_detector(self) -> Plan:
        """The plan with the detector's first look taken, where it and the source allow it."""
        if not (self.source.rereadable and self.source.has_images and hasattr(self.detector, "prepare")):
            return self
        looked = self.detector.prepare((self.whole or self.source).sample(FIRST_LOOKS))
        return dataclasses.replace(self, detector=looked)

    def notes(self) -> tuple[str, ...]:
        """Return what the user should know about how source, detections and tracker went together."""
        parts = self._of_marks, self._of_detections, self._of_ground, self._of_contexts, self.of_lines
        return tuple(note for part in parts for note in part())

    def of_lines(self) -> tuple[str, ...]:
        """Return what the user should know of the lines in his scenarios."""
        return () if self.rules is None else self.rules.outside(self.scene.width, self.scene.height)

    def of_classes(self, regions: int) -> tuple[str, ...]:
        """Return what the user should know about the wanted classes, of which there were so many regions in all."""
        if not self.classes or regions or recorded(self.detector):
            return ()
        words = " or ".join(self.classes)
        return (
            f"no region was of class {words}; without --class, `perdure detect` shows which classes there are",
        )

    def _of_ground(self) -> tuple[str, ...]:
        """What the user should know of the ground that was to be estimated."""
        if self.estimate is None:
            return ()
        told = self.estimate
        if not told.verdict:
            off = [math.sqrt(told.covariance[place, place]) for place in (3, 1)]
            return (
                f"the ground plane is estimated from {told.people} people: the camera is {told.height:.1f} m "
                f"± {told.height * off[0]:.1f} above it, tilted by {math.degrees(told.tilt):.0f}° ± {math.degrees(off[1]):.0f}",
            )
        return (f"the ground plane is not known ({self.estimate.verdict}); give --calibration FILE",)

    def _of_contexts(self) -> tuple[str, ...]:
        """What the user should know about the contexts and the network that he named."""
        pictures, ground = self.source.has_images, self.scene.ground is not None
        return equipment.notes(self.tracker, self.contexts, pictures=pictures, ground=ground)

    def _of_marks(self) -> tuple[str, ...]:
        """What the user should know about his marks."""
        if not self.init or follows_marks(self.tracker):
            return ()
        return (f"the tracker {self.tracker_name} does not follow marks: it knows of each in its own frame only",)

    def _of_detections(self) -> tuple[str, ...]:
        """What the user should know about his file of detections."""
        detector = recorded(self.detector)
        if detector is None or not self.source.count:
            return ()
        frames, count = detector.regions.keys(), self.source.count
        if not frames:
            return ("the file of detections is empty",)
        if self.classes:
            there = {str(name) for index in islice(frames, 500) for name in detector.regions[index].classes}
            if there.isdisjoint(self.classes):
                return (
                    f"no region is of class {', '.join(self.classes)}; there are {', '.join(sorted(there)) or 'none'}",
                )
        if len(frames) >= _LEAST_COVER * count and min(frames) < count:
            return ()
        return (
            f"the file of detections covers {len(frames)} frames ({min(frames)} to {max(frames)}); the source has {count}",
        )

    def seen(self, frames: Iterable[Frame] | None = None) -> Iterator[tuple[Frame, Regions]]:
        """Yield every frame with its regions, of the wanted classes only."""
        for frame, regions in fold.detect(self.source if frames is None else frames, self._whole(), self.scene):
            yield frame, self._wanted(regions)

    def steps(
        self,
        frames: Iterable[Frame] | None = None,
        begin: AnyStanding | None = None,
        between: Callable[[AnyStanding], None] | None = None,
    ) -> Iterator[fold.Step]:
        """Yield every step of the run, the finishing one last; `begin` and `between` as for `perdure.fold.run`."""
        given = self.source if frames is None else frames
        interpreter = self._interpreter()
        return fold.run(given, self._whole(), self.tracker, self.scene, self._wanted, interpreter, begin, between)

    def standing_kind(self) -> Any:
        """Return the type of where its run stands between two frames, for `perdure.states.load`.

        Raises
        ------
        StateError
            If the detector or the tracker does not say what its state is.
        """
        interpreter = self._interpreter()
        views = None if interpreter is None else kind_of(interpreter)
        return fold.Standing[kind_of(self._whole()), kind_of(self.tracker), views]  # type: ignore[misc]

    def _interpreter(self) -> Interpreter | Placing | None:
        """What interprets the tracker's reports; it puts rows on the ground, too."""
        if self.rules is not None:
            return Interpreter.of(self.scene, self.rules, self.feedback)
        return None if self.scene.ground is None else Placing(self.scene.ground)

    def _whole(self) -> Any:
        """The detector, with the marks beside it."""
        return WithMarks(self.detector, self.marks) if self.marks else self.detector

    def _wanted(self, regions: Regions) -> Regions:
        """The regions of the wanted classes, and what is marked."""
        if not self.classes:
            return regions
        marks = regions.data.get("mark", np.zeros(len(regions), np.int64))
        return regions.take(np.isin(regions.classes, self.classes) | (marks > 0))


def plan(
    source: AnySource,
    *,
    tracker: str | None = None,
    tracker_settings: AnySettings | None = None,
    tracker_environment: str | Path | None = None,
    detector: AnyDetector | None = None,
    box_masks: str | None = None,
    class_names: str | Path | Sequence[str] | None = None,
    init: AnyMark | Sequence[AnyMark] | None = None,
    fps: float | None = None,
    start: str | float | None = None,
    end: str | float | None = None,
    stride: int = 1,
    roi: str | None = None,
    calibration: str | Path | None = None,
    object_height: float | None = None,
    zones: str | Path | Zones | None = None,
    classes: str | Collection[str] | None = (),
    context: AnyContext | Sequence[AnyContext] | None = None,
    embedding: str | Path | None = None,
    scenarios: str | Path | Rules | None = None,
    parameters: Mapping[str, object] | None = None,
) -> Plan:
    """Open a source and make the detector and tracker for it.

    Parameters
    ----------
    source : str, Path, int or iterable of (H, W, 3) uint8 arrays
        A video, an image folder or glob, a MOTChallenge folder, a camera number, a URL, or pictures.
    tracker : str or None
        A name of `perdure.trackers.TRACKERS`, or LIBRARY:CLASS of another library ('trackers:ByteTrackTracker',
        'norfair:Tracker'); None for 'compound', or with `init` for the first that follows marks.
    tracker_settings, tracker_environment
        Of another library's tracker: arguments by name, as a mapping, JSON or a file of it; and the folder of the
        environment that has it, None for $PERDURE_PEERS, else this one.
    detector : str, Path, function, detector or None
        'background', 'people', 'onnx:FILE' or 'openvino:FILE' (a network), a file of regions (`.jsonl` of `perdure
        detect`, or MOTChallenge `.txt`), a function of a picture (`perdure.detect.Called`), or a detector with its
        parameters; None for the background, or for `det/det.txt` of a MOTChallenge folder without images.
    box_masks : str or None
        Silhouettes for a detector's boxes: 'background', by a background model, or 'cut', by colours; None: none.
    class_names : str, Path, sequence of str or None
        The names of a network's classes from number 0, or a file with one a line; None: those that it tells itself.
    init : str, Path, (H, W) array of whole numbers, pair of one of these and its frame, or list of these
        What the user marked, an index PNG or array (the value is the id, 0 nothing), a box 'x,y,w,h' or a polygon
        'x,y x,y x,y …', with '@FRAME' behind a text for another frame than 0. Where no detector is named there is
        none: only what is marked is followed.
    fps : float or None
        Frames per second, where the source has none or a wrong one.
    start, end : str, float or None
        Seconds, 'mm:ss', 'h:mm:ss', or a frame as '300f'; start inclusive, end exclusive.
    stride : int
        Take every n-th frame.
    roi : str or None
        Where things may be seen: an image, a polygon, a box or a file of polygons.
    calibration : str, Path or None
        A calibration file of the ground plane: places are then told in metres. 'auto': estimated, in a first look
        over the source, from people who walk on it.
    object_height : float or None
        With 'auto': metres that they are high on the mean; None for 1.7.
    zones : str, Path, Zones or None
        Entries, exits, occluders and other zones of the place, and rules between them: a file of GeoJSON.
    classes : str or collection of str
        Only regions of these classes.
    context : str, Path, Context, sequence of them, or None
        For the multi-feature tracker, what its features weigh: files of `perdure learn`, of which the nearest to the
        video is in force; 'auto', those that come with Perdure; 'default', its own weights.
    embedding : str, Path or None
        For the multi-feature tracker, an ONNX file of a network by which looks are told apart, too.
    scenarios : str, Path, Rules or None
        Scenarios that are to be recognised: a file of them, or 'usual' for those that come with Perdure. Targets that are
        taken for noise are then taken back, and who does something of interest is kept for longer.
    parameters : mapping
        Values of the detector's and tracker's parameters by name, and of `perdure.interpret.Feedback` with scenarios.

    Raises
    ------
    VideoError, FormatError, ParameterError
        The caller's mistake, in one line.
    """
    words = () if init is None else words_of(init)
    tracker = _default_tracker(marked=bool(words)) if tracker is None else tracker
    foreign = made_foreign(tracker, tracker_settings, tracker_environment)
    if foreign is None and (not isinstance(tracker, str) or tracker not in TRACKERS):
        raise ParameterError(params.unknown_name("tracker", tracker, TRACKERS))
    name = "marked" if words and detector is None else detector_name(detector)
    opened = open_source(source, fps=fps, start=start, end=end, stride=stride)
    try:
        if detector is None and not words and not opened.has_images:
            detector, name = _own_detections(opened), "recorded"
        rules = scenarios if isinstance(scenarios, Rules) or scenarios is None else read_rules(scenarios)
        of_feedback, others = of_scenarios(parameters or {}, rules)
        of_tracker, of_detector = split(others, tracker, name, box_masks)
        made_tracker = params.build(TRACKERS[tracker], of_tracker) if foreign is None else foreign
        made_tracker = equipped(made_tracker, tracker, context, embedding)
        seeing = made_detector(detector, name, of_detector, class_names, box_masks)
        scene = opened.scene(None if roi is None else read_roi(roi, opened.width, opened.height))
        body = _body(opened, calibration, object_height)
        if calibration is not None and not body:
            ground = read_calibration(calibration, opened.width, opened.height)
            scene = dataclasses.replace(scene, ground=ground)
        if zones is not None:
            scene = zoned(scene, zones)
        if rules is not None:
            rules.check_zones(tuple(one.name for one in scene.zones))
        marks: tuple[Mark, ...] = ()
        if init is not None and words:
            _refuse_late_start(opened, start)
            marks = read_marks(init, scene, opened.wanted)
        if name == "marked":
            seeing, marks = Marked(marks=marks), ()
        if marks and follows_marks(made_tracker):
            made_tracker = dataclasses.replace(made_tracker, reserved=max(mark.id for mark in marks))
        wanted = (classes,) if isinstance(classes, str) else tuple(classes or ())
        made = Plan(
            opened,
            scene,
            name,
            seeing,
            tracker,
            made_tracker,
            wanted,
            words,
            marks,
            body,
            contexts=equipment.words_of(context),
            rules=rules,
            feedback=params.build(Feedback, of_feedback),
        )
        made.check()
    except BaseException:
        opened.close()
        raise
    return made


def _body(source: Source, calibration: str | Path | None, object_height: float | None) -> float:
    """The height of people by which the ground is to be estimated; 0 where it is not."""
    if str(calibration) != AUTO:
        if object_height is not None:
            raise ParameterError("--object-height goes with --calibration auto; leave it out")
        return 0.0
    if not source.rereadable:
        raise ParameterError(
            f"{source.name} passes only once, without a first look; `perdure calibrate RUN` makes a calibration of a run"
        )
    return check_body(object_height)


def check_body(height: float | None) -> float:
    """Return the height of people in metres, 1.7 if none is given; refuse what nobody is."""
    if height is None:
        return BODY
    if not (isinstance(height, (int, float)) and 0.05 <= height <= 20.0):
        raise ParameterError(f"object_height = {height!r} is out of range: it must be 0.05 to 20 m")
    return float(height)


def track(source: AnySource, **options: Any) -> Tracks:
    """Track every moving thing in a source and return the settled tracks.

    Every status is among the rows; `counted()` leaves those that count for results. A damaged video gives a
    warning and the tracks of everything before the damage.

    Parameters
    ----------
    source : str, Path, int or iterable of (H, W, 3) uint8 arrays
        A video, an image folder or glob, a MOTChallenge folder, a camera number, a URL, or pictures.
    options
        Those of `plan`: tracker, tracker_settings, tracker_environment, detector, box_masks, class_names, init, fps,
        start, end, stride, roi, zones, calibration, object_height, classes, context, embedding, scenarios; and parameters of the detector and the tracker by name.

    Raises
    ------
    VideoError, FormatError, ParameterError
        The caller's mistake, in one line.

    >>> blank = np.zeros((48, 64, 3), np.uint8)
    >>> len(track([blank, blank, blank], patience=2.0))
    0
    """
    made = plan(source, **_sorted_options(options))
    reports: list[Report] = []
    regions = 0
    try:
        for step in made.prepared().steps():
            reports.append(step.report)
            regions += len(step.regions)
    except DamagedVideo as damage:
        warnings.warn(str(damage), RuntimeWarning, stacklevel=2)
    finally:
        made.source.close()
    unusable = left_out(event for report in reports for event in report.events)
    for note in (*unusable.notes, *made.of_classes(regions)):
        warnings.warn(note, RuntimeWarning, stacklevel=2)
    return fold.settle(reports)


def follow(source: AnySource, **options: Any) -> Iterator[fold.Step]:
    """Yield (frame, regions, report) as each frame comes, for live use; options as for `track`.

    Examples
    --------
    >>> blank = np.zeros((48, 64, 3), np.uint8)
    >>> [len(step.report.rows) for step in follow([blank, blank])]
    [0, 0, 0]
    """
    made = plan(source, **_sorted_options(options))
    try:
        yield from made.prepared().steps()
    finally:
        made.source.close()


def zoned(scene: Scene, zones: str | Path | Zones) -> Scene:
    """Return the scene with zones, read from a file where one is named; what is to be ignored is cut out of its roi."""
    if not isinstance(zones, Zones):
        zones = read_zones(zones, scene.width, scene.height)
    ignored = [list(map(list, rings)) for one in zones.zones if one.kind == "ignore" for rings in one.polygons]
    roi = scene.roi
    if ignored:
        seen = ~filled(ignored, scene.width, scene.height)
        roi = seen if roi is None else roi & seen
    return dataclasses.replace(scene, zones=zones.zones, rules=zones.rules, roi=roi)


def follows_marks(tracker: object) -> bool:
    """Return whether a tracker goes on from what the user marked, with no detector."""
    return bool(getattr(tracker, "follows_marks", False))


def _default_tracker(*, marked: bool) -> str:
    """The tracker where none is named."""
    if not marked:
        return "compound"
    known = [name for name, kind in TRACKERS.items() if follows_marks(kind)]
    return "trackcut" if "trackcut" in known else known[0] if known else "compound"


def _refuse_late_start(source: Source, start: str | float | None) -> None:
    """Refuse marks in a source that passes once where its frame 0, the only one to mark, is left out."""
    if source.wanted is None and start is not None:
        raise ParameterError(
            f"{source.name} passes only once: its frame 0 is the one to mark; leave out --start or --init"
        )


def _sorted_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Keep the options of `plan`; all else are parameters by name."""
    known = set(inspect.signature(plan).parameters) - {"source"}
    own = {key: value for key, value in options.items() if key in known}
    others = {key: value for key, value in options.items() if key not in known}
    return {**own, "parameters": {**(own.get("parameters") or {}), **others}}


def _own_detections(source: Source) -> Path:
    """Return det/det.txt of a MOTChallenge folder without images."""
    folder = (source.folder or Path()) / "det"
    if (folder / "det.txt").is_file():
        return folder / "det.txt"
    there = sorted(str(one) for one in folder.glob("det*.txt"))
    hint = f"name one with --detector: {', '.join(there)}" if there else "name a file with --detector"
    raise ParameterError(f"{source.name} has no images and no det/det.txt; {hint}")
