"""Python's values as JSON, for the native module."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any


def to_json(value: Any) -> str:
    """JSON of mappings, sequences, numbers, NumPy's numbers and arrays, and paths."""
    return json.dumps(value, default=_plain, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no plain value")
