"""Molecules, models, fields and meshes: against closed forms, and the tool's own numbers."""

import base64
import gc
import html
import inspect
import json
import os
import pathlib
import pickle
import re
import subprocess
import sys

import numpy as np
import ovoid
import pytest
from ovoid import _abi

pytestmark = pytest.mark.usefixtures("device")


def test_import_calls_no_opencl(tmp_path):
    """Drivers are loaded by the first OpenCL call: none is there after the import."""
    code = "import ovoid; print(open('/proc/self/maps').read())"
    maps = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout
    assert "libovoid" in maps and "libOpenCL" in maps
    assert "pocl" not in maps and "libLLVM" not in maps


def test_other_layouts_are_refused(monkeypatch):
    grown = _abi._structure("ovoid_pair", *_abi.Pair._fields_, ("more", _abi.c_double))
    monkeypatch.setattr(_abi, "STRUCTURES", [grown])
    with pytest.raises(ImportError, match="ovoid_pair has 24 bytes .* and 32"):
        _abi.check(_abi.lib.cdll)
    monkeypatch.setattr(_abi, "ABI", 99)
    with pytest.raises(ImportError, match="version 1 .* needs version 99"):
        _abi.check(_abi.lib.cdll)


def test_all_structures_are_as_in_the_headers(tmp_path):
    """Offsets of all members, by a C compiler."""
    include = os.environ.get("OVOID_INCLUDE")
    if not include:
        pytest.skip("OVOID_INCLUDE names no headers")
    lines = []
    for header in pathlib.Path(include).glob("ovoid/*.h"):
        for name in re.findall(r"^typedef struct (ovoid_\w+) \{", header.read_text(), re.M):
            assert _abi.lib.sizeof(name.encode()) > 0, name
    for structure in _abi.STRUCTURES:
        name = structure.__name__
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        for field in structure._fields_:
            lines.append(f'printf("{name}.{field[0]} %zu\\n", offsetof({name}, {field[0]}));')
    source = tmp_path / "layout.c"
    source.write_text(
        "#include <ovoid/ovoid.h>\n#include <stdio.h>\nint main(void) {\n"
        + "\n".join(lines)
        + "\nreturn 0;\n}\n"
    )
    program = tmp_path / "layout"
    subprocess.run(["cc", "-I", include, str(source), "-o", str(program)], check=True)
    printed = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    found = dict(line.split() for line in printed.splitlines())
    for structure in _abi.STRUCTURES:
        name = structure.__name__
        grows = structure._fields_[0][0] == "size"  # and then it may have more than is known here
        assert int(found[name]) == _abi.ctypes.sizeof(structure) or grows, name
        for field in structure._fields_:
            offset = getattr(structure, field[0]).offset
            assert int(found[f"{name}.{field[0]}"]) == offset, (name, field)


def test_a_sphere(tmp_path):
    """One atom's surface is a sphere of radius sqrt(r² - ln c / d)."""
    atom = ovoid.Molecule([[1.0, 2.0, 3.0]], radii=2.0)
    mesh = atom.mesh(spacing=0.25)
    assert mesh.area == pytest.approx(4 * np.pi * 4, rel=1e-4)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 8, rel=1e-4)
    radius = np.sqrt(4.0 - np.log(2.0) / 0.7)
    mesh = atom.mesh(spacing=0.25, isovalue=2.0, decay=0.7)
    assert np.linalg.norm(mesh.vertices - [1, 2, 3], axis=1) == pytest.approx(radius, abs=1e-4)
    outward = np.einsum("ij,ij->i", mesh.normals, mesh.vertices - [1, 2, 3])
    assert outward == pytest.approx(radius, abs=1e-3)
    assert mesh.components[0].euler == 2 and mesh.components[0].closed and mesh.pieces == 1
    mesh.write(tmp_path / "sphere.ply")
    assert (tmp_path / "sphere.ply").read_bytes().startswith(b"ply")
    again = ovoid.Mesh(mesh.vertices, mesh.faces)
    assert again.flat_volume == pytest.approx(mesh.flat_volume)
    assert mesh.distances(again).hausdorff == pytest.approx(0, abs=1e-5)


def test_fields(model):
    points = np.random.default_rng(1).uniform(-5, 5, (4, 25, 3)) + model.centres.mean(axis=0)
    value, gradient = ovoid.Field(model)(points, gradient=True)
    z = points[..., None, :] - model.centres
    az = np.einsum("nij,...nj->...ni", model.matrices, z)
    terms = model.amplitudes * np.exp(-np.einsum("...ni,...ni->...n", z, az))
    assert value.shape == (4, 25) and gradient.shape == (4, 25, 3)
    assert value == pytest.approx(terms.sum(axis=-1), rel=1e-5, abs=1e-5)
    expected = -2 * np.einsum("...n,...ni->...i", terms, az)
    assert gradient == pytest.approx(expected, rel=1e-4, abs=1e-4)
    assert np.array_equal(model.field()(points.tolist()), value)
    assert model.field()(np.empty((0, 3))).shape == (0,)


def test_the_tool_says_the_same(peptide_path, peptide, model, tool, tmp_path):
    path = tmp_path / "tool.ovoid"
    report = tool(tmp_path, "fit", peptide_path, "--ellipsoids", 12, "-o", path)
    theirs = ovoid.read_model(path)
    assert theirs.ellipsoids == pytest.approx(model.ellipsoids, rel=1e-8)
    assert theirs.notes["settings"] == model.notes["settings"]
    assert model.report.points == report["points"]
    assert model.report.ellipsoids == report["ellipsoids"] == 12
    measures = model.measure(peptide)
    ours = [measures.area.original, measures.volume.model, measures.deviation]
    ours += [measures.deviation_bound]
    ours += [measures.hausdorff, measures.mean]
    said = [report["area"]["original"], report["volume"]["sparse"], report["deviation"]]
    said += [report["deviation_bound"]]
    said += [report["hausdorff"], report["mean_distance"]]
    assert ours == pytest.approx(said, rel=1e-14)


def test_models(peptide, model, tmp_path):
    assert len(model) == 12 and model.report.reached and "12 ellipsoids" in repr(model)
    assert model.owner.shape == (len(peptide),) and set(model.owner) <= set(range(12))
    again = ovoid.Model(model.centres, model.covariances, model.amplitudes)
    assert again.matrices == pytest.approx(np.array(model.matrices), rel=1e-9, abs=1e-12)
    assert np.linalg.inv(model.matrices) / 2 == pytest.approx(np.array(model.covariances))
    assert again.owner is None and again.report is None
    # On an axis, as far as `axes` says, an ellipsoid's own Gaussian is c.
    strong = model.amplitudes > model.isovalue
    tips = model.centres[:, None] + model.axes[..., None] * model.directions
    z = tips - model.centres[:, None]
    own = model.amplitudes[:, None] * np.exp(-np.einsum("npi,nij,npj->np", z, model.matrices, z))
    assert own[strong] == pytest.approx(model.isovalue)
    model.write(tmp_path / "m.ovoid")
    read = ovoid.read_model(tmp_path / "m.ovoid")
    assert read.ellipsoids == pytest.approx(model.ellipsoids, rel=1e-8)
    model.export(tmp_path / "m.bild", colour=(1, 0, 0))
    assert (tmp_path / "m.bild").stat().st_size > 0


@pytest.mark.parametrize("locked", [np.pi / 2, -np.pi / 2])
def test_gimbal_lock(locked):
    """Where the middle angle is a right one, the other two turn about one axis."""
    angles = np.array([[0.3, locked, 1.1]])
    from ovoid._model import _angles, _rotations

    assert _rotations(_angles(_rotations(angles))) == pytest.approx(_rotations(angles), abs=1e-7)


def test_pickles(peptide, model):
    again = pickle.loads(pickle.dumps(peptide))
    assert np.array_equal(again.xyzr, peptide.xyzr)
    assert np.array_equal(again.atoms["name"], peptide.atoms["name"])
    copy = pickle.loads(pickle.dumps(model))
    assert np.array_equal(copy.ellipsoids, model.ellipsoids)
    assert np.array_equal(copy.owner, model.owner) and repr(copy.report) == repr(model.report)
    assert copy.notes == model.notes


def test_arrays_outlive_their_objects():
    molecule = ovoid.Molecule(np.arange(30.0).reshape(10, 3), 1.5)
    xyz, mesh = molecule.xyz, molecule.mesh(1.0)
    faces = mesh.faces
    expected = np.array(faces)
    del molecule, mesh
    gc.collect()
    for _ in range(10):
        ovoid.Molecule(np.zeros((10, 3)), 1.0).mesh(1.0)
    assert np.array_equal(xyz, np.arange(30.0).reshape(10, 3))
    assert np.array_equal(faces, expected)
    with pytest.raises(ValueError):
        xyz[0, 0] = 1.0


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, ">f8", object])
def test_any_numbers_will_do(kind):
    wide = np.arange(60).reshape(5, 12).astype(kind)
    strided = wide[::2, ::4]
    assert not strided.flags.c_contiguous
    molecule = ovoid.Molecule(strided, [1, 2, 3])
    assert np.array_equal(molecule.xyz, strided.astype(float))
    assert np.array_equal(molecule.radii, [1, 2, 3])


def test_assembly(tmp_path):
    path = tmp_path / "two.pdb"
    path.write_text(
        "REMARK 350 BIOMOLECULE: 1\n"
        "REMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n"
        "REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000\n"
        "REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000\n"
        "REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000\n"
        "REMARK 350   BIOMT1   2  1.000000  0.000000  0.000000       50.00000\n"
        "REMARK 350   BIOMT2   2  0.000000  1.000000  0.000000        0.00000\n"
        "REMARK 350   BIOMT3   2  0.000000  0.000000  1.000000        0.00000\n"
        "ATOM      1  CA  ALA A   1       1.000   2.000   3.000  1.00  0.00           C\n"
    )
    alone = ovoid.read(path)
    assert alone.assemblies == [ovoid.Assembly("1", 2, 2)] and not alone.is_assembly
    pair = ovoid.read(path, assembly="1")
    assert np.array_equal(pair.xyz, [[1, 2, 3], [51, 2, 3]])
    assert pair.placements["translation"].tolist() == [[0, 0, 0], [50, 0, 0]]
    assert pair.atoms["name"].tolist() == [b"CA"] and pair.residues["name"].tolist() == [b"ALA"]


def test_pictures(peptide, model, tmp_path):
    image = model.render(peptide, view="difference", size=(160, 120), samples=1)
    assert image.pixels.shape == (120, 160, 4) and image.range > 0
    assert len(np.unique(image.pixels.reshape(-1, 4), axis=0)) > 100
    assert image._repr_png_().startswith(b"\x89PNG")


def test_pictures_of_two_are_the_same_from_either(peptide, model):
    how = {"view": "difference", "size": (80, 60), "samples": 1}
    pictures = [model.render(peptide, **how), peptide.render(model, **how)]
    assert np.array_equal(pictures[0].pixels, pictures[1].pixels)
    alone = peptide.render(size=(80, 60), samples=1).pixels
    assert not np.array_equal(alone, model.render(size=(80, 60), samples=1).pixels)
    with pytest.raises(ovoid.ArgumentError, match="not a Model and a Model"):
        model.render(model)
    with pytest.raises(ovoid.ArgumentError, match="its own decay"):
        model.render(peptide, decay=0.4)


def test_surfaces_are_meshed_alike(peptide, model):
    for thing in (peptide, model):
        same = [thing.mesh(1.0), thing.field().mesh(1.0), ovoid.Field(thing).field().mesh(1.0)]
        for mesh in same[1:]:
            assert np.array_equal(same[0].vertices, mesh.vertices)
        assert thing.mesh(1.0, isovalue=2.0).area < same[0].area
    with pytest.raises(ovoid.ArgumentError, match="a model has its own decay"):
        model.mesh(decay=0.4)
    with pytest.raises(ovoid.ArgumentError, match="a field has its own decay"):
        model.field().mesh(decay=0.4)
    with pytest.raises(ovoid.ArgumentError, match="the context that it was made with"):
        model.field().mesh(context=ovoid.Context())


def test_options_of_fits_have_names(peptide):
    shown = inspect.signature(ovoid.Molecule.fit).parameters
    assert shown["method"].default == "adaptive" and shown["decay"].default is None
    assert inspect.signature(ovoid.Fitter).parameters.keys() - {"molecule"} < shown.keys()
    text = ovoid.Molecule.fit.__doc__
    for name in shown.keys() - {"self"}:
        assert re.search(rf"^        [\w, ]*\b{name}\b[\w, ]* : ", text, re.M), name
    for function, wrong in (
        (peptide.fit, "spacng"),
        (ovoid.Fitter(peptide).fit, "decay"),
        (lambda **options: ovoid.Fitter(peptide, **options), "effort"),
        (lambda **options: ovoid.fit_trajectory([peptide.xyz], peptide, **options), "steps"),
    ):
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{wrong}'"):
            function(**{wrong: 1})


def test_a_page_in_a_notebook(peptide, model, tmp_path):
    shown = model._repr_mimebundle_()
    assert shown["text/plain"] == repr(model) and shown["text/html"].startswith("<iframe srcdoc=")
    page = html.unescape(shown["text/html"].partition('srcdoc="')[2].partition('" title=')[0])
    assert page == ovoid.Scene(peptide, model).to_html(max_triangles=2e5)
    assert model.molecule is peptide and "<canvas" in page
    assert base64.b64decode(shown["image/png"]).startswith(b"\x89PNG")
    ovoid.Scene(None, model, title="Ä").export(tmp_path / "m.html")
    assert "Ä" in (tmp_path / "m.html").read_text("utf-8")
    sizes = []
    for colouring in ("plain", "residue"):
        path = tmp_path / f"{colouring}.ply"
        ovoid.Scene(peptide, model).export(path, colouring=colouring, spacing=1.0)
        sizes.append(path.stat().st_size)
    assert sizes[0] < sizes[1]
    with pytest.raises(ovoid.ArgumentError, match="molecule or a model"):
        ovoid.Scene(None)


def test_fitter(peptide):
    fitter = ovoid.Fitter(peptide)
    coarse, fine = fitter.fit(ellipsoids=6), fitter.fit(ellipsoids=12)
    assert (len(coarse), len(fine)) == (6, 12)
    fitter.move(peptide.xyz + [10.0, 0.0, 0.0])
    moved = fitter.fit(ellipsoids=12)
    assert moved.centres.mean(axis=0) - fine.centres.mean(axis=0) == pytest.approx(
        [10, 0, 0], abs=0.2
    )
    assert np.array_equal(moved.owner, fine.owner)


def test_selftest(monkeypatch):
    """As the tool has it; what is wrong is told, and no error."""
    told = []
    found = ovoid.selftest(brief=True, progress=told.append)
    command = [os.environ.get("OVOID_TOOL", "ovoid"), "selftest", "--short", "--json"]
    tool = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    assert found.passed and told
    assert [c.name for c in found.checks] == [c["name"] for c in tool["checks"]]
    for check, theirs in zip(found.checks, tool["checks"]):
        assert check.kernels == tuple(theirs["kernels"].split()) and check.text == ""
        assert check.numbers == theirs["numbers"] and 0 <= check.error <= 1
    assert found.device == ovoid.use_device(None) and found.round_trip_seconds > 0
    assert len(str(found).splitlines()) == len(found.checks) + 2 and "0 wrong" in repr(found)

    def wrong(handle, options, told, user, result):
        for verdict in range(3):
            raw = _abi.Check(name=b"lists", kernels=b"a b", verdict=verdict, text=b"off")
            told(_abi.ctypes.addressof(raw), None)
        return 0

    monkeypatch.setattr(_abi.lib, "selftest", wrong)
    found = ovoid.selftest()
    assert [c.verdict for c in found.checks] == ["passed", "wrong", "failed"]
    assert not found.passed and "1 wrong, 1 failed" in repr(found) and "    off" in str(found)


def test_selftest_can_be_stopped():
    with pytest.raises(ovoid.Cancelled):
        ovoid.selftest(progress=lambda _: False)
    assert ovoid.selftest(brief=True).passed


def test_parts(peptide):
    """However many are fitted side by side, the model is the same."""
    alone = peptide.fit(ratio=0.2, part_atoms=64)
    assert alone.report.parts > 1 and "parts " in alone.notes["settings"]
    beside = peptide.fit(ratio=0.2, part_atoms=64, jobs=2)
    assert np.array_equal(alone.ellipsoids, beside.ellipsoids)
    assert peptide.fit(ratio=0.2).report.parts == 1
    with pytest.raises(ovoid.ArgumentError, match="parts.atoms"):
        peptide.fit(part_atoms=3)
