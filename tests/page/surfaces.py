"""surfaces.py OVOID: surfaces with colours as PLY, glTF and 3MF, and MSMS's files, against the plain mesh
that `ovoid mesh` writes, a page's distances, and the atoms of the molecule."""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
import zipfile

from inputs import Page, make, need_device, read_ply, run

tool = os.path.abspath(sys.argv[1])


def read_colours(path):
    """Rows x, y, z, nx, ny, nz, red, green, blue and, where it has one, quality; and the corners."""
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    row = "<6f3Bf" if b"quality" in head else "<6f3B"
    vertices = int(re.search(rb"element vertex (\d+)", head).group(1))
    faces = int(re.search(rb"element face (\d+)", head).group(1))
    size = struct.calcsize(row)
    rows = [struct.unpack_from(row, body, size * i) for i in range(vertices)]
    assert len(body) == size * vertices + 13 * faces
    return rows, [c for i in range(faces)
                  for c in struct.unpack_from("<3I", body, size * vertices + 13 * i + 1)]


def encode(linear):
    return round(255 * (12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055))


def read_glb(path):
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20:20 + length]), data[28 + length:]

    def values(accessor, code, parts):
        a = document["accessors"][accessor]
        at = document["bufferViews"][a["bufferView"]]["byteOffset"]
        size = struct.calcsize("<%d%s" % (parts, code))
        return [struct.unpack_from("<%d%s" % (parts, code), binary, at + size * i) for i in range(a["count"])]

    primitive, = document["meshes"][0]["primitives"]
    colours = values(primitive["attributes"]["COLOR_0"], "H", 4)
    assert document["accessors"][3]["normalized"] and all(c[3] == 65535 for c in colours)
    return (values(primitive["attributes"]["POSITION"], "f", 3),
            [tuple(encode(part / 65535) for part in c[:3]) for c in colours],
            [c for c, in values(primitive["indices"], "I", 1)])


def read_3mf(path):
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == ["[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"]
        for part in archive.namelist():
            xml.fromstring(archive.read(part))
        model = xml.fromstring(archive.read("3D/3dmodel.model"))
    core = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    materials = "{http://schemas.microsoft.com/3dmanufacturing/material/2015/02}"
    assert model.get("unit") == "millimeter"
    palette = [c.get("color") for c in model.iter(materials + "color")]
    vertices = [tuple(float(v.get(k)) for k in "xyz") for v in model.iter(core + "vertex")]
    corners, colour = [], {}
    for t in model.iter(core + "triangle"):
        for v, p in (("v1", "p1"), ("v2", "p2"), ("v3", "p3")):
            corners.append(int(t.get(v)))
            if palette:
                colour[corners[-1]] = palette[int(t.get(p))]
    moved = [float(x) for x in model.find(f"{core}build/{core}item").get("transform").split()]
    assert moved[:9] == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert all(0 <= min(v[k] for v in vertices) + moved[9 + k] < 1 for k in range(3))
    return vertices, colour, corners


def read_atoms(path):
    with open(path) as file:
        return [(float(l[30:38]), float(l[38:46]), float(l[46:54]), l[21], l[22:26].strip()) for l in file]


def radii(name):
    """Bondi's."""
    return {"N": 1.55, "C": 1.7, "O": 1.52}[name]


def nearest_atoms(rows, atoms, elements):
    for row in rows:
        yield min(range(len(atoms)), key=lambda i: sum((a - b) ** 2 for a, b in zip(row, atoms[i])) -
                  radii(elements[i]) ** 2)


def check_msms(plain, triangles, atoms, elements):
    with open("s.vert") as file:
        lines = file.read().splitlines()
    with open("s.face") as file:
        faces = file.read().splitlines()
    assert lines[0].startswith("#") and lines[1].startswith("#") and faces[1].startswith("#")
    assert lines[2].split()[:2] == [str(len(plain)), "160"] and len(lines) == 3 + len(plain)
    assert faces[2].split()[:2] == [str(len(triangles) // 3), "160"]
    density = float(lines[2].split()[2]) # vertices per square angstrom, two triangles to a vertex
    assert 2 < density < 12, density
    rows = [line.split() for line in lines[3:]]
    assert all(len(row) == 9 for row in rows)
    for row, wanted in zip(rows, plain):
        assert max(abs(float(a) - b) for a, b in zip(row[:6], wanted)) < 2e-5, (row, wanted)
    corners = [int(c) - 1 for line in faces[3:] for c in line.split()[:3]]
    assert corners == triangles
    sample = range(0, len(plain), 17)
    for v, atom in zip(sample, nearest_atoms([plain[v][:3] for v in sample], atoms, elements)):
        assert int(rows[v][7]) == atom + 1, (rows[v], atom)
    return [int(row[7]) - 1 for row in rows]


def check_groups(path, group_of_vertex):
    """One colour for each group, and not one for all."""
    rows, _ = read_colours(path)
    assert len(rows[0]) == 9
    colours = {}
    for row, group in zip(rows, group_of_vertex):
        colours.setdefault(group, set()).add(row[6:9])
    assert all(len(found) == 1 for found in colours.values())
    return len({next(iter(found)) for found in colours.values()}), len(colours)


with tempfile.TemporaryDirectory() as folder:
    need_device(tool)
    os.chdir(folder)
    pdb, model, _ = make(tool, folder)
    how = ("--radii", "bondi")
    run(tool, "mesh", pdb, "-o", "plain.ply", *how)
    plain, triangles = read_ply("plain.ply")
    atoms, elements = read_atoms(pdb), [line[77] for line in open(pdb)]

    run(tool, "export", pdb, model, "-o", "s.html", *how)
    run(tool, "export", pdb, model, "-o", "s.ply", *how)
    rows, corners = read_colours("s.ply")
    assert corners == triangles and [r[:6] for r in rows] == plain
    page = Page("s.html")
    _, differences = page.difference("molecule", 0, 0)
    limit = page.scene["range"]
    for row, known in zip(rows, differences):
        assert abs(max(-limit, min(limit, row[9])) - known) < 0.51 * limit / 127, (row, known)
        if abs(row[9]) > 0.5 * limit:
            assert (row[6] > row[8]) == (row[9] > 0), "red outside, blue inside"
        elif abs(row[9]) < 0.02 * limit:
            assert min(row[6:9]) > 200, "white between"

    for name, read in (("s.glb", read_glb), ("s.3mf", read_3mf)):
        run(tool, "export", pdb, model, "-o", name, *how)
        vertices, colours, corners = read(name)
        assert corners == triangles
        for v, row in enumerate(rows):
            assert max(abs(a - b) for a, b in zip(vertices[v], row)) < 1e-4
            wanted = row[6:9] if name == "s.glb" else "#%02X%02X%02X" % row[6:9]
            assert colours[v] == wanted, (name, v, colours[v], wanted)
        if shutil.which("assimp"):
            said = subprocess.run(["assimp", "info", name], stdout=subprocess.PIPE, text=True).stdout
            found = re.search(r"Faces:\s+(\d+)", said)
            assert found and int(found.group(1)) == len(triangles) // 3, said

    run(tool, "export", pdb, "-o", "s.vert", *how)
    atom = check_msms(plain, triangles, atoms, elements)
    run(tool, "export", pdb, "-o", "c.ply", "--colour-by", "chain", *how)
    assert check_groups("c.ply", [atoms[a][3] for a in atom]) == (2, 2)
    run(tool, "export", pdb, "-o", "r.ply", "--colour-by", "residue", *how)
    colours, groups = check_groups("r.ply", [atoms[a][4] for a in atom])
    assert groups > 30 and colours > 0.8 * groups
    run(tool, "export", pdb, model, "-o", "e.ply", "--colour-by", "ellipsoid", *how)
    colours, groups = check_groups("e.ply", atom) # an atom counts for one ellipsoid
    assert 8 < colours <= 16 < groups

    run(tool, "export", model, "-o", "m.3mf")
    run(tool, "mesh", model, "-o", "m.ply")
    vertices, colours, corners = read_3mf("m.3mf")
    assert not colours and corners == read_ply("m.ply")[1]
    run(tool, "export", pdb, "-o", "p.ply", *how)
    assert read_ply("p.ply") == (plain, triangles), "without colours it is the plain mesh"
print("surfaces with colours read back")
