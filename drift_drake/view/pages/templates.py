"""Templates of pages: escaped, with the look and the parts that all pages share."""

from pathlib import Path

import jinja2
from markupsafe import Markup

from drift_drake.common.errors import significant

FOLDER = Path(__file__).parent


def templates(*folders: Path) -> jinja2.Environment:
    """Templates of folders, and of this one: `look.css` is every page's look, `macros.html` has its parts."""
    loader = jinja2.FileSystemLoader([*folders, FOLDER])
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["significant"] = significant
    return environment


def part(name: str, *given: object) -> Markup:
    """What one of the macros of `macros.html` makes of what it is given."""
    return Markup(getattr(templates().get_template("macros.html").module, name)(*given))
