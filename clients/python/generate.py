"""Makes src/gridfall/scene.py and models.py of the contracts in api/.

usage: generate.py [--check]
"""

from __future__ import annotations

import json
import keyword
import re
import sys
import textwrap
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
API = HERE.parent.parent / "api"
PACKAGE = HERE / "src" / "gridfall"
# What the client hands out, and with it all that these are made of.
ANSWERS = ["Job", "JobList", "Sweep", "ValidScene", "KeptScene", "Asset", "DeviceList", "FrameList", "LibraryScene"]
ANSWERS += ["Ready", "Fault", "SweepList", "SweepResults", "ValidSweep", "AssetList", "SceneList", "MaterialList"]
ANSWERS += ["Changed", "Webhook", "AddedWebhook", "WebhookList", "DeliveryList", "OutputLinks"]
# Places of the scene where one of several classes may stand.
CHOICES = {"Shape": "ShapePart | Json", "Material": "MaterialPart | Json"}
Schema = dict[str, Any]


class Module:
    """The text of a module, made of the definitions of a schema."""

    def __init__(self, definitions: dict[str, Schema], *, answers: bool) -> None:
        self.definitions, self.answers = definitions, answers
        self.text: list[str] = []

    def short(self, name: str) -> str:
        """`Box` of `BoxShape`, `Snow` of `SnowMaterial`, `Time` of `SceneTime`."""
        if self.answers:
            return name
        return re.sub(r"(?<=.)(Shape|Material)$", "", re.sub(r"^Scene(?=.)", "", name))

    def type_of(self, schema: Schema) -> tuple[str, str]:
        """The annotation of a value, and what `member` needs to know of it; both without None."""
        for several in ("oneOf", "anyOf", "allOf"):
            if several in schema:
                return self.type_of(next(each for each in schema[several] if each.get("type") != "null"))
        if "else" in schema:
            # A name, or what it would be the name of.
            inner, of = self.type_of(schema["then"])
            return f"{self.type_of(schema['else'])[0]} | {inner}", of
        if "$ref" in schema:
            return self.referred(schema["$ref"].rsplit("/", 1)[1])
        if "enum" in schema:
            return literal(schema["enum"]), ""
        kinds = schema.get("type", "any")
        kind = next(each for each in kinds if each != "null") if isinstance(kinds, list) else kinds
        if kind == "array":
            return self.array(schema)
        if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
            inner, of = self.type_of(schema["additionalProperties"])
            return f"Mapping[str, {inner}]", of and f"{{{of}}}"
        if schema.get("format") == "date-time":
            return "datetime", "datetime"
        names = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "object": "Json"}
        return names.get(kind, "Any"), ""

    def referred(self, name: str) -> tuple[str, str]:
        if name in CHOICES:
            return CHOICES[name], name
        schema = self.definitions[name]
        if name == "Boundary":
            return 'Literal["periodic"] | WallContact | Json', "WallContact"
        if "enum" in schema:
            return name, ""
        if schema.get("properties") is not None:
            return self.short(name) + ("" if self.answers else " | Json"), self.short(name)
        return self.type_of(schema)

    def array(self, schema: Schema) -> tuple[str, str]:
        inner, of = self.type_of(schema["items"])
        if inner == "float" and not self.answers:
            return "Vector", ""
        if inner == "Vector":
            return "Matrix", ""
        return f"{'list' if self.answers else 'Sequence'}[{inner}]", of and f"[{of}]"

    def alias(self, name: str, schema: Schema) -> None:
        self.text += ["", *broken(f"{name} = {literal(schema['enum'])}", "")]
        self.text += docstring(schema.get("description", f"A choice of {name.lower()}."), "")
        self.text += [""]

    def class_of(self, name: str, schema: Schema, base: str, tag: str = "") -> None:
        short, properties = self.short(name), dict(schema["properties"])
        properties.pop("$comment", None)
        if base == "MaterialPart":
            properties.pop("model", None)
        required = set(schema.get("required", []))
        described = schema.get("description", f"{words(short)}.")
        lines = [describe(attribute(key), inner, key in required) for key, inner in properties.items()]
        self.text += ["", f"@dataclass({'frozen=True, ' if self.answers else ''}kw_only=True, repr=False)"]
        self.text += [f"class {short}({base}):"]
        self.text += docstring(described, "    ", [line for line in lines if line])
        self.text += [""]
        self.text += ["    known = True"] if base == "Part" and not self.answers else []
        self.text += [f'    tag = "{tag}"'] if tag else []
        for key, inner in sorted(properties.items(), key=lambda item: item[0] not in required):
            self.field(key, inner, required=key in required)
        self.text += [""]

    def field(self, key: str, schema: Schema, *, required: bool) -> None:
        annotation, of = self.type_of(schema)
        name = attribute(key)
        metadata = ", ".join([f'key="{key}"'] * (name != key) + [f'of="{of}"'] * bool(of))
        options = [f"metadata=member({metadata})"]
        if "const" in schema and key == "gridfall":
            options.insert(0, f"default={schema['const']!r}")
        elif not required:
            options.insert(0, "default=None")
        nullable = not required or "null" in schema.get("type", []) or {"type": "null"} in schema.get("oneOf", [])
        nullable = nullable and "| None" not in annotation
        annotation += " | None" * nullable
        self.text += broken(f"    {name}: {annotation} = field({', '.join(options)})", "    ")
        self.text += docstring(schema["description"], "    ") if "description" in schema else []

    def shapes(self, name: str, tag: str, schema: Schema) -> None:
        described = schema.get("description", f"The {tag} of shapes.")
        self.text += ["", "@dataclass(kw_only=True, repr=False)", f"class {name}(ShapesPart):"]
        self.text += docstring(described, "    ") + ["", f'    tag = "{tag}"']
        self.text += ['    shapes: Sequence[ShapePart | Json] = field(metadata=member(of="[Shape]"))', ""]


def literal(values: list[Any]) -> str:
    return f"Literal[{', '.join(json.dumps(each) for each in values if each is not None)}]"


def broken(line: str, indent: str) -> list[str]:
    """A statement whose last brackets are broken open if it is too long."""
    if len(line) <= 120:
        return [line]
    at = line.rindex("field(") + 6 if "field(" in line else line.index("[") + 1
    inner = textwrap.wrap(line[at:-1], 112, initial_indent=f"{indent}    ", subsequent_indent=f"{indent}    ")
    return [line[:at], *inner, indent + line[-1]]


def attribute(key: str) -> str:
    name = key.replace("-", "_").replace("$", "")
    # `field` makes the members.
    taken = keyword.iskeyword(name) or name == "field" or name != key.replace("-", "_")
    return name + "_" * taken


def words(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).capitalize()


def describe(name: str, schema: Schema, required: bool) -> str:
    text = schema.get("description", "").split("\n")[0]
    default = schema.get("default")
    if default not in (None, [], {}) and not isinstance(default, dict) and "default" not in text:
        text = f"{text} Default: {json.dumps(default)}.".strip()
    return f"{name}: {text}" if text else (f"{name}" if required else f"{name}: Optional.")


def docstring(text: str, indent: str, fields: list[str] | None = None) -> list[str]:
    def wrapped(text: str, further: str) -> list[str]:
        return textwrap.wrap(text, 112, initial_indent=indent, subsequent_indent=indent + further)

    text = text.replace("\\", "\\\\").replace('"""', "'''")
    lines = [line for part in text.split("\n") for line in wrapped(part, "  " if part.startswith("- ") else "")]
    if fields:
        lines += ["", f"{indent}Fields:"] + [line for each in fields for line in wrapped(f"- {each}", "  ")]
    lines[0] = f'{indent}"""{lines[0].lstrip()}'
    if len(lines) == 1:
        # A quote at the end would run into those of the docstring.
        return [lines[0] + (' """' if lines[0].endswith('"') else '"""')]
    return [*lines, f'{indent}"""']


HEAD = '''"""{about}

Generated by generate.py of {source}. Do not edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from .document import Json, MaterialPart, Matrix, Part, ShapePart, ShapesPart, Vector, member
'''


def scene() -> str:
    schema = json.loads((API / "scene.schema.json").read_text())
    definitions: dict[str, Schema] = schema["$defs"]
    module = Module(definitions, answers=False)
    for name, each in sorted(definitions.items()):
        if "enum" in each:
            module.alias(name, each)
    tags = {inner["$ref"].rsplit("/", 1)[1]: tag for tag, inner in definitions["Shape"]["properties"].items()
            if "$ref" in inner}
    for name, each in sorted(definitions.items()):
        if "enum" in each or name in CHOICES or each.get("properties") is None:
            continue
        if name.endswith("Preset"):
            continue
        if name.endswith("Material"):
            module.class_of(name, each, "MaterialPart", each["properties"]["model"]["const"])
        elif name in tags:
            module.class_of(name, each, "ShapePart", tags[name])
        else:
            module.class_of(name, each, "Part")
    for tag, inner in definitions["Shape"]["properties"].items():
        if "$ref" not in inner:
            module.shapes(tag.capitalize(), tag, inner)
    module.class_of("Preset", preset(definitions), "MaterialPart")
    module.class_of("Scene", schema, "Part")
    return HEAD.format(about="Scenes as objects: SI units, z up.", source="api/scene.schema.json") + finish(module)


def preset(definitions: dict[str, Schema]) -> Schema:
    """What any preset may have beside its name."""
    fields: dict[str, Schema] = {"preset": {"$ref": "#/$defs/PresetName", "description": "Its name."}}
    for name, each in sorted(definitions.items()):
        if name.endswith("Preset"):
            fields |= {key: inner for key, inner in each["properties"].items() if key not in fields}
    del fields["origin"]
    described = "A material that people know. Parameters of its model that are given beside its name replace its own."
    return {"description": described, "properties": fields, "required": ["preset"]}


def models() -> str:
    definitions = json.loads((API / "openapi.json").read_text())["components"]["schemas"]
    wanted: list[str] = []

    def want(name: str) -> None:
        if name not in wanted:
            for inner in re.findall(r'"#/components/schemas/(\w+)"', json.dumps(definitions[name])):
                want(inner)
            wanted.append(name)

    for name in ANSWERS:
        want(name)
    module = Module(definitions, answers=True)
    for name in wanted:
        if "enum" in definitions[name]:
            module.alias(name, definitions[name])
    for name in wanted:
        if "enum" not in definitions[name]:
            module.class_of(name, definitions[name], "Part")
    return HEAD.format(about="What the server answers.", source="api/openapi.json") + finish(module)


def finish(module: Module) -> str:
    lines = re.sub(r'"""\n\n(    (?:known|tag|\w+:))', r'"""\n\n\1', "\n".join(module.text))
    return re.sub(r"\n{4,}", "\n\n\n", lines).rstrip("\n") + "\n"


def pruned(text: str) -> str:
    """Without imports of what is not used."""
    used = re.sub(r"^from .*\n", "", text, flags=re.M)

    def kept(found: re.Match[str]) -> str:
        names = [name for name in found[2].split(", ") if re.search(rf"\b{name}\b", used)]
        return f"{found[1]}{', '.join(names)}\n" if names else ""

    return re.sub(r"^(from \S+ import )(?!annotations)(.+)\n", kept, text, flags=re.M)


def main() -> None:
    stale = []
    for name, text in (("scene.py", scene()), ("models.py", models())):
        path, text = PACKAGE / name, pruned(text)
        if "--check" not in sys.argv:
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            stale.append(name)
    if stale:
        sys.exit(f"{', '.join(stale)} not as api/ has it; run clients/python/generate.py")


if __name__ == "__main__":
    main()
