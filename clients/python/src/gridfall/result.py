"""What a run leaves."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .models import Job
from .recording import Frames, Recording


class Picture(bytes):
    """A PNG; notebooks show it."""

    def _repr_png_(self) -> bytes:
        return bytes(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the file. Returns where it is."""
        Path(path).write_bytes(self)
        return Path(path)


@dataclass(frozen=True, eq=False)
class Result:
    """A job that has ended, and its recording."""

    job: Job
    """The job: device, times, notices."""
    recording: Recording
    """Its recording."""

    @property
    def frames(self) -> Frames:
        """The frames, as NumPy arrays."""
        return self.recording.frames

    @property
    def diagnostics(self) -> NDArray[np.void]:
        """Energies, momenta, mass and time steps, a row a frame: `diagnostics["kinetic_j"]`."""
        return self.recording.diagnostics

    @property
    def solver(self) -> NDArray[np.void]:
        """How the implicit integrator fared, a row a step; empty of explicit runs."""
        return self.recording.solver
