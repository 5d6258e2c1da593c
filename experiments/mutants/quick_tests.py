"""A pytest plug-in: test files in the order of the command line, without tests that take long.

Left out is what rests on a fixture of `tests.conftest` that takes long to make, what is marked as slow, and what
starts a process of its own.
"""

import inspect
import re
import sys
from typing import Any

import pytest

PROCESS = re.compile(r"\b(subprocess|Popen|sys\.executable)\b")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: Any, items: list[Any]) -> None:
    """After the suite's own order, which puts what takes longest first."""
    lists = [getattr(plugin, "LONG_TO_MAKE", {}) for plugin in config.pluginmanager.get_plugins()]
    long = {word for found in lists for name, made_of_it in found.items() for word in (name, *made_of_it)}
    places = {word: i for i, word in enumerate(sys.argv)}
    items[:] = [item for item in items if not takes_long(item, long)]
    items.sort(key=lambda item: places.get(item.nodeid.partition("::")[0], len(places)))


def takes_long(item: Any, fixtures: set[str]) -> bool:
    """Whether a test would cost a mutant too much; fixtures: names of those that take long to make."""
    if fixtures & set(item.fixturenames) or item.get_closest_marker("slow"):
        return True
    return PROCESS.search(inspect.getsource(item.function)) is not None
