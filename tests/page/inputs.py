"""What the tests of pages share: a small molecule, models of it, the tool, and pages taken apart."""

import base64
import json
import math
import os
import re
import struct
import subprocess
import sys
import zlib

SKIP = 77


def skip(why):
    print("skipped:", why)
    sys.exit(SKIP)


def run(*command, **more):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


def need_device(tool):
    if subprocess.run([tool, "devices"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode:
        skip("no OpenCL device")


def write_chain(path, residues=40):
    """A coiled helix of atoms, four to a residue, the last ten residues in chain B."""
    with open(path, "w") as file:
        for i in range(4 * residues):
            r, a = divmod(i, 4)
            wide = 8 + 2.4 * math.cos(0.9 * i)
            x, y = wide * math.cos(0.055 * i), wide * math.sin(0.055 * i)
            file.write("ATOM  %5d  %-3s ALA %s%4d    %8.3f%8.3f%8.3f  1.00  0.00           %s\n" % (
                i + 1, ("N", "CA", "C", "O")[a], "AB"[r >= residues - 10], r + 1, x, y, 0.09 * i + 2.4 * math.sin(0.9 * i),
                ("N", "C", "C", "O")[a]))


def make(tool, folder):
    """chain.pdb, its model and a coarser level in a folder."""
    pdb, model = os.path.join(folder, "chain.pdb"), os.path.join(folder, "chain.ovoid")
    write_chain(pdb)
    run(tool, "fit", pdb, "-o", model, "--ratio", "0.1", "--levels", "2", "--no-measure", "-q",
        "--owners", os.path.join(folder, "owners.csv"))
    return pdb, model, os.path.join(folder, "chain.level2.ovoid")


class Page:
    """The data in a page."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            self.text = file.read()
        self.scene = json.loads(re.search(r'id="scene">(.*?)</script>', self.text).group(1))
        self.blocks = dict(re.findall(r'octet-stream" id="(\w+)">([^<]*)<', self.text))

    def block(self, name):
        return zlib.decompress(base64.b64decode(self.blocks[name], validate=True))

    def surface(self, level, detail):
        s = next(s for s in self.scene["surfaces"] if (s["level"], s["detail"]) == (level, detail))
        data, n = self.block(s["id"]), s["vertices"]
        numbers = integers(data)
        axes = [running(numbers[k * n:(k + 1) * n]) for k in range(5)]
        corners = running(numbers[5 * n:])
        assert len(corners) == 3 * s["triangles"]
        xyz = [[s["low"][k] + s["step"] * axes[k][i] for k in range(3)] for i in range(n)]
        return s, xyz, [unfold(axes[3][i], axes[4][i]) for i in range(n)], corners

    def difference(self, of, level, detail):
        d = next(d for d in self.scene["differences"]
                 if (d["of"], d["level"], d["detail"]) == (of, level, detail))
        values, at = [], 0
        for byte in self.block(d["id"]):
            at = (at + byte) & 255
            values.append((at - 127) / 127 * self.scene["range"])
        return d, values

    def ellipsoids(self, level):
        data = self.block(self.scene["levels"][level]["id"])
        return [struct.unpack_from("<14f", data, 56 * i) for i in range(len(data) // 56)]


def integers(data):
    found, value, shift = [], 0, 0
    for byte in data:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            found.append(-(value + 1 >> 1) if value & 1 else value >> 1)
            value = shift = 0
    return found


def running(steps):
    at, found = 0, []
    for step in steps:
        at += step
        found.append(at)
    return found


def unfold(u, v):
    x, y = u / 1023, v / 1023
    z = 1 - abs(x) - abs(y)
    if z < 0:
        x, y = math.copysign(1 - abs(y), x), math.copysign(1 - abs(x), y)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def read_ply(path):
    """Vertices with normals, and corners, of a mesh that `ovoid mesh` wrote."""
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    vertices = int(re.search(rb"element vertex (\d+)", head).group(1))
    faces = int(re.search(rb"element face (\d+)", head).group(1))
    rows = [struct.unpack_from("<6f", body, 24 * i) for i in range(vertices)]
    corners = []
    for i in range(faces):
        corners += struct.unpack_from("<3I", body, 24 * vertices + 13 * i + 1)
    return rows, corners
