"""The site: every page is in it, what is read off the code is as the code, and the example runs."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import json
import re
from pathlib import Path

import reference
import site_pages

import perdure
from perdure import params

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
NAVIGATION = re.findall(
    r"^ +- .+: (\S+)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:")[1], re.M
)


def test_every_page_is_in_the_navigation_once():
    assert sorted(NAVIGATION) == sorted([*(page.name for page in DOCS.glob("*.md")), "example.md"])


def test_the_pages_that_are_read_off_the_code_are_as_the_code():
    remedy = "run `python docs/reference.py`"
    assert (DOCS / "parameters.md").read_text(encoding="utf-8") == reference.parameters_page(), remedy
    assert (DOCS / "api.md").read_text(encoding="utf-8") == reference.api_page(), remedy


def test_everything_that_declares_parameters_is_in_the_page_of_parameters():
    told = {kind for _, kinds in reference.FAMILIES.values() for kind in kinds.values()}
    for path in (ROOT / "src").rglob("*.py"):
        if re.search(r"= (params\.)?parameter\(", path.read_text(encoding="utf-8")):
            module = importlib.import_module(".".join(path.relative_to(ROOT / "src").with_suffix("").parts))
            for name, kind in inspect.getmembers(module, inspect.isclass):
                own = kind.__module__ == module.__name__ and dataclasses.is_dataclass(kind)
                if own and params.describe(kind) and not name.startswith("_"):
                    assert kind in told, f"{name} of {path.name}: put it into FAMILIES of docs/reference.py"


def test_the_page_of_the_api_has_every_public_name():
    assert sorted(name for names in reference.GROUPS.values() for name in names) == sorted(perdure.__all__)


def test_the_example_runs_and_shows_two_people_who_keep_their_ids(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    said: dict[str, object] = {}
    exec(compile(site_pages.code_of(site_pages.NOTEBOOK), "example.ipynb", "exec"), said)
    assert set(said["counted"].ids.tolist()) == {1, 2}
    assert said["figures"]["IDSW"] == 0
    assert re.search(r"merge +\(1, 2\)", capsys.readouterr().out)
    assert (tmp_path / "trails.png").read_bytes().startswith(b"\x89PNG")


def test_the_example_is_a_notebook_without_outputs_and_a_page_of_the_site():
    notebook = json.loads(site_pages.NOTEBOOK.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], [cell for cell in notebook["cells"] if cell.get("outputs")]) == (4, [])
    page = site_pages.page_of(notebook)
    assert page.startswith("# An example to run")
    assert "```python\nimport perdure\n" in page
