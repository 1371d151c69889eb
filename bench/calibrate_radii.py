#!/usr/bin/env python3
"""Calibrates the radii that stand for missing hydrogens, and checks them (docs/radii.md).

    bench/calibrate_radii.py --ovoid build/release/ovoid --molecules DIR [--steps calibrate,check,...]

makes the pairs with pdb2pqr and then, step by step: 'calibrate' fits the radii to some of the pairs and
writes host/molecule/united_table.c; 'check' measures all pairs with the tool, 'fits' counts the ellipsoids of
default fits of those held back, 'volumes' compares 1CRN and 1UBQ with counts in double precision: these
write bench/results/united_*.csv. All take the radii from united_table.c; the tool need not be built again.
Needs pdb2pqr, and gemmi, numpy and scipy for Python.
"""

import argparse
import concurrent.futures
import json
import math
import os
import re
import subprocess
import sys
import tempfile

import numpy as np
from scipy.optimize import lsq_linear, minimize

import common
import surface
import united_facts
import united_pairs
from united_pairs import BONDI

TABLE = os.path.join(common.HERE, "..", "host", "molecule", "united_table.c")
RESULTS = os.path.join(common.HERE, "results")
DECAY = 0.5

# How many hydrogens each element may stand for, and how many atoms of the pairs fitted to must stand for
# so many that their radius is fitted.
MOST = {"C": 4, "N": 4, "O": 2, "P": 0, "S": 2, "SE": 1}
ENOUGH = 20

# Lattice of the local fit, and ln phi of the points that count.
SPACING, LAYER = 0.5, 0.4

# The final fit minimizes the mean of (error / ERROR)^4 over areas and volumes, + (distance / DISTANCE)^2 with
# the root mean square distance of the surfaces, + the sum of (change / CHANGE)^2 over the radii, where
# change is from the local fit. Areas, which are harder to meet, weigh more.
ERROR, AREAS, DISTANCE, CHANGE = 0.01, 1.3, 0.6, 0.9
STEP, ROUNDS, PROCESSES = 0.03, 2, 2


def say(text):
    print(text, file=sys.stderr, flush=True)


# ---- the local fit --------------------------------------------------------------------------------


def groups_of(pair):
    return [(atom.element, count) for atom, count in zip(pair.atoms, pair.bonded)]


def slabs_of(atoms, margin=4.0, layers=16):
    low, high = atoms[:, :3].min(axis=0) - margin, atoms[:, :3].max(axis=0) + margin
    axes = [np.arange(a, b, SPACING) for a, b in zip(low, high)]
    for first in range(0, len(axes[0]), layers):
        yield axes[0][first : first + layers], axes[1], axes[2]


def near(atoms, axis):
    reach = np.sqrt(atoms[:, 3] ** 2 - math.log(surface.LEAST) / DECAY)
    return (atoms[:, 0] + reach > axis[0]) & (atoms[:, 0] - reach < axis[-1])


def local_equations(pair, names):
    """Normal equations of the amplitudes exp(d r^2) of the groups, which make the field of the heavy atoms
    that with hydrogens at the latter's surface; misfits are weighed as distances of the surfaces."""
    everything = pair.protonated()
    heavy = np.column_stack([pair.places[pair.heavy], np.zeros(len(pair.heavy))])
    index = np.array([names.index(group) for group in groups_of(pair)])
    matrix, right, weight, square = np.zeros((len(names),) * 2), np.zeros(len(names)), 0.0, 0.0
    for axes in slabs_of(everything):
        slab = surface.Slab(everything[near(everything, axes[0])], DECAY, axes)
        layer = np.abs(np.log(np.maximum(slab.field, 1e-300))) < LAYER
        steepness = np.maximum(np.sqrt(np.sum(slab.gradient**2, axis=0))[layer], 0.3)
        rows = np.zeros((len(steepness), len(names)))
        for k in set(index):
            rows[:, k] = surface.Slab(heavy[(index == k) & near(heavy, axes[0])], DECAY, axes).field[layer]
        rows /= np.sqrt(steepness)[:, None]  # 1 / steepness, of layers as thick as 1 / steepness
        matrix += rows.T @ rows
        right += rows.T @ (slab.field[layer] / np.sqrt(steepness))
        square += float(np.sum(slab.field[layer] ** 2 / steepness))
        weight += float(np.sum(steepness))
    return matrix, right, square, weight


def added_up(element, count):
    """All Gaussians of a group at the place of its heavy atom."""
    radius = {**BONDI, "SE": 1.9}[element]
    return math.exp(DECAY * radius**2) + count * math.exp(DECAY * BONDI["H"] ** 2)


def radius_of(amplitude):
    return math.sqrt(math.log(amplitude) / DECAY)


class Local:
    """Mean squared distance of the surfaces as a quadratic function of the groups' amplitudes, and the
    radii where it is least. No radius falls below the atom's own."""

    def __init__(self, pairs):
        self.counts = {}
        for pair in pairs:
            for group in groups_of(pair):
                self.counts[group] = self.counts.get(group, 0) + 1
        self.names = sorted(name for name, count in self.counts.items() if count >= ENOUGH)
        self.least = np.array([BONDI[element] for element, _ in self.names])
        sums = [sum(parts) for parts in zip(*(local_equations(pair, sorted(self.counts)) for pair in pairs))]
        keep = [sorted(self.counts).index(name) for name in self.names]
        self.matrix = sums[0][np.ix_(keep, keep)] / sums[3]
        self.right, self.square = sums[1][keep] / sums[3], sums[2] / sums[3]
        self.radii = self.solve()

    def solve(self):
        some = 1e-9 * np.trace(self.matrix) * np.eye(len(self.names))
        upper = np.linalg.cholesky(self.matrix + some).T
        right = np.linalg.solve(upper.T, self.right)
        least = np.exp(DECAY * self.least**2)
        return np.sqrt(np.log(lsq_linear(upper, right, (least, np.inf), method="bvls").x) / DECAY)

    def squared_distance(self, radii):
        """With its derivatives; in square angstrom."""
        amplitudes = np.exp(DECAY * radii**2)
        along = self.matrix @ amplitudes
        value = amplitudes @ (along - 2 * self.right) + self.square
        return value, 2 * (along - self.right) * amplitudes * 2 * DECAY * radii


# ---- areas and volumes ----------------------------------------------------------------------------


def write_xyzr(path, atoms):
    with open(path, "w", encoding="utf-8") as out:
        out.writelines(f"{x:.4f} {y:.4f} {z:.4f} {r:.4f}\n" for x, y, z, r in atoms)


def mesh(ovoid, atoms, spacing):
    """Area and volume of atoms."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "atoms.xyzr")
        write_xyzr(path, atoms)
        done = subprocess.run([ovoid, "mesh", path, "-o", os.path.join(folder, "mesh.ply"), "--spacing",
                               str(spacing)], capture_output=True, text=True, check=True)  # fmt: skip
    return [float(re.search(rf"^{word}\s+(\S+)", done.stdout, re.M)[1]) for word in ("area", "volume")]


def errors_of(pair, names, wanted, radii, ovoid):
    made = np.array(mesh(ovoid, pair.united(table_of(dict(zip(names, radii)))), SPACING))
    return made / wanted - 1


def linearize(pair, names, radii, ovoid):
    """Errors of area and volume, and their derivatives by the radii, from differences."""
    wanted = np.array(mesh(ovoid, pair.protonated(), SPACING))
    now = errors_of(pair, names, wanted, radii, ovoid)
    here = set(groups_of(pair))
    slopes = [(errors_of(pair, names, wanted, radii + STEP * unit, ovoid) - now) / STEP
              if name in here else np.zeros(2) for name, unit in zip(names, np.eye(len(names)))]
    return now, np.array(slopes).T


def least_of(local, base, now, slopes):
    """The radii where the objective is least, errors being linear."""
    weights = np.array([AREAS, 1.0]) / ERROR

    def objective(radii):
        error = (now + slopes @ (radii - base)) * weights
        distance, along = local.squared_distance(radii)
        change = (radii - local.radii) / CHANGE
        value = np.mean(error**4) + distance / DISTANCE**2 + np.sum(change**2)
        slope = 4 / error.size * np.einsum("iq,iqk->k", error**3 * weights, slopes)
        return value, slope + along / DISTANCE**2 + 2 * change / CHANGE

    bounds = [(least, 3.0) for least in local.least]
    return minimize(objective, base, jac=True, bounds=bounds, method="L-BFGS-B").x


def fit_globally(pairs, local, ovoid):
    """Moves the radii for the sake of areas and volumes, which depend on them nearly linearly."""
    radii = local.radii
    for _ in range(ROUNDS):
        with concurrent.futures.ThreadPoolExecutor(PROCESSES) as pool:
            parts = list(pool.map(lambda pair: linearize(pair, local.names, radii, ovoid), pairs))
        now, slopes = (np.array(part) for part in zip(*parts))
        say(f"errors of area and volume in %: {np.round(100 * now, 2).tolist()}")
        radii = least_of(local, radii, now, slopes)
        distance = math.sqrt(local.squared_distance(radii)[0])
        say(f"{dict(zip(local.names, radii.round(3)))}, surfaces {distance:.3f} apart")
    return dict(zip(local.names, radii))


# ---- the table ------------------------------------------------------------------------------------


def table_of(radii):
    """element -> radii by number of hydrogens. Groups that were not fitted have the Gaussians added up,
    and the mean of what the fit changed on the element's groups."""
    table = {}
    for element, most in MOST.items():
        like = "S" if element == "SE" else element
        fitted = [count for count in range(MOST[like] + 1) if (like, count) in radii]
        change = np.mean([radii[like, count] - radius_of(added_up(like, count)) for count in fitted])
        table[element] = [radii.get((element, count), radius_of(added_up(element, count)) + float(change))
                          for count in range(most + 1)]
    return table


def read_table():
    """The radii of the C table."""
    with open(TABLE, encoding="utf-8") as text:
        rows = re.findall(r'\{"(\w+)", \d+, \d+, \{([\d., ]+)\}\}', text.read())
    return {element: [float(value) for value in values.split(",")] for element, values in rows}


# ---- checks ---------------------------------------------------------------------------------------


def write_model(path, atoms, decay, isovalue):
    """Atoms as ellipsoids, so that 'ovoid measure' compares two sets of atoms."""
    with open(path, "w", encoding="utf-8") as out:
        out.write(f"# ovoid model 1\n# decay: {decay}\n# isovalue: {isovalue}\n"
                  "# amplitude decay1 decay2 decay3 x y z alpha beta gamma\n")
        for x, y, z, r in atoms:
            out.write(f"{math.exp(decay * r * r):.12g} {decay} {decay} {decay} {x} {y} {z} 0 0 0\n")


def compare(ovoid, atoms, reference, decay, isovalue, spacing):
    """What 'ovoid measure' says of atoms beside the reference."""
    with tempfile.TemporaryDirectory() as folder:
        molecule, model = os.path.join(folder, "a.xyzr"), os.path.join(folder, "b.ovoid")
        write_xyzr(molecule, atoms)
        write_model(model, reference, decay, isovalue)
        return common.report_of(ovoid, ["measure", molecule, model, "--spacing", str(spacing)])


COLUMNS = ["pair", "use", "hydrogens", "radii", "decay", "isovalue", "spacing", "atoms", "area", "volume",
           "area_with_hydrogens", "volume_with_hydrogens", "area_error_percent", "volume_error_percent",
           "area_outer_error_percent", "volume_outer_error_percent", "pieces", "pieces_with_hydrogens",
           "mean_distance", "deviation"]  # fmt: skip


def percent(measure):
    return round(100 * (measure["original"] / measure["sparse"] - 1), 3)


def row_of(pair, radii, report, decay, isovalue):
    return {
        "pair": pair.name, "use": "fitted" if pair.used else "held back", "hydrogens": pair.source,
        "radii": radii, "decay": decay, "isovalue": isovalue, "spacing": report["mesh_spacing"],
        "atoms": report["atoms"],
        "area": round(report["area"]["original"], 1), "volume": round(report["volume"]["original"], 1),
        "area_with_hydrogens": round(report["area"]["sparse"], 1),
        "volume_with_hydrogens": round(report["volume"]["sparse"], 1),
        "area_error_percent": percent(report["area"]), "volume_error_percent": percent(report["volume"]),
        "area_outer_error_percent": percent(report["area_outer"]),
        "volume_outer_error_percent": percent(report["volume_outer"]),
        "pieces": report["components"]["original"], "pieces_with_hydrogens": report["components"]["sparse"],
        "mean_distance": round(report["mean_distance"], 4), "deviation": round(report["deviation"], 3),
    }  # fmt: skip


SETTINGS = [(0.5, 1.0), (0.3, 1.0), (0.7, 1.0), (0.5, 0.5), (0.5, 2.0)]


def check(pairs, table, ovoid, spacing, settings):
    rows = []
    for pair in pairs:
        for decay, isovalue in settings:
            for name, atoms in (("bondi", pair.bare()), ("united", pair.united(table))):
                if name == "bondi" and (decay, isovalue) != SETTINGS[0]:
                    continue
                fine = spacing if (decay, isovalue) == SETTINGS[0] else SPACING
                report = compare(ovoid, atoms, pair.protonated(), decay, isovalue, fine)
                rows.append(row_of(pair, name, report, decay, isovalue))
                say("{pair} {radii} d={decay} c={isovalue}: area {area_error_percent} % "
                    "volume {volume_error_percent} % outer {area_outer_error_percent} "
                    "{volume_outer_error_percent} pieces {pieces}".format(**rows[-1]))
    return rows


FIT_COLUMNS = ["pair", "radii", "atoms", "ellipsoids", "deviation"]
FIT_MOST = 4000  # atoms: larger ones take long


def fits(pairs, table, ovoid):
    """Ellipsoids of default fits."""
    rows = []
    for pair in pairs:
        sets = (("protonated", pair.protonated()), ("united", pair.united(table)), ("bondi", pair.bare()))
        for name, atoms in sets:
            with tempfile.TemporaryDirectory() as folder:
                path = os.path.join(folder, "atoms.xyzr")
                write_xyzr(path, atoms)
                report = common.report_of(ovoid, ["fit", path, "-o", os.path.join(folder, "m.ovoid")], (0, 7))
            rows.append({"pair": pair.name, "radii": name, "atoms": len(atoms),
                         "ellipsoids": report["ellipsoids"],
                         "deviation": round(report["deviation"], 3)})  # fmt: skip
            say(json.dumps(rows[-1]))
    return rows


VOLUME_COLUMNS = ["pair", "radii", "spacing", "volume_count", "volume_ovoid", "volume_difference_percent",
                  "area_layers", "area_ovoid", "area_difference_percent"]  # fmt: skip


def volumes(pairs, table, ovoid, counted, meshed):
    """Volume and area in double precision by other means, beside the tool's."""
    rows = []
    for pair in pairs:
        for name, atoms in (("protonated", pair.protonated()), ("bondi", pair.bare()),
                            ("united", pair.united(table))):  # fmt: skip
            area, volume = surface.measure(np.round(atoms, 4), counted)
            report = compare(ovoid, atoms, atoms, DECAY, 1.0, meshed)
            tool = report["area"]["original"], report["volume"]["original"]
            rows.append({"pair": pair.name, "radii": name, "spacing": f"{counted}/{meshed}",
                         "volume_count": round(volume, 2), "volume_ovoid": round(tool[1], 2),
                         "volume_difference_percent": round(100 * (tool[1] / volume - 1), 4),
                         "area_layers": round(area, 2), "area_ovoid": round(tool[0], 2),
                         "area_difference_percent": round(100 * (tool[0] / area - 1), 4)})  # fmt: skip
            say(json.dumps(rows[-1]))
    return rows


def parse():
    options = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    options.add_argument("--ovoid", required=True)
    options.add_argument("--molecules", required=True, help="folder with the structures")
    options.add_argument("--pdb2pqr", default="pdb2pqr")
    options.add_argument("--steps", default="calibrate,check,fits,volumes")
    options.add_argument("--spacing", type=float, default=0.3, help="of the meshes that check")
    return options.parse_args()


def write(name, comment, columns, rows):
    common.write_table(os.path.join(RESULTS, name), comment, columns, rows)


def calibrate(pairs, ovoid):
    used = [pair for pair in pairs if pair.used]
    local = Local(used)
    say(f"atoms by hydrogens: {local.counts}\nlocally: {dict(zip(local.names, local.radii.round(3)))}")
    radii = fit_globally(used, local, ovoid)
    united_facts.write_table(TABLE, table_of(radii))
    subprocess.run(["clang-format", "-i", TABLE], check=True)


def main():
    given = parse()
    pairs = united_pairs.make_pairs(given.molecules, given.pdb2pqr, say)
    steps = given.steps.split(",")
    if "calibrate" in steps:
        calibrate(pairs, given.ovoid)
    table = read_table()
    if "check" in steps:
        write("united_radii.csv", "surfaces of heavy atoms beside those with hydrogens; lengths in angstrom",
              COLUMNS, check(pairs, table, given.ovoid, given.spacing, SETTINGS))  # fmt: skip
    if "fits" in steps:
        some = [pair for pair in pairs if not pair.used and len(pair.places) <= FIT_MOST]
        write("united_fits.csv", "ellipsoids of default fits of pairs held back", FIT_COLUMNS,
              fits(some, table, given.ovoid))  # fmt: skip
    if "volumes" in steps:
        known = [pair for pair in pairs if pair.name in ("1CRN", "1UBQ")]
        write("united_volumes.csv", "counts in double precision beside the tool's meshes", VOLUME_COLUMNS,
              volumes(known, table, given.ovoid, 0.1, 0.3))  # fmt: skip


if __name__ == "__main__":
    main()
