"""Reads a mesh with trimesh and prints as JSON what it sees of each body.

usage: read_surfaces.py MESH
"""

import json
import sys

import numpy
import trimesh

# From y up, as glTF has it, to z up.
UPRIGHT = numpy.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def parts(path):
    """Name, vertices, faces, normals and velocities of each body."""
    loaded = trimesh.load(path, process=False, split_objects=path.endswith(".obj"))
    if path.endswith(".ply"):
        with open(path, "rb") as stream:
            head = stream.read(4096).split(b"end_header")[0].decode()
        names = dict(line.split(" ", 3)[2:] for line in head.splitlines() if line.startswith("comment body "))
        data = loaded.metadata["_ply_raw"]["vertex"]["data"]
        bodies = data["body"].ravel()
        column = lambda *names: numpy.column_stack([data[name].ravel() for name in names])
        normals, velocities = column("nx", "ny", "nz"), column("vx", "vy", "vz")
        for number in numpy.unique(bodies):
            own = bodies == number
            index = numpy.cumsum(own) - 1
            faces = loaded.faces[own[loaded.faces[:, 0]]]
            assert own[faces].all(), "no triangle is of two bodies"
            yield names[str(number)], loaded.vertices[own], index[faces], normals[own], velocities[own]
    elif path.endswith(".glb"):
        for node in loaded.graph.nodes_geometry:
            transform, name = loaded.graph[node]
            mesh = loaded.geometry[name]
            turn = UPRIGHT @ transform[:3, :3]
            vertices = mesh.vertices @ turn.T + UPRIGHT @ transform[:3, 3]
            velocities = mesh.vertex_attributes["_VELOCITY"] @ turn.T
            yield name, vertices, mesh.faces, mesh.vertex_normals @ turn.T, velocities
    else:
        meshes = loaded.geometry.items() if isinstance(loaded, trimesh.Scene) else [(None, loaded)]
        for name, mesh in meshes:
            yield name, mesh.vertices, mesh.faces, mesh.vertex_normals, None


def main(path):
    seen = {}
    for name, vertices, faces, normals, velocities in parts(path):
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        assert numpy.allclose(numpy.linalg.norm(normals, axis=1), 1, atol=1e-3), "normals have length 1"
        seen[name] = {
            "closed": bool(mesh.is_watertight and mesh.is_winding_consistent),
            "volume": float(mesh.volume),
            "bounds": mesh.bounds.tolist(),
            "normals_outwards": bool((numpy.einsum("ij,ij->i", normals, mesh.vertex_normals) > 0.3).mean() > 0.999),
        }
        if velocities is not None:
            # Weighted by area, as the middle of the surface is that of the body.
            weights = numpy.zeros(len(vertices))
            numpy.add.at(weights, faces.ravel(), numpy.repeat(mesh.area_faces / 3, 3))
            seen[name]["mean_velocity"] = (weights @ velocities / weights.sum()).tolist()
            seen[name]["velocity_range"] = numpy.ptp(velocities, axis=0).tolist()
    print(json.dumps(seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
