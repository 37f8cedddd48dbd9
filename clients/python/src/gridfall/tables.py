"""Rows of numbers as NumPy's structured arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def table(rows: Iterable[Mapping[str, Any]]) -> NDArray[np.void]:
    """One record a row, `table["time_s"]` a column. Whole numbers and truth values stay so; null is nan."""
    rows = list(rows)
    names = list(dict.fromkeys(name for row in rows for name in row))
    made = np.zeros(len(rows), dtype=[(name, _kind(row.get(name) for row in rows)) for name in names])
    for name in names:
        made[name] = [np.nan if row.get(name) is None else row[name] for row in rows]
    return made


def _kind(values: Iterable[Any]) -> type[np.generic]:
    kinds = {type(value) for value in values}
    return np.bool_ if kinds == {bool} else np.int64 if kinds == {int} else np.float64


def columns(rows: Iterable[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """One array a column. Numbers as in `table`, texts as texts, and anything else as objects; null is None there."""
    rows = list(rows)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> NDArray[Any]:
    kinds = {type(value) for value in values}
    if kinds <= {bool} or kinds <= {int, float, type(None)}:
        return np.array([np.nan if value is None else value for value in values], dtype=_kind(values))
    if kinds == {str}:
        return np.array(values)
    # Lists of one length would become a table.
    objects = np.empty(len(values), dtype=object)
    objects[:] = values
    return objects
