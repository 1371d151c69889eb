"""data.py OVOID: what a page holds, taken apart, is what other commands say of the same scene."""

import json
import math
import os
import re
import sys
import tempfile

from inputs import Page, make, need_device, read_ply, run

tool = os.path.abspath(sys.argv[1])


def check_surface(page, level, detail, ply):
    s, xyz, normals, corners = page.surface(level, detail)
    rows, wanted = read_ply(ply)
    assert corners == wanted, "triangles"
    assert len(rows) == len(xyz)
    for row, at, normal in zip(rows, xyz, normals):
        assert max(abs(a - b) for a, b in zip(row, at)) < 0.51 * s["step"] + 1e-5, (row, at)
        assert sum(a * b for a, b in zip(row[3:], normal)) > 0.99999, (row[3:], normal)
    return xyz, normals


def nearest(point, others):
    """The way to the nearest of the others."""
    return min(([b - a for a, b in zip(point, other)] for other in others),
               key=lambda way: sum(x * x for x in way))


def check_difference(page, molecule, model):
    """At a vertex: about the distance to the other surface, and the sign says which is outside: the
    model's is where the way from the molecule's goes along the normal."""
    step = page.scene["range"] / 127
    for of, (mine, normals), other, along in (("molecule", molecule, model[0], 1),
                                              ("model", model, molecule[0], -1)):
        d, values = page.difference(of, 0, 0)
        assert len(values) == len(mine)
        signs = set()
        for i in range(0, len(mine), 37):
            way = nearest(mine[i], other) # to a vertex, which are half an angstrom apart
            far = math.hypot(*way)
            if abs(values[i]) > 0.4:
                assert along * sum(a * b for a, b in zip(way, normals[i])) * values[i] > 0, (of, i)
            if abs(values[i]) < page.scene["range"]:
                assert abs(values[i]) < far + step, (values[i], far)
                assert far < math.hypot(abs(values[i]), 0.5) + step, (values[i], far)
            signs.add(values[i] > 0)
        assert signs == {True, False} and 0 < d["largest"] < 3
        yield sum(values) / len(values)


def check_ellipsoids(page, level, listing):
    records, origin = page.ellipsoids(level), page.scene["origin"]
    assert len(records) == len(listing["ellipsoids"]) == page.scene["levels"][level]["ellipsoids"]
    for record, e in zip(records, listing["ellipsoids"]):
        wanted = [c - o for c, o in zip(e["centre"], origin)] + e["semi_axes"] + e["axes"][0] + \
            e["axes"][1] + [e["amplitude"]]
        assert all(abs(a - b) < 1e-4 * (1 + abs(b)) for a, b in zip(record, wanted)), (record, wanted)
    return records


def check_names(page, records):
    names = json.loads(page.block(page.scene["levels"][0]["names"]))
    assert len(names) == len(records)
    assert sum(record[13] for record in records) == page.scene["atoms"] == 160
    found = set()
    for text in names:
        for chain in filter(None, text.split("; ")):
            label, residues = chain.split(": ")
            assert label in "AB"
            found |= {label + " " + r for r in residues.split(", ")}
    assert found == {"%s ALA %d" % ("AB"[n > 30], n) for n in range(1, 41)}, found


with tempfile.TemporaryDirectory() as folder:
    need_device(tool)
    os.chdir(folder)
    pdb, model, coarse = make(tool, folder)
    said = run(tool, "export", pdb, model, coarse, "-o", "view.html")
    assert re.search(r"160 atoms, 16 / 8 ellipsoids, written to view.html as html", said), said
    page = Page("view.html")

    assert not re.search(r"""(src|href)=["']|https?://|@import|url\(""", page.text), "something to fetch"
    assert page.text.rstrip().endswith("</html>") and "<title>chain.pdb" in page.text
    assert len(page.scene["surfaces"]) == 6 and len(page.scene["differences"]) == 8

    run(tool, "mesh", pdb, "-o", "molecule.ply")
    run(tool, "mesh", model, "-o", "model.ply")
    run(tool, "mesh", coarse, "-o", "coarse.ply", "--spacing", "1")
    at = check_surface(page, -1, 0, "molecule.ply")
    other = check_surface(page, 0, 0, "model.ply")
    check_surface(page, 1, 1, "coarse.ply")
    means = list(check_difference(page, at, other))
    assert abs(means[0] - means[1]) < 0.1, means # the same of both surfaces

    for level, path in enumerate((model, coarse)):
        run(tool, "export", path, "-o", "list.json")
        with open("list.json") as file:
            records = check_ellipsoids(page, level, json.load(file))
        if level == 0:
            check_names(page, records)

    # Fewer triangles, another range, and a title that would break a page.
    odd = "a<b>&'@SCENE@\".pdb"
    os.rename(pdb, odd)
    run(tool, "export", odd, model, "-o", "odd.html", "--max-triangles", "3000", "--range", "0.7")
    small = Page("odd.html")
    assert small.scene["title"] == odd and small.scene["range"] == 0.7
    assert "<b>" not in small.text.split("<style>")[0]
    assert 1500 < small.surface(-1, 0)[0]["triangles"] < 3600
    assert len(small.text) < 0.5 * len(page.text)

    # A molecule alone, and a model alone.
    run(tool, "export", odd, "-o", "alone.html")
    alone = Page("alone.html").scene
    assert alone["levels"] == [] and alone["atoms"] == 160 and len(alone["surfaces"]) == 2
    run(tool, "export", model, "-o", "alone.html")
    alone = Page("alone.html").scene
    assert len(alone["levels"]) == 1 and alone["atoms"] is None and alone["differences"] == []
print("a page holds the scene")
