"""griffe extension of the site: a field without a docstring has the comment behind it, or the unit of its `entry`."""

import ast
from typing import Any

import griffe


class FieldComments(griffe.Extension):
    """Reads the comments of the fields of classes."""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Gives a field its docstring."""
        if attr.docstring or not attr.annotation or not attr.parent or not attr.parent.is_class:
            return
        if text := said(attr.source):
            attr.docstring = griffe.Docstring(text, parent=attr, lineno=attr.lineno)


def said(source: str) -> str:
    """What a field's source says of it; empty where that is nothing."""
    words = source.partition("#")[2].strip()
    field = ast.parse(source.strip()).body[0]
    value = field.value if isinstance(field, ast.AnnAssign) else None
    if isinstance(value, ast.Call) and ast.unparse(value.func) == "entry":
        unit, symbol = (ast.literal_eval(one) for one in value.args[:2])
        words = f"{symbol} [{unit}] {words}".strip()
    return words.replace("] [", "], [")  # which is no link then
