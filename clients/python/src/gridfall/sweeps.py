"""What can be asked of a server about sweeps. `Client` and `AsyncClient` have these as methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from .document import Json
from .exchange import Call, Give, Manners, Pause, Talk, ask, collected
from .models import Job, Sweep, SweepList, SweepResults, ValidSweep
from .operations import jobs, result
from .progress import Progress
from .requests import SceneLike, decoded, given, id_of, once, scene_of
from .result import Result
from .tables import columns


def sweep(
    manners: Manners,
    scene: SceneLike,
    *,
    grid: Mapping[str, Sequence[Any]] | None = None,
    list: Sequence[Json] | None = None,  # noqa: A002
    overrides: Json | None = None,
    name: str | None = None,
    tags: Sequence[str] = (),
    priority: int | None = None,
    max_cost: float | None = None,
    idempotency_key: str | None = None,
) -> Talk[Sweep]:
    """Submits a scene with many values: each of `list` with each combination of `grid`.

    All jobs are judged first, and all are accepted or none. A lost connection is no danger, as in `submit`.

    - grid: values to combine, by path: `{"solver.cfl": [0.3, 0.5]}`.
    - list: overrides to run one after the other.
    - idempotency_key: one of your own, for submissions that outlive this program.
    """
    options = given(grid=grid, list=list, overrides=overrides, name=name, tags=[*tags], priority=priority)
    body = {**scene_of(scene), **options, **given(max_cost=max_cost)}
    call = Call("POST", "/v1/sweeps", json=body, headers=once(idempotency_key))
    return Sweep.from_dict(decoded((yield from ask(manners, call))))


def validate_sweep(
    manners: Manners,
    scene: SceneLike,
    *,
    grid: Mapping[str, Sequence[Any]] | None = None,
    list: Sequence[Json] | None = None,  # noqa: A002
    overrides: Json | None = None,
    name: str | None = None,
    max_cost: float | None = None,
) -> Talk[ValidSweep]:
    """What a sweep costs, in all and by job; raises `InvalidScene` with all faults of the first job that has some."""
    options = given(grid=grid, list=list, overrides=overrides, name=name, max_cost=max_cost)
    call = Call("POST", "/v1/sweeps:validate", json={**scene_of(scene), **options})
    return ValidSweep.from_dict(decoded((yield from ask(manners, call))))


def sweeps(manners: Manners, *, page: int = 50) -> Talk[None]:
    """All sweeps, newest first. Pages are fetched as they are needed."""
    cursor: str | None = None
    while True:
        params = {"limit": str(page), **given(cursor=cursor)}
        found = SweepList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/sweeps", params=params)))))
        for each in found.sweeps:
            yield Give(each)
        cursor = found.next_cursor
        if cursor is None:
            return


def sweep_results(manners: Manners, sweep: Sweep | str) -> Talk[dict[str, NDArray[Any]]]:
    """What the jobs of a sweep have come to so far: a column each, with a job a row, in the order of the values.

    - `id`, `status`, `fraction` (of the simulated time that is done) and `run_s`.
    - The values of the sweep, by their paths: `results["solver.cfl"]`.
    - The last, least and most of each column of the diagnostics: `results["max_speed.most"]`; nan where there is none.
    """
    call = Call("GET", f"/v1/sweeps/{id_of(sweep)}/results")
    found = SweepResults.from_dict(decoded((yield from ask(manners, call))))
    rows = []
    for job in found.jobs:
        row: dict[str, Any] = {"id": job.id, "status": job.status}
        row |= {"fraction": job.progress.fraction, "run_s": job.run_s, **job.values}
        for name, of in job.diagnostics.items():
            row |= {f"{name}.last": of.last, f"{name}.least": of.least, f"{name}.most": of.most}
        rows.append(row)
    return columns(rows)


def wait_sweep(manners: Manners, sweep: Sweep | str, *, progress: bool = False) -> Talk[Sweep]:
    """Waits until all jobs of a sweep have ended, well or not."""
    bar = Progress(progress)
    try:
        while True:
            answer = yield from ask(manners, Call("GET", f"/v1/sweeps/{id_of(sweep)}"))
            state = Sweep.from_dict(decoded(answer))
            bar.sweep(state)
            if state.ended:
                return state
            yield Pause(0.25)
    finally:
        bar.close()


def sweep_jobs(manners: Manners, sweep: Sweep | str) -> Talk[Sequence[Job]]:
    """The jobs of a sweep as they stand, in the order of the values."""
    found = yield from collected(jobs(manners, sweep=sweep))
    return found[::-1]


def run_sweep(
    manners: Manners,
    scene: SceneLike,
    *,
    grid: Mapping[str, Sequence[Any]] | None = None,
    list: Sequence[Json] | None = None,  # noqa: A002
    overrides: Json | None = None,
    name: str | None = None,
    tags: Sequence[str] = (),
    max_cost: float | None = None,
    progress: bool = True,
) -> Talk[Sequence[Result]]:
    """Runs a sweep and fetches all recordings, in the order of the values. Raises `JobFailed` if a job does."""
    submitted = yield from sweep(
        manners, scene, grid=grid, list=list, overrides=overrides, name=name, tags=tags, max_cost=max_cost
    )
    yield from wait_sweep(manners, submitted, progress=progress)
    results = []
    for each in (yield from sweep_jobs(manners, submitted)):
        results.append((yield from result(manners, each)))
    return results


def cancel_sweep(manners: Manners, sweep: Sweep | str) -> Talk[Sweep]:
    """Cancels all jobs of a sweep."""
    return Sweep.from_dict(decoded((yield from ask(manners, Call("POST", f"/v1/sweeps/{id_of(sweep)}/cancel")))))
