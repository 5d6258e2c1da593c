"""The documentation's commands exist with their options, and what is marked to be run runs, page by page."""

import dataclasses
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import tyro

import drift_drake
from drift_drake.cli.main import load, main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
RESULTS = sorted((ROOT / "experiments" / "results").glob("*.md"))  # by date: their commands exist, none is run
FENCE = re.compile(r"(<!-- run -->\n)?```(\w*)\n(.*?)```", re.DOTALL)
MARKED = [page for page in PAGES if "<!-- run -->" in page.read_text(encoding="utf-8")]


def blocks(page):
    """(to be run, language, text) of each fenced block."""
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    return [(bool(mark), language, text) for mark, language, text in found]


def commands(text):
    """Words of each command line, continued lines joined, redirections and pipes left out."""
    lines = text.replace("\\\n", " ").splitlines()
    given = [line.removeprefix("$ ") for line in lines if line.startswith(("$ drift-drake", "drift-drake "))]
    return [shlex.split(re.split(r" [>|] ", line)[0], comments=True)[1:] for line in given]


def names(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", [*PAGES, *RESULTS], ids=names)
def test_commands_exist_and_take_the_options(page):
    for _, language, text in blocks(page):
        if language not in ("console", ""):
            continue
        for name, *rest in commands(text):
            if not name.startswith("-") and name.islower():
                options, _ = load(name)
                tyro.cli(options, args=rest)  # SystemExit where an option is unknown


@pytest.mark.parametrize("page", [*PAGES, *RESULTS], ids=names)
def test_links_and_pictures_are_there(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{names(page)}: {target}"


@pytest.mark.parametrize("page", [*PAGES, *RESULTS], ids=names)
def test_files_and_modules_that_are_named_are_there(page):
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"[`\s]((?:[a-z_]+/)+[a-z_]+\.(?:py|yaml|npz|json))\b", text):
        places = [ROOT / path, ROOT / "drift_drake" / path, page.parent / path]
        made_up = path.startswith(("runs/", "logs/", "answers/", "my_package/"))
        assert made_up or any(place.exists() for place in places), f"{names(page)}: {path}"
    for folder in re.findall(r"`((?:experiments|drift_drake|examples|diagrams)/[a-z_/]+)`", text):
        assert (ROOT / folder).exists(), f"{names(page)}: {folder}"
    for module in re.findall(r"\b(?:python -m |`)((?:experiments|diagrams|drift_drake)(?:\.[a-z_0-9]+)+)", text):
        parts = module.split(".")
        assert any(
            (ROOT.joinpath(*parts[:n])).with_suffix(".py").exists()
            or (n == len(parts) and ROOT.joinpath(*parts).is_dir())
            for n in range(2, len(parts) + 1)
        ), f"{names(page)}: {module}"


def test_the_api_page_has_every_name_of_the_library():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    listed = {line.rsplit(".", 1)[1] for line in page.splitlines() if line.startswith("::: drift_drake.")}
    assert listed == set(drift_drake.__all__)


@pytest.mark.parametrize("page", [*PAGES, *RESULTS], ids=names)
def test_python_is_python(page):
    for _, language, text in blocks(page):
        if language == "python":
            compile(text, str(page), "exec")


@pytest.mark.parametrize("page", MARKED, ids=names)
def test_marked_snippets_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    figure_8 = drift_drake.figure_8
    shortened = lambda car: dataclasses.replace(figure_8(car), distance=10.0)  # noqa: E731
    monkeypatch.setattr(drift_drake, "figure_8", shortened)  # a minute otherwise
    space = {"__name__": "docs"}
    for marked, language, text in blocks(page):
        if not marked:
            continue
        if language == "python":
            exec(compile(text, str(page), "exec"), space)
        for words in commands(text) if language == "console" else []:
            assert main(words) == 0, capsys.readouterr().err


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    pytest.importorskip("mkdocs", reason="the site is an extra: pip install 'drift_drake[docs]'")
    pytest.importorskip("mkdocstrings", reason="the site is an extra: pip install 'drift_drake[docs]'")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
