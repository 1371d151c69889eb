#!/usr/bin/env python3
"""The experiments of the paper (Gui, Chen, Lu, arXiv:1909.09095) with `ovoid fit` and `measure`.

    paper.py --molecules DIR [--molecules DIR]... [--ovoid build/release/ovoid] [--names A,B]
             [--output bench/results/paper.csv] [--figures bench/results]
             [--work DIR [--reuse]] [--up-to 2000] [--iterations N]
    paper.py --molecules DIR --names A,B --check bench/results/paper.csv

Runs every molecule of the paper's tables, and those of Debian's apbs-data that stand in for them,
that a DIR holds as NAME.pqr or NAME.pqr.gz: fits of ellipsoids at decay 0.3, 0.5 and 0.7, of
spheres at 0.5, and their surfaces measured as the paper does, with vertices from linear
interpolation on a lattice of 0.5 angstrom. Molecules of more than --up-to atoms are fitted once, by ellipsoids at 0.5.

--output writes a row per fit and, beside it with -isovalues in its name, a row per isovalue; the
outer surface in them is that without the walls of cavities. --figures draws (needs matplotlib).
--work keeps models, traces and reports, and --reuse takes those that are there instead of fitting
anew. --check fits the decay 0.5 alone and compares with a table written before, within TOLERANCES;
it exits with 77 when there is nothing to compare.
"""

import argparse
import collections
import gzip
import json
import os
import subprocess
import sys
import tempfile

from common import (PAPER_MESH, find, paper_counts, paper_table, read_table, report_of, short,
                    write_table)

STAND_INS = ("pbsam-gly/gly", "pka-lig/bx6_7_lig_apbs", "helix/Membrane-helix-0")
DECAYS = (0.3, 0.5, 0.7)  # of the paper's figure of sparse ratios
DECAY = 0.5  # of its tables
ISOVALUES = tuple(k / 10 for k in range(4, 20, 2))
COLUMNS = (
    "molecule atoms kernel decay kernels paper_kernels sparse_ratio points iterations rms_error "
    "max_error area_original paper_area_original area_model paper_area_model area_error "
    "paper_area_error area_error_outer volume_original paper_volume_original volume_model "
    "paper_volume_model volume_error paper_volume_error volume_error_outer hausdorff "
    "paper_hausdorff hausdorff_outer mean_distance_outer components_original components_model"
).split()
ISOVALUE_COLUMNS = (
    "molecule isovalue area_original area_model area_outer_original area_outer_model "
    "volume_original volume_model volume_outer_original volume_outer_model"
).split()


# Between devices sums round differently, and a fit of thousands of steps amplifies that; changing
# the decay in its seventh digit does the same and is where these come from. The surface of the atoms
# itself depends on no fit. Holes inside come and go, so that the outer surfaces are compared.
TOLERANCES = {
    # column: (relative, absolute); the larger counts
    "area_original": (2e-4, 0.0),
    "volume_original": (2e-4, 0.0),
    "kernels": (0.15, 2),
    "rms_error": (0.3, 0.0),
    "area_error_outer": (0.0, 0.006),
    "volume_error_outer": (0.0, 0.006),
    "hausdorff_outer": (0.6, 0.0),
    "mean_distance_outer": (0.3, 0.0),
}

Run = collections.namedtuple("Run", "name kernel decay")


# ---- the tool ------------------------------------------------------------------------------------


def fit(arguments, run, path, folder):
    """Report of the fit, and where its model and trace are."""
    stem = os.path.join(folder, f"{run.name.replace('/', '-')}-{run.kernel}-{run.decay}")
    model, trace, report = stem + ".ovoid", stem + ".csv", stem + ".json"
    if not (arguments.reuse and os.path.exists(report) and os.path.exists(model)):
        command = [arguments.ovoid, "fit", path, "--method", "l1", "--kernel", run.kernel]
        command += ["--decay", str(run.decay), "--no-measure", "--quiet"]
        command += ["--trace", trace, "--report", report, "-o", model]
        if arguments.iterations:
            command += ["--iterations", str(arguments.iterations)]
        subprocess.run(command, check=True)
    with open(report, encoding="utf-8") as text:
        return json.load(text), model, trace


def row_of(run, fitted, measured, counts, geometry):
    """A row of the result: floats as they are, the paper's columns empty where it has no number."""
    row = {
        "molecule": run.name,
        "kernel": run.kernel,
        "decay": run.decay,
        "kernels": fitted["ellipsoids"],
        "hausdorff": measured["hausdorff"],
        "hausdorff_outer": measured["hausdorff_outer"],
        "mean_distance_outer": measured["mean_distance_outer"],
        "components_original": measured["components"]["original"],
        "components_model": measured["components"]["sparse"],
    }
    for key in "atoms sparse_ratio points iterations rms_error max_error".split():
        row[key] = fitted[key]
    for key in ("area", "volume"):
        row[key + "_original"] = measured[key]["original"]
        row[key + "_model"] = measured[key]["sparse"]
        row[key + "_error"] = measured[key]["error"]
        row[key + "_error_outer"] = measured[key + "_outer"]["error"]
    if run.decay == DECAY:
        row["paper_kernels"] = counts[run.kernel].get(run.name, "")
        for paper in geometry if run.kernel == "ellipsoid" else ():
            if paper["molecule"] == run.name:
                row["paper_hausdorff"] = float(paper["hausdorff"])
                for key in ("area", "volume"):
                    row[f"paper_{key}_original"] = float(paper[key + "_original"])
                    row[f"paper_{key}_model"] = float(paper[key + "_paper"])
                    row[f"paper_{key}_error"] = float(paper[key + "_error"])
    return row


def measure(arguments, path, model, isovalues=()):
    command = ["measure", path, model, *PAPER_MESH]
    if isovalues:
        command += ["--isovalue", ",".join(map(str, isovalues))]
    return report_of(arguments.ovoid, command)


def isovalue_rows(arguments, name, path, model):
    rows = []
    for measured in measure(arguments, path, model, ISOVALUES)["rows"]:
        if "area" in measured:  # else one of the two has no surface there
            row = {"molecule": name, "isovalue": measured["isovalue"]}
            for key in ("area", "volume", "area_outer", "volume_outer"):
                row[key + "_original"] = measured[key]["original"]
                row[key + "_model"] = measured[key]["sparse"]
            rows.append(row)
    return rows


def runs_of(name, atoms, arguments):
    if atoms > arguments.up_to:
        return [Run(name, "ellipsoid", DECAY)]
    decays = (DECAY,) if arguments.check else DECAYS
    return [Run(name, "ellipsoid", decay) for decay in decays] + [Run(name, "sphere", DECAY)]


def print_heading():
    groups = (("kernels", 13), ("area, Å²", 19), ("error %", 22), ("volume, Å³", 19),
              ("error %", 22), ("Hausdorff, Å", 22), ("pieces", 12))
    print(f"{'':46}" + "".join(f"{name:>{width}}" for name, width in groups))
    print(f"{'molecule':24}{'atoms':>6}  {'kernel':10}{'d':>4}{'here':>6}{'paper':>7}"
          + (f"{'atoms':>10}{'paper':>9}" + f"{'here':>8}{'outer':>7}{'paper':>7}") * 2
          + f"{'here':>8}{'outer':>7}{'paper':>7}{'atoms':>7}{'here':>5}", flush=True)


def print_row(row):
    def number(column, width, digits, scale=1):
        value = row.get(column, "")
        return f"{'-' if value == '' else format(scale * value, f'.{digits}f'):>{width}}"

    text = f"{row['molecule']:24}{row['atoms']:6}  {row['kernel']:10}{row['decay']:4}"
    text += number("kernels", 6, 0) + number("paper_kernels", 7, 0)
    for key in ("area", "volume"):
        text += number(key + "_original", 10, 1) + number(f"paper_{key}_original", 9, 1)
        text += number(key + "_error", 8, 2, 100) + number(key + "_error_outer", 7, 2, 100)
        text += number(f"paper_{key}_error", 7, 2, 100)
    text += number("hausdorff", 8, 2) + number("hausdorff_outer", 7, 2)
    text += number("paper_hausdorff", 7, 2)
    print(text + f"{row['components_original']:7}{row['components_model']:5}", flush=True)


# ---- comparison with a table ---------------------------------------------------------------------


def differences(row, recorded):
    for column, (relative, absolute) in TOLERANCES.items():
        expected = float(recorded[column])
        allowed = max(relative * abs(expected), absolute)
        if abs(row[column] - expected) > allowed:
            yield (f"{row['molecule']}, {row['kernel']}s: {column} is {row[column]:.6g}, recorded "
                   f"{expected:.6g}, allowed to differ by {allowed:.3g}")


def check(rows, path):
    """Prints what differs; true when nothing does."""
    recorded = {(r["molecule"], r["kernel"], float(r["decay"])): r for r in read_table(path)}
    good = True
    for row in rows:
        key = (row["molecule"], row["kernel"], row["decay"])
        found = [f"{key}: not in {path}"]
        if key in recorded:
            found = list(differences(row, recorded[key]))
        for text in found:
            print(text)
        good = good and not found
    print(f"{len(rows)} fits compared with {os.path.basename(path)}: "
          + ("all within tolerances" if good else "some differ"))
    return good


# ---- all of it -----------------------------------------------------------------------------------


def work(arguments, molecules, folder):
    """Every fit and measure; rows, rows by isovalue, and where traces and models are."""
    counts = {"ellipsoid": paper_counts(), "sphere": paper_counts("sparse_rbf")}
    geometry = paper_table(2)
    rows, isovalues, files, fitted = [], [], {}, None
    print_heading()
    for name, path in molecules:
        atoms = counts_atoms(path)
        for run in runs_of(name, atoms, arguments):
            fitted, model, trace = fit(arguments, run, path, folder)
            row = row_of(run, fitted, measure(arguments, path, model), counts, geometry)
            rows.append(row)
            print_row(row)
            if run.kernel == "ellipsoid" and run.decay == DECAY:
                files[name] = (model, trace)
                if not arguments.check:
                    isovalues += isovalue_rows(arguments, name, path, model)
    return rows, isovalues, files, fitted


def counts_atoms(path):
    """Atoms in a PQR file, before anything is fitted to them."""
    opener = gzip.open if path.endswith(".gz") else open
    with opener(path, "rt", encoding="utf-8", errors="replace") as lines:
        return sum(line.startswith(("ATOM", "HETATM")) for line in lines)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ovoid", default="ovoid")
    parser.add_argument("--molecules", action="append", required=True, metavar="DIR")
    parser.add_argument("--names", help="with commas between them (default: all there are)")
    parser.add_argument("--output", metavar="FILE")
    parser.add_argument("--figures", metavar="DIR")
    parser.add_argument("--work", metavar="DIR")
    parser.add_argument("--reuse", action="store_true")
    parser.add_argument("--up-to", type=int, default=2000, metavar="ATOMS")
    parser.add_argument("--iterations", type=int, help="for a quick look (default: the tool's)")
    parser.add_argument("--check", metavar="FILE")
    arguments = parser.parse_args()
    if arguments.reuse and not arguments.work:
        parser.error("--reuse needs --work")
    return arguments


def choose(arguments):
    """The molecules that can be found: name and path, in the order of the paper's table."""
    names = list(paper_counts()) + list(STAND_INS)
    if arguments.names:
        names = arguments.names.split(",")
    found = []
    for name in names:
        paths = [path for path in (find(folder, name) for folder in arguments.molecules) if path]
        if paths:
            found.append((name, paths[0]))
    missing = [name for name in names if name not in dict(found)]
    if missing:
        print("not found:", ", ".join(missing))
    return found


def main():
    arguments = parse()
    molecules = choose(arguments)
    if not molecules:
        print("no molecule of these in", ", ".join(arguments.molecules))
        return 77 if arguments.check else 1
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.work or temporary
        os.makedirs(folder, exist_ok=True)
        rows, isovalues, files, fitted = work(arguments, molecules, folder)
        if arguments.check:
            return 0 if check(rows, arguments.check) else 1
        if arguments.output:
            comment = f"ovoid {fitted['version']}, {fitted['device']}; bench/paper.py"
            shortened = [{k: short(v, 6) for k, v in row.items()} for row in rows]
            write_table(arguments.output, comment, COLUMNS, shortened)
            stem, extension = os.path.splitext(arguments.output)
            shortened = [{k: short(v, 6) for k, v in row.items()} for row in isovalues]
            write_table(stem + "-isovalues" + extension, comment, ISOVALUE_COLUMNS, shortened)
        if arguments.figures:
            import paper_figures

            import paper_pictures

            paper_figures.draw(arguments.figures, rows, isovalues, files)
            paper_pictures.draw(arguments.ovoid, arguments.figures, dict(molecules), files)
    return 0


if __name__ == "__main__":
    sys.exit(main())
