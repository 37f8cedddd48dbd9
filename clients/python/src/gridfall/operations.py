"""What can be asked of a server about scenes and jobs. `Client` and `AsyncClient` have these as methods."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .document import Json, MaterialPart, plain
from .errors import JobFailed, NotFinished
from .exchange import Answer, Call, Give, Manners, Pause, Talk, ask
from .models import Asset, AssetList, Changed, DeviceList, Job, JobList, KeptScene, LibraryScene, MaterialList
from .models import MaterialPreset, Ready, SceneList, Status, Sweep, ValidScene
from .outputs import recording
from .progress import Progress, Watcher
from .requests import ENDS, PathLike, SceneLike, commas, decoded, given, id_of, job_of, once, path, scene_of
from .result import Result
from .scene import Scene
from .tables import table

LONGEST_WAIT_S = 50
"""Servers answer after a minute at the latest."""


def ready(manners: Manners) -> Talk[Ready]:
    """Whether the server can take and run jobs; raises `NotReady`, which says why, if it cannot."""
    return Ready.from_dict(decoded((yield from ask(manners, Call("GET", "/readyz")))))


def devices(manners: Manners) -> Talk[DeviceList]:
    """The devices that jobs run on, the preferred one first."""
    return DeviceList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/devices")))))


def library(manners: Manners) -> Talk[list[LibraryScene]]:
    """The scenes that come with the program."""
    answer = yield from ask(manners, Call("GET", "/v1/library"))
    return [LibraryScene.from_dict(each) for each in decoded(answer)["scenes"]]


def library_scene(manners: Manners, name: str) -> Talk[Scene]:
    """A scene that comes with the program, to be run or changed."""
    return Scene.from_dict(decoded((yield from ask(manners, Call("GET", f"/v1/library/{name}")))))


def validate(manners: Manners, scene: SceneLike, *, overrides: Json | None = None) -> Talk[ValidScene]:
    """What a scene costs; raises `InvalidScene` with all its faults."""
    call = Call("POST", "/v1/scenes:validate", json={**scene_of(scene), **given(overrides=overrides)})
    return ValidScene.from_dict(decoded((yield from ask(manners, call))))


def element_test(
    manners: Manners,
    material: MaterialPart | Json,
    test: Literal["uniaxial", "triaxial", "shear", "oedometer"],
    *,
    strain: float | None = None,
    confining_pressure: float | None = None,
    steps: int | None = None,
    rate: float | None = None,
) -> Talk[NDArray[np.void]]:
    """Takes one element of a material through a test of a laboratory: a record a step, such as `curve["q"]`.

    - material: a preset (`scene.Preset(preset="dry-sand")`), or a model with its parameters.
    - strain: at the end; by default some times the strain at which the material yields.
    - confining_pressure: that a triaxial or shear test holds (Pa).
    - steps: 200 by default.
    - rate: strain per second, for viscosity and damping; without it, the test is slow.
    """
    options = given(strain=strain, confining_pressure=confining_pressure, steps=steps, rate=rate)
    call = Call("POST", "/v1/materials/test", json={"material": plain(material), "test": test, **options})
    curve = decoded((yield from ask(manners, call)))
    return table(dict(zip(curve["columns"], row, strict=True)) for row in curve["rows"])


def materials(manners: Manners) -> Talk[list[MaterialPreset]]:
    """The presets of materials, with their values and where these are from."""
    return MaterialList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/materials"))))).materials


def keep_scene(manners: Manners, scene: SceneLike) -> Talk[KeptScene]:
    """Keeps a scene on the server, to be run by its id. The same scene twice is one."""
    return KeptScene.from_dict(decoded((yield from ask(manners, Call("POST", "/v1/scenes", json=scene_of(scene))))))


def kept_scenes(manners: Manners) -> Talk[list[str]]:
    """The ids of the scenes that the server keeps."""
    return SceneList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/scenes"))))).ids


def kept_scene(manners: Manners, scene: KeptScene | str) -> Talk[Scene]:
    """A scene that the server keeps."""
    kept = scene if isinstance(scene, str) else scene.id
    return Scene.from_dict(decoded((yield from ask(manners, Call("GET", f"/v1/scenes/{kept}")))))


def assets(manners: Manners) -> Talk[list[Asset]]:
    """The meshes and particles that were uploaded."""
    return AssetList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/assets"))))).assets


def upload(manners: Manners, file: PathLike | bytes) -> Talk[Asset]:
    """Uploads a mesh or particles. Scenes name them by the `id`. The same bytes twice are one."""
    content = file if isinstance(file, bytes) else Path(file).read_bytes()
    headers = {"content-type": "application/octet-stream"}
    call = Call("PUT", "/v1/assets", content=content, headers=headers, timeout_s=300)
    return Asset.from_dict(decoded((yield from ask(manners, call))))


def submit(
    manners: Manners,
    scene: SceneLike,
    *,
    overrides: Json | None = None,
    name: str | None = None,
    tags: Sequence[str] = (),
    priority: int | None = None,
    deadline: datetime | None = None,
    max_cost: float | None = None,
    reuse: bool = False,
    start_from: Job | str | None = None,
    idempotency_key: str | None = None,
) -> Talk[Job]:
    """Puts a scene into the queue. It is judged first: `InvalidScene` has all faults at once.

    A lost connection is no danger: the request has a key, under which it is accepted once, and is sent again.

    - overrides: values that replace those of the scene, by path: `{"solver.kernel": "quadratic"}`.
    - name: the scene's by default.
    - tags: words to find the job by.
    - priority: jobs of a higher priority run first; 0 by default.
    - deadline: when the job must have been started.
    - max_cost: largest estimated wall time (s) that is accepted.
    - reuse: take the result of a finished job with the same scene, if there is one.
    - start_from: begin with the last state of this job, whose scene had `output.state`.
    - idempotency_key: one of your own, for submissions that outlive this program.
    """
    options = given(overrides=overrides, name=name, tags=list(tags), priority=priority, deadline=deadline)
    options |= given(max_cost=max_cost, reuse=reuse, start_from=id_of(start_from) if start_from else None)
    call = Call("POST", "/v1/jobs", json={**scene_of(scene), **options}, headers=once(idempotency_key))
    return job_of((yield from ask(manners, call)))


def rerun(
    manners: Manners,
    job: Job | str,
    *,
    overrides: Json | None = None,
    name: str | None = None,
    tags: Sequence[str] | None = None,
    priority: int | None = None,
    start_from: Job | str | None = None,
    idempotency_key: str | None = None,
) -> Talk[Job]:
    """Runs the scene of a job again, as a new job; what is not given is as it was.

    A lost connection is no danger, as in `submit`.
    """
    options = given(overrides=overrides, name=name, priority=priority)
    options |= {"tags": list(tags)} if tags is not None else {}
    options |= given(start_from=id_of(start_from) if start_from else None)
    call = Call("POST", f"{path(job)}/rerun", json=options, headers=once(idempotency_key))
    return job_of((yield from ask(manners, call)))


def job(manners: Manners, job: Job | str) -> Talk[Job]:
    """A job as it stands."""
    return job_of((yield from ask(manners, Call("GET", path(job)))))


def jobs(
    manners: Manners,
    *,
    status: Status | Sequence[Status] = (),
    tag: str | Sequence[str] = (),
    name: str | None = None,
    sweep: Sweep | str | None = None,
    created_after: datetime | None = None,
    created_before: datetime | None = None,
    page: int = 100,
) -> Talk[None]:
    """All jobs that have what is given, newest first. Pages are fetched as they are needed.

    - name: of this name, or of names that begin like this if it ends in `*`.
    """
    filters = given(status=commas(status), tag=commas(tag), name=name, sweep=id_of(sweep) if sweep else None)
    filters |= given(created_after=created_after, created_before=created_before)
    cursor: str | None = None
    while True:
        params = {key: str(value) for key, value in {**filters, "limit": page, **given(cursor=cursor)}.items()}
        answer = yield from ask(manners, Call("GET", "/v1/jobs", params=params))
        found = JobList.from_dict(decoded(answer))
        for each in found.jobs:
            yield Give(each)
        cursor = found.next_cursor
        if cursor is None:
            return


def watch(manners: Manners, job: Job | str) -> Talk[None]:
    """A job as it stands, again whenever it has come further, and at last as it ended."""
    tag = ""
    while True:
        answer = yield from _look(manners, job, LONGEST_WAIT_S if tag else 0, tag)
        if answer.status == 304:
            continue
        state, tag = job_of(answer), answer.headers["etag"]
        yield Give(state)
        if state.status in ENDS:
            return
        yield Pause(0.1)


def wait(
    manners: Manners,
    job: Job | str,
    *,
    timeout_s: float | None = None,
    progress: bool | Watcher = False,
    check: bool = True,
) -> Talk[Job]:
    """Waits until a job has ended, and returns it.

    - timeout_s: raise `NotFinished` after so long.
    - progress: show a bar, or call a function with the job whenever it has come further.
    - check: raise `JobFailed` unless it succeeded.
    """
    until = monotonic() + timeout_s if timeout_s is not None else float("inf")
    bar = Progress(progress)
    try:
        state, tag = job_of((yield from _look(manners, job, 0, ""))), ""
        bar.job(state)
        while state.status not in ENDS:
            left = until - monotonic()
            if left <= 0:
                raise NotFinished(state)
            answer = yield from _look(manners, job, int(min(left, LONGEST_WAIT_S)), tag)
            if answer.status != 304:
                state, tag = job_of(answer), answer.headers["etag"] if progress else ""
                bar.job(state)
            if state.status not in ENDS:
                yield Pause(min(0.1, left))
    finally:
        bar.close()
    if check and state.status != "succeeded":
        raise JobFailed(state)
    return state


def _look(manners: Manners, job: Job | str, seconds: int, tag: str) -> Talk[Answer]:
    """Asks for a job when it is no longer as it was under `tag` or, without one, when it has ended."""
    headers = given(**{"prefer": f"wait={seconds}" if seconds else None, "if-none-match": tag})
    return (yield from ask(manners, Call("GET", path(job), headers=headers, timeout_s=seconds + 30)))


def run(
    manners: Manners,
    scene: SceneLike,
    *,
    overrides: Json | None = None,
    name: str | None = None,
    tags: Sequence[str] = (),
    priority: int | None = None,
    max_cost: float | None = None,
    reuse: bool = False,
    start_from: Job | str | None = None,
    progress: bool | Watcher = True,
    to: PathLike | None = None,
) -> Talk[Result]:
    """Runs a scene and fetches its recording. The options are those of `submit`.

    - progress: show a bar (the default), or call a function with the job whenever it has come further.
    - to: where the recording goes; a temporary file by default, which `Recording.save` copies.
    """
    options: dict[str, Any] = given(overrides=overrides, name=name, tags=tags, priority=priority, max_cost=max_cost)
    options |= given(reuse=reuse, start_from=start_from)
    submitted = yield from submit(manners, scene, **options)
    ended = yield from wait(manners, submitted, progress=progress)
    return Result(ended, (yield from recording(manners, ended, to=to)))


def result(manners: Manners, job: Job | str, *, to: PathLike | None = None) -> Talk[Result]:
    """A job that has ended, and its recording."""
    ended = yield from wait(manners, job)
    return Result(ended, (yield from recording(manners, ended, to=to)))


def cancel(manners: Manners, job: Job | str) -> Talk[Job]:
    """Cancels a job. A running one ends within about a second and keeps its recording so far."""
    return job_of((yield from ask(manners, Call("POST", f"{path(job)}/cancel"))))


def delete(manners: Manners, job: Job | str) -> Talk[None]:
    """Deletes a job that has ended, and its files."""
    yield from ask(manners, Call("DELETE", path(job), repeatable=False))


def cancel_jobs(
    manners: Manners,
    *,
    status: Status | Sequence[Status] = (),
    tag: str | Sequence[str] = (),
    name: str | None = None,
    sweep: Sweep | str | None = None,
    created_after: datetime | None = None,
    created_before: datetime | None = None,
) -> Talk[int]:
    """Cancels all jobs that have what is given, as in `jobs`; something must be. Returns how many had not ended."""
    filters = _filters(status, tag, name, sweep, created_after, created_before)
    return (yield from _change(manners, "cancel", filters))


def delete_jobs(
    manners: Manners,
    *,
    status: Status | Sequence[Status] = (),
    tag: str | Sequence[str] = (),
    name: str | None = None,
    sweep: Sweep | str | None = None,
    created_after: datetime | None = None,
    created_before: datetime | None = None,
) -> Talk[int]:
    """Deletes all jobs that have what is given and that have ended, and their files. Returns their number."""
    filters = _filters(status, tag, name, sweep, created_after, created_before)
    return (yield from _change(manners, "delete", filters))


def _change(manners: Manners, what: str, filters: dict[str, Any]) -> Talk[int]:
    return Changed.from_dict(decoded((yield from ask(manners, Call("POST", f"/v1/jobs:{what}", json=filters))))).jobs


def _filters(
    status: str | Sequence[str],
    tag: str | Sequence[str],
    name: str | None,
    sweep: Sweep | str | None,
    created_after: datetime | None,
    created_before: datetime | None,
) -> dict[str, Any]:
    several = {"status": status, "tag": tag}
    lists = {key: [words] if isinstance(words, str) else [*words] for key, words in several.items()}
    times = {"created_after": created_after, "created_before": created_before}
    return given(**lists, **times, name=name, sweep=id_of(sweep) if sweep else None)
