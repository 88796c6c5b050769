"""The bar that `progress=True` shows."""

from __future__ import annotations

import sys
import time

_WIDTH = 24
_STEP = 0.05  # seconds between two drawings


class Bar:
    """A line on standard error that is drawn anew; one line a stage where it is no terminal."""

    def __init__(self) -> None:
        self._stream = sys.stderr
        # Notebooks draw over a line as terminals do.
        self._is_live = self._stream.isatty() or "ipykernel" in sys.modules
        self._start = time.monotonic()
        self._drawn = 0.0
        self._what = ""
        self._length = 0

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        is_new = what != self._what
        if not is_new and (not self._is_live or (now - self._drawn < _STEP and share < 1)):
            return
        self._what, self._drawn = what, now
        share = min(max(share, 0.0), 1.0)
        line = f"{what}: {share:4.0%} |{'#' * round(share * _WIDTH):<{_WIDTH}}| {now - self._start:.1f} s"
        if self._is_live:
            self._stream.write("\r" + line.ljust(self._length))
            self._length = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def close(self) -> None:
        if self._is_live and self._length:
            self._stream.write("\r" + " " * self._length + "\r")
            self._stream.flush()
