"""What the site adds to the pages when mkdocs builds it: docstrings in api.md, and the notebook as a page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).parent / "example.ipynb"


def on_files(files: Any, config: Any) -> Any:
    """Add the page of the notebook."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "example.md", content=page_of(json.loads(NOTEBOOK.read_text("utf-8")))))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Ask mkdocstrings for the docstrings of what api.md names in comments."""
    return re.sub(r"<!-- api: (\S+) -->", r"::: \1\n", markdown)


def page_of(notebook: dict[str, Any]) -> str:
    """The cells of a notebook as one page: text as it is, code in blocks."""
    cells = ["".join(cell["source"]) for cell in notebook["cells"]]
    kinds = [cell["cell_type"] for cell in notebook["cells"]]
    shown = [
        f"```python\n{text}\n```" if kind == "code" else text for text, kind in zip(cells, kinds, strict=True)
    ]
    return "\n\n".join([*shown, "[Take the notebook](example.ipynb)\n"])


def code_of(notebook: Path) -> str:
    """The cells of code of a notebook, one after the other."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
