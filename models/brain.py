"""Makes brain.glb from the MRI scan that Debian's package mricron-data holds.

    pip install numpy==2.4.6 scipy==1.17.1 nibabel==5.4.2 scikit-image==0.26.0 \\
        trimesh==5.2.0 fast-simplification==0.2.0
    apt-get download mricron-data && dpkg-deb -x mricron-data_*.deb scan
    python brain.py scan/usr/share/mricron/templates/ch2bet.nii.gz brain.glb

The same versions make the same bytes; other versions make a mesh that looks the same.
"""

import json
import struct
import sys

import fast_simplification
import nibabel
import numpy as np
import trimesh
from scipy import ndimage
from skimage import measure

TRIANGLES = 60_000
# Between cerebrospinal fluid (about 30) and grey matter (about 90).
LEVEL = 66.0
COLOUR = [0.68, 0.5, 0.44, 1.0]


def surface(path):
    """The brain's surface as a closed mesh in metres, y up, facing +z, standing on y = 0."""
    scan = np.asarray(nibabel.load(path).dataobj).astype(np.float32)
    scan = ndimage.gaussian_filter(np.pad(scan, 2), 0.5)
    # No ventricles: what cannot be seen from outside is not worth its triangles.
    inside = scan > LEVEL
    scan[ndimage.binary_fill_holes(inside) & ~inside] = 100.0
    points, triangles, _, _ = measure.marching_cubes(scan, LEVEL)
    mesh = trimesh.Trimesh(points, triangles)
    mesh = max(mesh.split(only_watertight=False), key=lambda part: len(part.faces))
    trimesh.smoothing.filter_taubin(mesh, iterations=8)
    points, triangles = fast_simplification.simplify(
        np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces), target_count=TRIANGLES
    )
    # Right, front, up in millimetres -> left, up, front in metres (a rotation).
    points = points[:, [0, 2, 1]] * np.float32([-0.001, 0.001, 0.001])
    low, high = points.min(0), points.max(0)
    points -= np.float32([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    mesh = trimesh.Trimesh(points, triangles, process=True)
    if mesh.volume < 0.0:
        mesh.invert()
    return np.asarray(mesh.vertices, "<f4"), np.asarray(mesh.faces)


def glb(points, triangles):
    """The smallest glTF that holds the mesh: positions and 16-bit indices."""
    assert len(points) < 65536
    indices = triangles.astype("<u2").tobytes()
    indices += bytes(-len(indices) % 4)
    binary = indices + points.tobytes()
    document = {
        "asset": {"version": "2.0", "generator": "brain.py", "copyright": "See models/README.md"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "brain"}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": COLOUR}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5123, "count": triangles.size, "type": "SCALAR"},
            {
                "bufferView": 1,
                "componentType": 5126,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(0).tolist(),
                "max": points.max(0).tolist(),
            },
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": triangles.size * 2, "target": 34963},
            {
                "buffer": 0,
                "byteOffset": len(indices),
                "byteLength": points.nbytes,
                "target": 34962,
            },
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(binary))
    chunk = lambda kind, data: struct.pack("<I4s", len(data), kind) + data
    return header + chunk(b"JSON", text) + chunk(b"BIN\0", binary)


if __name__ == "__main__":
    points, triangles = surface(sys.argv[1])
    with open(sys.argv[2], "wb") as file:
        file.write(glb(points, triangles))
    print(f"{len(points)} points, {len(triangles)} triangles")
