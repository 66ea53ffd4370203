"""Cubes, and small files of cubes in all formats."""

import struct

import numpy as np

from ffdcli.mesh import Mesh

CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
QUADS = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def make(vertices, polygons, **fields):
    """A mesh record of the polygons."""
    starts = np.concatenate([[0], np.cumsum([len(loop) for loop in polygons])]).astype(np.int64)
    corners = np.concatenate([np.asarray(loop, dtype=np.int64) for loop in polygons])
    return Mesh(np.asarray(vertices, dtype=float), corners, starts, **fields)


def off(vertices, polygons):
    lines = ["OFF", f"{len(vertices)} {len(polygons)} 0"] + [
        " ".join(map(str, v)) for v in vertices
    ]
    return "\n".join(lines + [f"{len(p)} " + " ".join(map(str, p)) for p in polygons]) + "\n"


def ply(vertices, polygons, encoding="ascii", kind="double"):
    head = (
        f"ply\nformat {encoding} 1.0\nelement vertex {len(vertices)}\n"
        + "".join(f"property {kind} {axis}\n" for axis in "xyz")
        + f"element face {len(polygons)}\nproperty list uchar int vertex_index\nend_header\n"
    )
    if encoding == "ascii":
        return head + "\n".join(off(vertices, polygons).split("\n")[2:])
    code = "d" if kind == "double" else "f"
    order = ">" if "big" in encoding else "<"
    body = b"".join(struct.pack(f"{order}3{code}", *v) for v in vertices)
    body += b"".join(struct.pack(f"{order}B{len(p)}i", len(p), *p) for p in polygons)
    return head.encode() + body


def ascii_stl(corners):
    facet = "facet normal 0 0 0\n outer loop\n{}\n endloop\nendfacet\n"
    vertex = "  vertex {} {} {}"
    body = "".join(facet.format("\n".join(vertex.format(*v) for v in t)) for t in corners)
    return f"solid a\n{body}endsolid a\n"


def binary_stl(corners):
    records = b"".join(
        struct.pack("<12fH", 0, 0, 0, *np.ravel(triangle), 0) for triangle in corners
    )
    return b"\0" * 80 + struct.pack("<I", len(corners)) + records


def cube_triangles():
    quads = np.array(QUADS)
    return CORNERS[np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]
