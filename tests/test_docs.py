"""What the documents promise is there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import perdure
from perdure import params
from perdure.detect import DETECTORS
from perdure.files.live_source import Patience
from perdure.interpret import Feedback
from perdure.learn import Learning
from perdure.trackers import TRACKERS

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(page: Path):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in link:
            assert (page.parent / link).exists(), f"{page.name} links to {link}"


def test_every_option_that_the_documents_name_exists():
    named = {
        option
        for page in PAGES
        for option in re.findall(r"(?<![\w-])--([a-z][a-z-]+)", page.read_text(encoding="utf-8"))
    }
    parameters = [
        one
        for kind in (*TRACKERS.values(), *DETECTORS.values(), Learning, Feedback, Patience)
        for one in params.describe(kind)
    ]
    declared = {one.name.replace("_", "-") for one in parameters}
    declared |= {f"no-{one.name.replace('_', '-')}" for one in parameters if one.kind is bool}
    programs = [*(ROOT / "src/perdure/cli").glob("*.py"), *(ROOT / "bench").glob("*.py")]
    source = "".join(path.read_text(encoding="utf-8") for path in programs)
    elsewhere = {
        "help",
        "check",
        "report-confidence",
        "no-deps",
        "head",
        "port",
        "address",
    }  # ours, ruff's, one read off its declaration, pip's, Ray's
    assert {one for one in named if one not in declared | elsewhere and f'"--{one}"' not in source} - {
        "tracker"
    } == set()


def test_the_notice_names_every_library_that_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [one for name, many in project["optional-dependencies"].items() if name != "dev" for one in many]
    notice = (ROOT / "NOTICE").read_text(encoding="utf-8")
    for requirement in [*project["dependencies"], *extras]:
        assert re.match(r"[\w-]+", requirement)[0] in notice, f"{requirement} is not in NOTICE"


def test_the_citation_and_the_changelog_are_of_this_version():
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {perdure.__version__}\nlicense: Apache-2.0\n" in cited
    assert (
        perdure.__version__ in re.findall(r"^## .*", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)[0]
    )


def test_every_bench_that_the_documents_name_takes_its_options():
    for page in PAGES:
        for name, rest in re.findall(r"python bench/(\w+)\.py([^`\n]*)", page.read_text(encoding="utf-8")):
            source = (ROOT / "bench" / f"{name}.py").read_text(encoding="utf-8")
            for option in set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", rest)) - {"--help"}:
                assert f'"{option}"' in source, f"{page.name}: bench/{name}.py has no {option}"
