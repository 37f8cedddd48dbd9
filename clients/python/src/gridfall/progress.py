"""How far a job has come, shown while it is waited for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Protocol

from .models import Job, Sweep

Watcher = Callable[[Job], None]
"""What is called whenever a job has come further."""


class _Bar(Protocol):
    def update(self, n: float) -> Any: ...
    def set_postfix_str(self, text: str) -> Any: ...
    def close(self) -> Any: ...


class _Plain:
    """A line on standard error, for those without tqdm."""

    def __init__(self, name: str) -> None:
        self.name, self.fraction = name, 0.0

    def update(self, n: float) -> None:
        self.fraction += n

    def set_postfix_str(self, text: str) -> None:
        print(f"\r{self.name} {self.fraction:4.0%} {text:<40}", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        print(file=sys.stderr)


class Progress:
    """Shows a bar, calls a function, or does nothing."""

    def __init__(self, how: bool | Watcher) -> None:
        self.how = how
        self.bar: _Bar | None = None
        self.fraction = 0.0

    def job(self, job: Job) -> None:
        """Shows how far a job has come."""
        if callable(self.how):
            self.how(job)
        elif self.how:
            progress = job.progress
            left = f", {progress.eta_s:.0f} s left" if progress.eta_s is not None else ""
            text = f"frame {progress.frames_written}/{progress.frames}{left}"
            self._show(job.name, progress.fraction, text if job.status == "running" else job.status)

    def sweep(self, sweep: Sweep) -> None:
        """Shows how far all jobs of a sweep have come."""
        if self.how is True:
            self._show(sweep.name, sweep.fraction, ", ".join(f"{n} {status}" for status, n in sweep.jobs.items() if n))

    def _show(self, name: str, fraction: float, text: str) -> None:
        if self.bar is None:
            self.bar = _bar(name)
        # A job that its server took up again begins anew.
        self.bar.update(fraction - self.fraction)
        self.bar.set_postfix_str(text)
        self.fraction = fraction

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


def _bar(name: str) -> _Bar:
    try:
        from tqdm import tqdm
    except ImportError:
        return _Plain(name)
    shape = "{desc} {percentage:3.0f}%|{bar}|{postfix} [{elapsed}]"
    bar: _Bar = tqdm(desc=name, total=1.0, bar_format=shape)
    return bar
