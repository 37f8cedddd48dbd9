"""What a run leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .models import Job
from .recording import Frames, Recording


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
