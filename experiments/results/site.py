"""mkdocs hook: results by date and notebooks are on the site, outside its navigation, and links to them hold.

A search finds the pages by date after those for users.
"""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).parent
NOTEBOOKS = HERE.parents[1] / "examples" / "notebooks"
FOLDER = "results_by_date"  # on the site
LESS = {"boost": 0.01}  # of a page's rank in the search


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages of this folder, their pictures and tables, and the notebooks."""
    for path in sorted([*HERE.glob("*.md"), *HERE.glob("*.png"), *HERE.glob("*.csv")]):
        files.append(File.generated(config, f"{FOLDER}/{path.name}", abs_src_path=str(path)))
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        files.append(File.generated(config, f"notebooks/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Links as they are on the site; in the repository they name the files' places there."""
    if page.file.src_uri.startswith(FOLDER):
        page.meta["search"] = LESS
        return markdown.replace("](../../docs/", "](../")
    for place, there in (("experiments/results", FOLDER), ("examples/notebooks", "notebooks")):
        markdown = markdown.replace(f"](../{place}/", f"]({there}/")
    return markdown
