"""A real server for all tests: the program that GRIDFALL_BINARY names, on the CPU."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import gridfall
from gridfall import scene as s

CPU = ["--backend", "cpu", "--allow-webhook-address", "127.0.0.1", "--webhook-attempts", "1"]


@pytest.fixture(scope="session")
def url() -> Iterator[str]:
    with gridfall.serve(arguments=CPU) as url:
        yield url


@pytest.fixture(scope="session")
def client(url: str) -> Iterator[gridfall.Client]:
    with gridfall.Client(url) as client:
        yield client


@pytest.fixture(scope="session")
def cube() -> gridfall.Scene:
    """A cube that falls freely for 0.05 s, far from the origin. Its centre starts at (10.5, -4.5, 2.6)."""
    return s.Scene(
        name="cube",
        domain=s.Domain(min=[10, -5, 2], max=[11, -4, 3], dx=0.125),
        gravity=[0, 0, -10],
        materials={"jelly": s.FixedCorotated(density=1000, youngs_modulus=1e4, poissons_ratio=0.3)},
        bodies=[
            s.Body(
                name="cube",
                material="jelly",
                shape=s.Box(min=[10.25, -4.75, 2.35], max=[10.75, -4.25, 2.85]),
                sampling="jittered",
                velocity=[0.5, 0, 0],
            )
        ],
        time=s.Time(end=0.05, frame_rate=100),
        output=s.Output(fields=["velocity", "J", "von_mises"], state=True),
    )


@pytest.fixture(scope="session")
def square() -> gridfall.Scene:
    """A square that falls freely for 0.05 s; a job of a moment. It leaves its last state."""
    return s.Scene(
        name="square",
        dimension=2,
        domain=s.Domain(min=[0, 0], max=[1, 1], dx=0.0625),
        gravity=[0, -10],
        materials={"jelly": s.FixedCorotated(density=1000, youngs_modulus=1e4, poissons_ratio=0.3)},
        bodies=[s.Body(name="square", material="jelly", shape=s.Box(min=[0.375, 0.375], max=[0.625, 0.625]))],
        time=s.Time(end=0.05, frame_rate=100),
        output=s.Output(state=True),
    )


@pytest.fixture(scope="session")
def ran(client: gridfall.Client, cube: gridfall.Scene) -> gridfall.Result:
    return client.run(cube, progress=False)


@pytest.fixture(scope="session")
def endless(square: gridfall.Scene) -> dict[str, Any]:
    """A scene that runs too long to wait for."""
    return {**square.to_dict(), "name": "endless", "time": {"end": 999, "frame_rate": 100}}
