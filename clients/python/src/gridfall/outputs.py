"""What can be asked of a server about what jobs leave. `Client` and `AsyncClient` have these as methods."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import httpx
import numpy as np
from numpy.typing import NDArray

from .download import download
from .exchange import Call, Give, Manners, More, Talk, ask, open_stream
from .models import FrameList, Job, OutputLinks
from .recording import GrowingRecording, Recording
from .requests import ENDS, PathLike, decoded, job_of, path
from .result import Picture
from .scene import Scene
from .tables import table


def recording(manners: Manners, job: Job | str, *, to: PathLike | None = None) -> Talk[Recording]:
    """The recording of a job; of a running one, the frames so far.

    - to: where it goes; a temporary file by default. A download that broke off goes on there.
    """
    state = job_of((yield from ask(manners, Call("GET", path(job)))))
    temporary = Path(tempfile.mkdtemp(prefix="gridfall-")) if to is None else None
    target = temporary / "recording.mcap" if temporary else Path(to or "")
    name = "recording.mcap" if state.status in ENDS else "recording-so-far.mcap"
    yield from download(manners, f"{path(job)}/{name}", target)
    return Recording(target, temporary=temporary)


def follow(manners: Manners, job: Job | str) -> Talk[None]:
    """The frames of a job, each as soon as it is complete, to the end of the run."""
    given_so_far = 0
    while True:
        call = Call("GET", f"{path(job)}/recording.mcap", params={"follow": "true"}, timeout_s=3600)
        yield from open_stream(manners, call)
        growing = GrowingRecording()
        try:
            while piece := (yield More()):
                for frame in growing.feed(piece):
                    if frame.index == given_so_far:
                        given_so_far += 1
                        yield Give(frame)
            return
        except httpx.TransportError:
            # The recording begins anew with the connection, and is the same as before.
            yield manners.pause(0)


def frame_list(manners: Manners, job: Job | str) -> Talk[FrameList]:
    """How many frames a job has so far, and their fields."""
    return FrameList.from_dict(decoded((yield from ask(manners, Call("GET", f"{path(job)}/frames")))))


def diagnostics(manners: Manners, job: Job | str) -> Talk[NDArray[np.void]]:
    """Energies, momenta, mass and time steps, a row a frame so far: `diagnostics["kinetic_j"]`."""
    return table(decoded((yield from ask(manners, Call("GET", f"{path(job)}/diagnostics"))))["rows"])


def solver(manners: Manners, job: Job | str) -> Talk[NDArray[np.void]]:
    """How the implicit integrator fared, a row a step so far; empty of explicit runs."""
    return table(decoded((yield from ask(manners, Call("GET", f"{path(job)}/solver"))))["rows"])


def links(manners: Manners, job: Job | str, *, expires_s: int = 3600) -> Talk[OutputLinks]:
    """Links to the outputs of a job that has ended, for servers with an object storage. They need no key.

    - expires_s: how long they are good for (s), up to a week.
    """
    call = Call("GET", f"{path(job)}/links", params={"expires_s": str(expires_s)})
    return OutputLinks.from_dict(decoded((yield from ask(manners, call))))


def log(manners: Manners, job: Job | str) -> Talk[str]:
    """What the worker and the run have said about a job, a line each."""
    return (yield from ask(manners, Call("GET", f"{path(job)}/log"))).body.decode()


def job_scene(manners: Manners, job: Job | str) -> Talk[Scene]:
    """The scene that a job runs, with its overrides."""
    return Scene.from_dict(decoded((yield from ask(manners, Call("GET", f"{path(job)}/scene")))))


def thumbnail(manners: Manners, job: Job | str) -> Talk[Picture]:
    """A picture of the last frame of a job that has ended: the bytes of a PNG, which notebooks show."""
    return Picture((yield from ask(manners, Call("GET", f"{path(job)}/thumbnail.png"))).body)


def picture(
    manners: Manners,
    job: Job | str,
    frame: int,
    *,
    size: tuple[int, int] | None = None,
    camera: str | None = None,
    color_by: str | None = None,
    color_range: tuple[float, float] | None = None,
    bodies: Sequence[str] = (),
) -> Talk[Picture]:
    """A picture of a frame: the bytes of a PNG, which notebooks show.

    - size: width and height (pixels).
    - camera: such as `azimuth=30,elevation=20,zoom=2`; what is left out is chosen so that all is seen.
    - color_by: a field of the points, or `body`; the recorded colours without it.
    - color_range: values of the field with the first and the last colour.
    - bodies: names of those that are drawn; all without any.
    """
    params = {
        "size": size and f"{size[0]}x{size[1]}",
        "camera": camera,
        "color_by": color_by,
        "range": color_range and f"{color_range[0]},{color_range[1]}",
        "body": ",".join(bodies),
    }
    given = {name: value for name, value in params.items() if value}
    call = Call("GET", f"{path(job)}/frames/{frame}/picture.png", params=given, timeout_s=300)
    return Picture((yield from ask(manners, call)).body)


def surface(
    manners: Manners,
    job: Job | str,
    frame: int,
    *,
    form: Literal["obj", "ply", "glb"] = "glb",
    bodies: Sequence[str] = (),
    max_points: int | None = None,
) -> Talk[bytes]:
    """The surfaces of the bodies in a frame of a 3D scene: the bytes of a file of meshes."""
    params = {"format": form, "body": ",".join(bodies), "max_points": str(max_points or "")}
    given = {name: value for name, value in params.items() if value}
    call = Call("GET", f"{path(job)}/frames/{frame}/surface", params=given, timeout_s=300)
    return (yield from ask(manners, call)).body


def export(
    manners: Manners,
    job: Job | str,
    frame: int,
    *,
    form: Literal["ply", "vtp", "npz", "csv"],
    bodies: Sequence[str] = (),
    max_points: int | None = None,
) -> Talk[bytes]:
    """A frame as a file of another program: the bytes of a PLY, VTP (ParaView), npz or CSV.

    - bodies: names of those that are exported; all without any.
    - max_points: most points, the same share of all parts; all by default.
    """
    params = {"format": form, "body": ",".join(bodies), "max_points": str(max_points or "")}
    given = {name: value for name, value in params.items() if value}
    call = Call("GET", f"{path(job)}/frames/{frame}/export", params=given, timeout_s=300)
    return (yield from ask(manners, call)).body


def points(
    manners: Manners, job: Job | str, frame: int, *, bodies: Sequence[str] = (), max_points: int | None = None
) -> Talk[dict[str, NDArray[Any]]]:
    """The points of one frame, without its recording: `position` (n × 3) and the recorded fields, by name."""
    exported = yield from export(manners, job, frame, form="npz", bodies=bodies, max_points=max_points)
    with np.load(BytesIO(exported)) as arrays:
        return dict(arrays)


def state(manners: Manners, job: Job | str) -> Talk[dict[str, NDArray[Any]]]:
    """The last state of all particles of a job whose scene has `output.state`.

    Arrays by name: `x`, `v` (n × d), `B`, `F` (n × d × d), `plastic` and `body` (n).
    """
    answer = yield from ask(manners, Call("GET", f"{path(job)}/state.npz", timeout_s=300))
    with np.load(BytesIO(answer.body)) as arrays:
        return dict(arrays)
