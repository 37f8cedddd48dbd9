"""Compares exported frames with the recording that they are of, number for number, and prints what it saw as JSON.

usage: read_exports.py RECORDING FOLDER
FOLDER has STEM.NNNN.{ply,vtp,npz,csv} of each frame and STEM.pvd. The recording is read with the official library, PLY
with meshio, npz and CSV with NumPy, and VTP as the XML and the raw arrays that VTK's file formats describe.
"""

import csv
import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import meshio
import numpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

NUMPY_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
VTK_TYPES = {"UInt8": "u1", "UInt32": "<u4", "Int64": "<i8", "Float32": "<f4", "Float64": "<f8"}
GROUPS = {"velocity": ["vx", "vy", "vz"], "color": ["red", "green", "blue", "alpha"]}
TENSOR = ["xx", "xy", "xz", "xy", "yy", "yz", "xz", "yz", "zz"]


def recorded(path):
    """Time (s), positions in the scene and table of scalars of each frame."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, _, message, cloud in reader.iter_decoded_messages(topics=["/particles"]):
            fields = cloud.fields
            layout = {
                "names": [field.name for field in fields],
                "formats": [NUMPY_TYPES[field.type] for field in fields],
                "offsets": [field.offset for field in fields],
                "itemsize": cloud.point_stride,
            }
            table = numpy.frombuffer(cloud.data, dtype=numpy.dtype(layout))
            corner = cloud.pose.position
            position = numpy.stack([table["x"], table["y"], table["z"]], 1).astype("f8") + [corner.x, corner.y, corner.z]
            yield message.log_time / 1e9, position, {name: table[name] for name in table.dtype.names[3:]}


def grouped(scalars):
    """The scalars as npz and VTP have them."""
    arrays, left = {}, dict(scalars)
    groups = dict(GROUPS)
    for tensor in ("stress", "strain"):
        groups[tensor] = [f"{tensor}_{part}" for part in TENSOR]
    for name, members in groups.items():
        if all(member in scalars for member in members):
            arrays[name] = numpy.stack([scalars[member] for member in members], 1)
            for member in members:
                left.pop(member, None)
    return arrays | left


def same(a, b, what):
    assert a.dtype == b.dtype, f"{what}: {a.dtype} and {b.dtype}"
    assert a.shape == b.shape, f"{what}: {a.shape} and {b.shape}"
    assert numpy.array_equal(a, b, equal_nan=a.dtype.kind == "f"), what


def vtp(path):
    """Time, points and point data; fails on anything that is not as VTK describes it."""
    raw = path.read_bytes()
    mark = b'<AppendedData encoding="raw">\n_'
    start = raw.index(mark) + len(mark)
    end = raw.rindex(b"\n</AppendedData>")
    root = ElementTree.fromstring(raw[:start] + raw[end:])
    assert root.attrib == {"type": "PolyData", "version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64"}
    reach = 0

    def array(node):
        nonlocal reach
        at = start + int(node.get("offset"))
        assert at == start + reach, "arrays follow each other"
        length = int.from_bytes(raw[at : at + 8], "little")
        reach += 8 + length
        values = numpy.frombuffer(raw[at + 8 : at + 8 + length], VTK_TYPES[node.get("type")])
        parts = int(node.get("NumberOfComponents", 1))
        assert all(node.get(f"ComponentName{k}") for k in range(parts)) or parts == 1 or node.get("Name") == "Points"
        return values.reshape(-1, parts) if parts > 1 else values

    data = root.find("PolyData")
    piece = data.find("Piece")
    fields = {node.get("Name"): array(node) for node in piece.find("PointData")}
    points = array(piece.find("Points/DataArray"))
    connectivity, offsets = (array(node) for node in piece.find("Verts"))
    assert start + reach == end, "nothing is left over"
    n = len(points)
    assert piece.get("NumberOfPoints") == piece.get("NumberOfVerts") == str(n)
    assert (connectivity == numpy.arange(n)).all() and (offsets == numpy.arange(n) + 1).all()
    time = data.find("FieldData/DataArray[@Name='TimeValue']")
    return float(time.text), points, fields


def check(base, time, position, scalars):
    arrays = grouped(scalars)
    mesh = meshio.read(base + ".ply")
    same(mesh.points, position, "PLY position")
    assert list(mesh.point_data) == list(scalars), "PLY names"
    for name, values in scalars.items():
        # meshio takes the bytes of uchar for signed ones.
        found = mesh.point_data[name]
        same(found.view("u1") if values.dtype == "u1" else found, values, f"PLY {name}")

    at, points, fields = vtp(pathlib.Path(base + ".vtp"))
    assert at == time
    same(points, position, "VTP position")
    assert fields.keys() == arrays.keys(), f"VTP has {fields.keys()}, not {arrays.keys()}"
    for name, values in arrays.items():
        same(fields[name], values, f"VTP {name}")

    with numpy.load(base + ".npz") as npz:
        assert npz["time_s"].shape == () and npz["time_s"] == time
        same(npz["position"], position, "npz position")
        assert set(npz.files) == {"time_s", "position"} | arrays.keys(), npz.files
        for name, values in arrays.items():
            shaped = values.reshape(-1, 3, 3) if name in ("stress", "strain") else values
            same(npz[name], shaped, f"npz {name}")

    with open(base + ".csv", newline="") as stream:
        names, *rows = csv.reader(stream)
    assert names == ["time_s", "x", "y", "z", *scalars]
    table = numpy.array(rows, dtype="f8").reshape(-1, len(names))
    assert (table[:, 0] == time).all()
    same(table[:, 1:4], position, "CSV position")
    for k, (name, values) in enumerate(scalars.items()):
        same(table[:, 4 + k].astype(values.dtype), values, f"CSV {name}")


def main(recording, folder):
    stem = pathlib.Path(recording).name.removesuffix(".mcap")
    series = ElementTree.parse(f"{folder}/{stem}.pvd").findall("Collection/DataSet")
    seen = []
    for n, (time, position, scalars) in enumerate(recorded(recording)):
        assert (series[n].get("file"), float(series[n].get("timestep"))) == (f"{stem}.{n:04}.vtp", time)
        check(f"{folder}/{stem}.{n:04}", time, position, scalars)
        first = {name: float(values[0]) for name, values in scalars.items()}
        seen.append({"points": len(position), "min": position.min(0).tolist(), "max": position.max(0).tolist(), "first": first})
    assert len(series) == len(seen)
    print(json.dumps(seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
