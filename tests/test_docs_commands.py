"""Every command in README and docs is one that the real option parser takes, and those that can run do run."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import sys
import tomllib
from pathlib import Path

import pytest
import typer
import typer.main
from documented import PAGES, ROOT, Command, named, typed
from stand_ins import stand_ins

from perdure import params
from perdure.cli import main
from perdure.cli.commands import app
from perdure.detect import DETECTORS
from perdure.files.live_source import Patience
from perdure.files.runs import Reporting
from perdure.interpret import Feedback
from perdure.learn import Learning
from perdure.trackers import TRACKERS

MISSING = "an argument or option is missing"  # as where the text names an option by itself
GROUP = typer.main.get_command(app)
USAGE = typer.BadParameter.__mro__[1]
DECLARED = {
    one.name: one
    for kind in (*TRACKERS.values(), *DETECTORS.values(), Reporting, Feedback, Learning, Patience)
    for one in params.describe(kind)
}
TYPED = [command for page in PAGES for command in typed(page)]
OURS = [command for command in TYPED if command.words[0] == "perdure"]
OTHERS = {
    "pip",
    "python3",
    "python",
    "~/peers/bin/pip",
    ".",
    "bash",
    "ruff",
    "mypy",
    "pytest",
    "mkdocs",
    "jq",
    "ray",
}
ABSENT = {  # what a command needs that no test has
    r"\blive\b": "a camera, or a stream",
    r"^view\b": "a browser: it serves until it is ended",
    r"^run\b": "many films",
    r"^tune\b": "many films with truths, and minutes",
    "trackers:": "another library, which tests/trackers/test_foreign.py draws",
    "norfair:": "another library, which tests/trackers/test_foreign.py draws",
}


def parsed(words: tuple[str, ...]) -> dict[str, object]:
    """What the command's own parser makes of the words; every declared parameter is held against its range."""
    name, *rest = words
    assert name in GROUP.commands, f"there is no command {name}"
    with GROUP.commands[name].make_context(name, list(rest)) as context:
        for one, value in context.params.items():
            if one in DECLARED and value is not None:
                params.check_value(DECLARED[one], value)
        return context.params


def fault(command: Command) -> str | None:
    """What the parser has against a command, if anything; help is no fault."""
    try:
        parsed(command.words[1:])
    except USAGE as error:
        said = error.format_message()
        return MISSING if said.startswith("Missing") or said.endswith("requires an argument.") else said
    except typer.Exit:
        return None
    return None


def why_not(command: Command) -> str | None:
    """Why a command cannot be run in a test."""
    text = " ".join(command.words[1:])
    return next((why for pattern, why in ABSENT.items() if re.search(pattern, text)), None)


@pytest.mark.parametrize("command", OURS, ids=str)
def test_every_command_that_is_typed_in_the_docs_is_understood(command: Command):
    parsed(command.words[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_the_text_names_has_its_options(page: Path):
    for command in named(page):
        assert fault(command) in (None, MISSING), command


def test_a_command_with_an_option_that_is_not_there_would_be_noticed():
    with pytest.raises(USAGE, match="No such option"):
        parsed(("track", "street.mp4", "--patiense", "2"))
    with pytest.raises(USAGE, match="Missing"):
        parsed(("track", "--no-video"))


def test_the_other_programs_of_the_docs_are_known_and_their_extras_are_there():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    assert {command.words[0] for command in TYPED} <= OTHERS | {"perdure"}
    for page in PAGES:
        for wanted in re.findall(r"pip install [^`\n]*?[.e]\[([\w,]+)\]", page.read_text(encoding="utf-8")):
            assert set(wanted.split(",")) <= set(extras), f"{page.name}: {wanted}"


def test_what_cannot_be_run_here_is_what_the_docs_have():
    reasons = {why_not(command) for command in OURS} - {None}
    assert reasons == set(ABSENT.values())


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that the commands of the docs name, drawn and tracked once."""
    return stand_ins(tmp_path_factory.mktemp("drawn"))


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted({command.page for command in OURS if why_not(command) is None}))
def test_the_commands_of_a_block_run_one_after_the_other(page: str, drawn: Path, tmp_path: Path):
    for command in OURS:
        if command.page == page and why_not(command) is None:
            place = tmp_path / str(command.block)
            if not place.exists():
                shutil.copytree(drawn, place, copy_function=os.link)
            make_room(command, place)
            code, said = run(command, place)
            assert code == 0, f"{command}\n{said}"


def make_room(command: Command, place: Path) -> None:
    """Take away what the command would have to write over."""
    words = parsed(command.words[1:])
    target = words.get("output")
    if target is None and command.words[1] == "track":
        target = Path("perdure-runs") / Path(str(words["source"])).stem
    if target is not None and command.words[1] != "demo":
        for path in (place / str(target), (place / str(target)).with_suffix(".png")):
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name != "mask.png":
                path.unlink(missing_ok=True)


def run(command: Command, place: Path) -> tuple[int, str]:
    """The exit code of a command in a folder, and all that it said."""
    said = io.StringIO()
    with (
        contextlib.chdir(place),
        pytest.MonkeyPatch.context() as patched,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
    ):
        patched.setattr(sys, "argv", list(command.words))
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0), said.getvalue()
