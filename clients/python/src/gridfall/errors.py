"""What may go wrong, as exceptions with stable codes."""

from __future__ import annotations

import json
from typing import Any

from .models import Fault, Job


class GridfallError(Exception):
    """What all errors of this package are."""

    code: str = "error"
    """Stable, for programs; of the server's errors docs/ERRORS.md says what each means."""


class ServerUnreachable(GridfallError):
    """The server did not answer, however often it was asked."""

    code = "server_unreachable"


class ProgramError(GridfallError):
    """The program `gridfall` is not there, or does not start."""

    code = "program"


class RecordingError(GridfallError):
    """A file is not a recording, or not a whole one."""

    code = "recording"


class NotFinished(GridfallError):
    """A job has not ended in the time given."""

    code = "not_finished"

    def __init__(self, job: Job) -> None:
        super().__init__(f"job {job.id} is still {job.status}, {job.progress.fraction:.0%} done")
        self.job = job


class JobFailed(GridfallError):
    """A job that was waited for did not succeed: it failed or was canceled."""

    def __init__(self, job: Job) -> None:
        failure = job.failure
        self.job = job
        self.code = failure.code if failure else job.status
        self.remedy = failure.remedy if failure else None
        lines = [f"job {job.id} ({job.name}) {job.status}"]
        if failure:
            lines = [f"{lines[0]}: {failure.message} [{failure.code}]"]
            lines += [f"  what to do: {failure.remedy}"] if failure.remedy else []
        super().__init__("\n".join(lines))


class ApiError(GridfallError):
    """The server refused a request (RFC 9457)."""

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        self.status = status
        """The HTTP status."""
        self.code = str(problem.get("code", "unknown"))
        self.title = str(problem.get("title", f"HTTP {status}"))
        self.detail = str(problem.get("detail", ""))
        """What went wrong this time, and what to do about it."""
        self.faults = [Fault.from_dict(each) for each in problem.get("faults", [])]
        """All faults of a scene."""
        self.problem = problem
        """The whole answer."""
        lines = [f"{self.title} [{self.code}]"]
        lines += [self.detail] if self.detail and self.detail != self.title else []
        for fault in self.faults:
            lines += [f"  {fault.pointer}: {fault.reason} [{fault.code}]", f"    what to do: {fault.remedy}"]
        super().__init__("\n".join(lines))


class InvalidScene(ApiError):
    """A scene has faults, which `faults` lists all."""


class NotAllowed(ApiError):
    """The key is missing or not good, or it does not allow this; or a quota of it is used up."""


class NotFound(ApiError):
    """There is no such job, output, scene or asset."""


class NotReady(ApiError):
    """The server takes no more for now: its queue is full, or it is shedding load."""


class Conflict(ApiError):
    """What was asked for does not fit the state that things are in."""


def refusal(status: int, body: bytes) -> ApiError:
    """The exception for an answer that is an error."""
    try:
        problem = json.loads(body)
    except ValueError:
        problem = None
    if not isinstance(problem, dict):
        problem = {"title": f"HTTP {status}", "detail": body[:200].decode(errors="replace")}
    kinds: dict[int, type[ApiError]] = {
        401: NotAllowed,
        403: NotAllowed,
        404: NotFound,
        409: Conflict,
        412: Conflict,
        429: NotReady,
        503: NotReady,
    }
    kind = InvalidScene if problem.get("code") == "invalid_scene" else kinds.get(status, ApiError)
    return kind(status, problem)
