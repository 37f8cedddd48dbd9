"""Gridfall: material point simulations on a server, or in a program that comes along.

>>> import gridfall
>>> with gridfall.local() as g:
...     g.run(g.library_scene("quickstart")).recording.save("quickstart.mcap")

`Client` and `AsyncClient` use a server, `local` brings its own, `Recording` reads what runs leave,
and `gridfall.scene` has scenes as objects.
"""

from importlib.metadata import version as _version

from . import scene
from .client import AsyncClient, Client
from .errors import (
    ApiError,
    Conflict,
    GridfallError,
    InvalidScene,
    JobFailed,
    NotAllowed,
    NotFinished,
    NotFound,
    NotReady,
    ProgramError,
    RecordingError,
    ServerUnreachable,
)
from .local import local, program, serve
from .models import Job, Sweep, ValidScene
from .recording import Frame, Frames, Recording
from .result import Result
from .scene import Scene

__version__ = _version("gridfall")

__all__ = [
    "ApiError",
    "AsyncClient",
    "Client",
    "Conflict",
    "Frame",
    "Frames",
    "GridfallError",
    "InvalidScene",
    "Job",
    "JobFailed",
    "NotAllowed",
    "NotFinished",
    "NotFound",
    "NotReady",
    "ProgramError",
    "Recording",
    "RecordingError",
    "Result",
    "Scene",
    "ServerUnreachable",
    "Sweep",
    "ValidScene",
    "local",
    "program",
    "scene",
    "serve",
]
