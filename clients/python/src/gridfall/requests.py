"""What requests and answers are made of."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from .document import Json, plain
from .exchange import Answer
from .models import Job, KeptScene, Sweep
from .scene import Scene

PathLike: TypeAlias = str | os.PathLike[str]
SceneLike: TypeAlias = Scene | Json | KeptScene | os.PathLike[str]
"""A scene: an object, plain data, one that the server keeps, or a file (a `Path`)."""
ENDS = ("succeeded", "failed", "canceled")


def scene_of(scene: SceneLike) -> dict[str, Any]:
    """The members of a request that say which scene is meant."""
    if isinstance(scene, KeptScene):
        return {"scene_id": scene.id}
    if isinstance(scene, os.PathLike):
        return {"scene": json.loads(Path(scene).read_text())}
    if not isinstance(scene, (Scene, Mapping)):
        raise TypeError(f"a scene is a Scene, a dict, a KeptScene or a Path, and not {type(scene).__name__}")
    return {"scene": plain(scene)}


def given(**options: Any) -> dict[str, Any]:
    """The options that were given, as plain data: no None, no False, nothing empty. 0 is one."""
    empty = (value is None or value is False or value in ("", [], ()) for value in options.values())
    return {key: plain(options[key]) for key, nothing in zip(options, empty, strict=True) if not nothing}


def once(idempotency_key: str | None) -> dict[str, str]:
    """The header by which a request that is sent again is accepted once."""
    return {"idempotency-key": idempotency_key or str(uuid.uuid4())}


def commas(words: str | Sequence[str]) -> str:
    return words if isinstance(words, str) else ",".join(words)


def id_of(one: Job | Sweep | str) -> str:
    return one if isinstance(one, str) else one.id


def path(job: Job | str) -> str:
    return f"/v1/jobs/{id_of(job)}"


def job_of(answer: Answer) -> Job:
    return Job.from_dict(decoded(answer))


def decoded(answer: Answer) -> Any:
    return json.loads(answer.body)
