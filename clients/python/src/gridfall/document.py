"""Objects that stand for parts of a JSON document: what the generated modules are made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, ClassVar, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Json = Mapping[str, Any]
"""A part of a document as plain data, which is accepted wherever an object is."""

Vector = Sequence[float] | NDArray[Any]
"""Two (2D) or three numbers."""

Matrix = Sequence[Sequence[float]] | NDArray[Any]
"""Rows of numbers."""

P = TypeVar("P", bound="Part")


def member(key: str = "", of: str = "") -> dict[str, str]:
    """Metadata of a field: its name in JSON where Python has no such name, and what its values are made of."""
    return {"key": key, "of": of}


class Part:
    """A part of a document. `to_dict` and `from_dict` are inverse to each other."""

    tag: ClassVar[str] = ""
    """What tells it from others that may stand in the same place."""
    known: ClassVar[bool] = False
    """Whether no other members may be there."""

    def __repr__(self) -> str:
        values = ((field.name, getattr(self, field.name)) for field in self.members().values())
        shown = (f"{name}={value!r}" for name, value in values if value is not None)
        return f"{type(self).__name__}({', '.join(shown)})"

    @classmethod
    def members(cls) -> dict[str, dataclasses.Field[Any]]:
        """Its fields, by their names in JSON."""
        fields = dataclasses.fields(cast(Any, cls))
        return {field.metadata.get("key") or field.name: field for field in fields}

    def to_dict(self) -> dict[str, Any]:
        """Plain data; what was not given is left out."""
        values = {key: getattr(self, field.name) for key, field in self.members().items()}
        return {key: plain(value) for key, value in values.items() if value is not None}

    @classmethod
    def from_dict(cls: type[P], document: Json) -> P:
        """The object that a document stands for."""
        members = cls.members()
        unknown = [key for key in document if key not in members]
        if cls.known and unknown:
            raise TypeError(f"{cls.__name__} has no {unknown[0]!r}; it has {', '.join(members)}")
        given = {key: value for key, value in document.items() if key in members}
        if not cls.known:
            given = {**dict.fromkeys(members), **given}
        return cls(**{members[key].name: made(value, members[key].metadata["of"]) for key, value in given.items()})


class ShapePart(Part):
    """A shape. `a | b` is the union of two, `a & b` the intersection, and `a - b` is a without b."""

    known = True

    def to_dict(self) -> dict[str, Any]:
        return {self.tag: super().to_dict()}

    def translated(self, offset: Vector) -> ShapePart:
        """The shape, moved by `offset` (m)."""
        return _shape("Translate", offset=offset, shape=self)

    def rotated(self, angle_degrees: float, *, axis: Vector | None = None, center: Vector | None = None) -> ShapePart:
        """The shape, turned about `axis` (3D; default z) through `center` (default: origin)."""
        return _shape("Rotate", angle_degrees=angle_degrees, axis=axis, center=center, shape=self)

    def scaled(self, factor: float, *, center: Vector | None = None) -> ShapePart:
        """The shape, made larger by `factor` about `center` (default: origin)."""
        return _shape("Scale", factor=factor, center=center, shape=self)

    def __or__(self, other: ShapePart | Json) -> ShapePart:
        return _shape("Union", shapes=[self, other])

    def __and__(self, other: ShapePart | Json) -> ShapePart:
        return _shape("Intersection", shapes=[self, other])

    def __sub__(self, other: ShapePart | Json) -> ShapePart:
        return _shape("Difference", shapes=[self, other])


class ShapesPart(ShapePart):
    """A shape that is made of others."""

    shapes: Sequence[ShapePart | Json]

    def to_dict(self) -> dict[str, Any]:
        return {self.tag: plain(self.shapes)}


class MaterialPart(Part):
    """A material; its tag is the name of its model. A preset has none."""

    known = True

    def to_dict(self) -> dict[str, Any]:
        model = {"model": self.tag} if self.tag else {}
        return {**model, **super().to_dict()}


def plain(value: Any) -> Any:
    """Plain data of objects, NumPy's arrays and numbers included."""
    if isinstance(value, Part):
        return value.to_dict()
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value


def made(value: Any, of: str) -> Any:
    """The object of a kind that plain data stands for: of a class, `[Class]`, `{Class}` or `datetime`."""
    if not of or value is None or isinstance(value, Part):
        return value
    if of[0] == "[":
        return [made(each, of[1:-1]) for each in value]
    if of[0] == "{":
        return {key: made(each, of[1:-1]) for key, each in value.items()}
    if of == "datetime":
        return _moment(value)
    if not isinstance(value, Mapping):
        return value
    if of == "Shape":
        return _tagged_shape(value)
    if of == "Material" and "preset" in value:
        return _named("Preset").from_dict(value)
    if of == "Material":
        rest = {key: each for key, each in value.items() if key != "model"}
        return _tagged(MaterialPart, value.get("model")).from_dict(rest)
    return _named(of).from_dict(value)


def _tagged_shape(value: Json) -> ShapePart:
    if len(value) != 1:
        raise TypeError(f"a shape has one member, its kind, and not {', '.join(value) or 'none'}")
    [(tag, inner)] = value.items()
    return _tagged(ShapePart, tag).from_dict({"shapes": inner} if isinstance(inner, (list, tuple)) else inner)


def _moment(text: str) -> datetime:
    # Python 3.10 knows neither Z nor nanoseconds.
    head, dot, rest = text.replace("Z", "+00:00").partition(".")
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
    return datetime.fromisoformat(f"{head}{dot}{digits[:6]:0<6}{rest[len(digits) :]}" if dot else head)


def _classes(base: type[P]) -> list[type[P]]:
    below = base.__subclasses__()
    return below + [deeper for each in below for deeper in _classes(each)]


def _named(name: str) -> type[Part]:
    return next(each for each in _classes(Part) if each.__name__ == name)


def _tagged(base: type[P], tag: Any) -> type[P]:
    known = {each.tag: each for each in _classes(base) if each.tag}
    if tag not in known:
        raise TypeError(f"there is no {tag!r}; there are {', '.join(sorted(known))}")
    return known[tag]


def _shape(name: str, **members: Any) -> ShapePart:
    return cast(ShapePart, _named(name)(**members))
