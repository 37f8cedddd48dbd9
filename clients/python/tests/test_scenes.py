"""Scenes as objects say the same as documents."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gridfall
from gridfall import scene as s

ROOT = Path(__file__).resolve().parents[3]
DOCUMENTS = sorted((ROOT / "scenes").glob("*.json"))


@pytest.mark.parametrize("file", DOCUMENTS, ids=lambda file: file.stem)
def test_scenes_of_the_library_survive(file: Path) -> None:
    document = json.loads(file.read_text())
    scene = gridfall.Scene.from_dict(document)
    assert scene.to_dict() == document
    assert gridfall.Scene.from_dict(scene.to_dict()) == scene


def test_objects_are_the_documents() -> None:
    ball = s.Sphere(center=[0.5, 0.5, 0.5], radius=0.2)
    hole = s.HalfSpace(point=np.array([0.5, 0.5, 0.5]), normal=np.array([0, 0, 1]))
    scene = s.Scene(
        name="objects",
        domain=s.Domain(
            min=[0, 0, 0],
            max=[1, 1, 1],
            dx=0.125,
            boundary={"x": "periodic", "z-": s.WallContact(contact="slip")},
        ),
        materials={"a": s.Snow(density=400, youngs_modulus=1e5, poissons_ratio=0.2), "b": {"model": "neo-hookean"}},
        bodies=[s.Body(name="half", material="a", shape=(ball - hole).translated([0, 0, 0.1]))],
        colliders=[s.Collider(name="post", shape={"box": {}}, contact="separate", from_=0.5)],
        time=s.Time(end=1),
    )
    assert scene.to_dict() == {
        "gridfall": 1,
        "name": "objects",
        "domain": {
            "min": [0, 0, 0],
            "max": [1, 1, 1],
            "dx": 0.125,
            "boundary": {"x": "periodic", "z-": {"contact": "slip"}},
        },
        "materials": {
            "a": {"model": "snow", "density": 400, "youngs_modulus": 1e5, "poissons_ratio": 0.2},
            "b": {"model": "neo-hookean"},
        },
        "bodies": [
            {
                "name": "half",
                "material": "a",
                "shape": {
                    "translate": {
                        "offset": [0, 0, 0.1],
                        "shape": {
                            "difference": [
                                {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.2}},
                                {"half-space": {"point": [0.5, 0.5, 0.5], "normal": [0, 0, 1]}},
                            ]
                        },
                    }
                },
            }
        ],
        "colliders": [{"name": "post", "shape": {"box": {}}, "contact": "separate", "from": 0.5}],
        "time": {"end": 1},
    }


def test_presets_are_materials(client: gridfall.Client, cube: gridfall.Scene) -> None:
    """A preset in a body, with a value of one's own, is taken by the server and comes back from a document."""
    preset = s.Preset(preset="jelly", density=1100)
    assert preset.to_dict() == {"preset": "jelly", "density": 1100}
    document = {**cube.to_dict(), "bodies": [{**cube.to_dict()["bodies"][0], "material": preset.to_dict()}]}
    scene = s.Scene.from_dict(document)
    assert isinstance(scene.bodies[0], s.Body) and isinstance(scene.bodies[0].material, s.Preset)
    assert scene.to_dict() == document
    client.validate(scene)
    document["bodies"][0]["material"] = {"preset": "jely"}
    with pytest.raises(gridfall.InvalidScene, match="did you mean `jelly`"):
        client.validate(document)


def test_shapes_combine(client: gridfall.Client, cube: gridfall.Scene) -> None:
    """The server counts the particles of what the operators make."""
    left = s.Box(min=[10.25, -4.75, 2.25], max=[10.5, -4.25, 2.75])
    both = s.Box(min=[10.25, -4.75, 2.25], max=[10.75, -4.25, 2.75])

    def particles(shape: Any) -> int:
        body = s.Body(name="cube", material="jelly", shape=shape)
        return client.validate(gridfall.Scene(**{**vars(cube), "bodies": [body]})).estimate.particles

    assert particles(both) == 2 * particles(left) == 512
    assert particles(both - left) == particles(both & left) == particles(left)
    assert particles(left | left.translated([0.25, 0, 0])) == particles(both)
    assert particles(left.rotated(180, center=[10.5, -4.5, 2.5]) | left) == particles(both)
    assert particles(both.scaled(0.5, center=[10.25, -4.75, 2.25])) == 64


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"domain": {"dxx": 1}}, "Domain has no 'dxx'; it has dx, max, min, boundary"),
        ({"bodies": [{"shape": {"ball": {}}}]}, "there is no 'ball'; there are .*sphere"),
        ({"bodies": [{"shape": {"box": {}, "sphere": {}}}]}, "a shape has one member"),
        ({"materials": {"a": {"model": "jelly"}}}, "there is no 'jelly'; there are .*snow"),
    ],
)
def test_slips_are_said(document: dict[str, Any], said: str) -> None:
    with pytest.raises(TypeError, match=said):
        gridfall.Scene.from_dict(document)


def test_docstrings_come_from_the_schema() -> None:
    schema = json.loads((ROOT / "api" / "scene.schema.json").read_text())
    assert s.Domain.__doc__ and s.Domain.__doc__.startswith(schema["$defs"]["Domain"]["description"])
    assert "- dx: Grid spacing (m)." in s.Domain.__doc__ and "Default: 0.5." in (s.Solver.__doc__ or "")
    for name in ("submit", "run", "wait"):
        assert getattr(gridfall.Client, name).__doc__ == getattr(gridfall.AsyncClient, name).__doc__ != ""
