"""mkdocs hook: the results by date are on the site, outside its navigation, and links to and from them hold."""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).parent
FOLDER = "results_by_date"  # on the site


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages of this folder, and their pictures."""
    for path in sorted([*HERE.glob("*.md"), *HERE.glob("*.png")]):
        files.append(File.generated(config, f"{FOLDER}/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Links as they are on the site; in the repository they name the files' places there."""
    if page.file.src_uri.startswith(FOLDER):
        return markdown.replace("](../../docs/", "](../")
    return markdown.replace("](../experiments/results/", f"]({FOLDER}/")
