"""Builds the wheel: with the program by maturin, or with the module alone by flit.

The one with the program is the default. `GRIDFALL_WHEEL=pure pip wheel .` makes the other, which needs no Rust.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

_PURE = os.environ.get("GRIDFALL_WHEEL") == "pure"
_NEEDS = ["flit_core>=3.12,<4"] if _PURE else ["maturin>=1.9.4,<2"]


def _backend() -> Any:
    return importlib.import_module("flit_core.buildapi" if _PURE else "maturin")


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    return _NEEDS


get_requires_for_build_editable = get_requires_for_build_sdist = get_requires_for_build_wheel


def build_wheel(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    name: str = _backend().build_wheel(wheel_directory, config_settings, metadata_directory)
    return name


def build_editable(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    name: str = _backend().build_editable(wheel_directory, config_settings, metadata_directory)
    return name


def build_sdist(sdist_directory: str, config_settings: Any = None) -> str:
    name: str = _backend().build_sdist(sdist_directory, config_settings)
    return name
