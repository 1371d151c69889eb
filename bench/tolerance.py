#!/usr/bin/env python3
"""What the tolerance, the default goal, comes to: one row per molecule or setting.

    bench/tolerance.py fits --ovoid build/release/ovoid --molecules DIR [--csv FILE]
    bench/tolerance.py direct --ovoid build/release/ovoid --molecules DIR [--csv FILE]
    bench/tolerance.py settings --ovoid build/release/ovoid --molecules DIR [--csv FILE]
    bench/tolerance.py efforts --ovoid build/release/ovoid --molecules DIR [--csv FILE]

fits: default fits of molecules of all sizes, protonated or not, and what they deviate by when both
surfaces are meshed at 0.2 Å. direct: the fewest ellipsoids with
which --ellipsoids, a search by count, with effort 0, stays within 0.5 Å too; fewer than a fit found mean that it
should have found them. settings: other tolerances, decay rates and isovalues. efforts: 0, 1 and 2.

DIR has the molecules of the paper and some more; others come from Debian's apbs-data, pymol-data.
Molecules that are not there are left out, and named. Seconds are of whole processes.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time

import common

APBS = "/usr/share/apbs/examples"
# Name -> file, under DIR or absolute, and options that say how it is read.
MOLECULES = {
    "DIALA": ["DIALA.pqr"],
    "ADP": ["ADP.pqr"],
    "chignolin": ["chignolin_CLN025.pqr"],
    "membrane_helix": [f"{APBS}/helix/Membrane-helix-0.pqr"],
    "N-peptide": [f"{APBS}/protein-rna/model_outNpep.pqr"],
    "1ajj": [f"{APBS}/bem/test_proteins/1ajj.pqr"],
    "1MAG": ["1MAG.pqr"],
    "1bbl": [f"{APBS}/bem/test_proteins/1bbl.pqr"],
    "boxB": [f"{APBS}/protein-rna/model_outBoxB19.pqr"],
    "1crn": ["1crn.pqr"],
    "1d30": [f"{APBS}/bem-binding-energy/test_proteins/1d30.pqr"],
    "FAS2": ["FAS2.pqr"],
    "fas2": [f"{APBS}/misc/fas2.pqr"],
    "N-boxB": [f"{APBS}/protein-rna/model_outNB.pqr"],
    "451c": [f"{APBS}/bem/test_proteins/451c.pqr"],
    "barstar": [f"{APBS}/pbsam-barn_bars/barstar.pqr"],
    "1d7h": [f"{APBS}/FKBP/1d7h-min.pqr"],
    "barnase": [f"{APBS}/pbsam-barn_bars/barnase.pqr"],
    "1aki": ["1aki.pqr"],
    "2LZT": [f"{APBS}/bem-pKa/test_proteins/2LZT-ASP66.pqr"],
    "1a63": ["1a63.pqr"],
    "actin": ["actin.pqr"],
    "AChE": ["AChE.pqr"],
    "mache": [f"{APBS}/misc/mache.pqr"],
    "actin_dimer": [f"{APBS}/actin-dimer/complex.pqr"],
    "achbp": [f"{APBS}/misc/achbp.pqr"],
    "1ihm": ["1ihm_asu.pqr.gz"],
    "1m4x": ["1m4x_asu.pqr.gz"],
    "6xm4": ["6xm4.xyzr.gz"],
    "1aon": ["1aon.pqr.gz"],
    # Hydrogens on polar atoms alone.
    "lys1": [f"{APBS}/pygbe/lys/lys1_charges.pqr"],
    "hca": [f"{APBS}/hca-bind/hca.pqr"],
    "hca_complex": [f"{APBS}/hca-bind/complex.pqr"],
    "bx6_7_apo": [f"{APBS}/pka-lig/bx6_7_apo_apbs.pqr"],
    "bx6_7_bin": [f"{APBS}/pka-lig/bx6_7_bin_apbs.pqr"],
    # None at all, with the radii of the elements and with radii that stand for hydrogens too.
    "1CRN_bondi": ["1CRN.pdb", "--radii", "bondi"],
    "1UBQ_bondi": ["1UBQ.pdb", "--radii", "bondi"],
    "1F2N_bondi": ["1F2N.pdb.gz", "--radii", "bondi"],
    "1CRN": ["1CRN.pdb", "--radii", "united"],
    "1UBQ": ["1UBQ.pdb", "--radii", "united"],
    "1FAS": ["1FAS.cif", "--radii", "united"],
    "1EMA": ["1EMA.cif", "--radii", "united"],
    "1HPV": ["/usr/share/pymol/data/tut/1hpv.pdb", "--radii", "united"],
    "1F2N": ["1F2N.pdb.gz", "--radii", "united"],
}
DIRECT = ["1MAG", "1crn", "FAS2", "barstar", "1aki", "AChE", "lys1", "hca", "1UBQ_bondi", "1UBQ"]
SETTINGS = [["--tolerance", "0.2"], ["--tolerance", "0.3"], ["--tolerance", "1"],
            ["--tolerance", "2"], ["--decay", "0.3"], ["--decay", "0.7"], ["--decay", "1"],
            ["--isovalue", "0.5"], ["--isovalue", "2"]]
SETTINGS_OF = ["1MAG", "FAS2", "1aki", "lys1", "1UBQ"]
EFFORTS = [["--effort", "0"], [], ["--effort", "2"]]
EFFORTS_OF = ["1MAG", "1crn", "FAS2", "1aki", "lys1", "actin", "AChE"]
COLUMNS = ["molecule", "options", "atoms", "ellipsoids", "ratio", "reached", "deviation",
           "deviation_bound", "area_error", "volume_error", "area_error_outer", "hausdorff_outer",
           "mean_distance_outer", "seconds", "deviation_finer", "direct", "direct_deviation"]
FINER = 0.2  # angstrom: of the meshes that tell deviation_finer


def fit(ovoid, source, options, finely=False):
    """The row of one fit; finely: measured once more, by meshes of FINER angstrom."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        report = common.report_of(ovoid, ["fit", *source, *options, "-o",
                                          os.path.join(folder, "m.ovoid")], codes=(0, 7))
        seconds = time.perf_counter() - began
        finer = common.report_of(ovoid, ["measure", *source, os.path.join(folder, "m.ovoid"),
                                         "--spacing", str(FINER)])["deviation"] if finely else None
    row = {"atoms": report["atoms"], "ellipsoids": report["ellipsoids"],
           "ratio": report["sparse_ratio"], "options": " ".join(options),
           "reached": "yes" if report["goal"]["reached"] else "no",
           "deviation": report["deviation"], "deviation_bound": report["deviation_bound"],
           "area_error": report["area"]["error"],
           "volume_error": report["volume"]["error"],
           "area_error_outer": report["area_outer"]["error"],
           "hausdorff_outer": report["hausdorff_outer"],
           "mean_distance_outer": report["mean_distance_outer"], "seconds": seconds}
    if finely:
        row["deviation_finer"] = finer
    return {key: common.short(value) for key, value in row.items()}


def by_count(ovoid, source, found, tolerance):
    """The fewest ellipsoids within the tolerance, of counts from 12 % fewer to 10 % more than
    `found` in steps of 2 %, and what they reach."""
    for percent in range(-12, 11, 2):
        count = round(found * (1 + percent / 100))
        row = fit(ovoid, source, ["--ellipsoids", str(count), "--effort", "0"])
        if row["deviation"] is not None and row["deviation"] <= tolerance:
            return count, row["deviation"]
    return None, None


def rows_of(kind, ovoid, name, source):
    """The rows of one molecule."""
    if kind in ("settings", "efforts"):
        return [dict(fit(ovoid, source, options), molecule=name)
                for options in (SETTINGS if kind == "settings" else EFFORTS)]
    row = dict(fit(ovoid, source, [], kind == "fits"), molecule=name)
    if kind == "direct":
        row["direct"], row["direct_deviation"] = by_count(ovoid, source, row["ellipsoids"], 0.5)
    return [row]


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["fits", "direct", "settings", "efforts"])
    parser.add_argument("--ovoid", required=True)
    parser.add_argument("--molecules", required=True, metavar="DIR")
    parser.add_argument("--only", help="these alone, with commas between")
    parser.add_argument("--csv", metavar="FILE")
    wanted = parser.parse_args()
    names = {"fits": MOLECULES, "direct": DIRECT, "settings": SETTINGS_OF,
             "efforts": EFFORTS_OF}[wanted.kind]
    if wanted.only:
        names = wanted.only.split(",")
    rows = []
    for name in names:
        source = [os.path.join(wanted.molecules, MOLECULES[name][0]), *MOLECULES[name][1:]]
        if not os.path.exists(source[0]):
            print(f"{name}: {source[0]} is not there", file=sys.stderr)
            continue
        for row in rows_of(wanted.kind, wanted.ovoid, name, source):
            rows.append(row)
            print(*(f"{key}={row[key]}" for key in COLUMNS if key in row), flush=True)
    if wanted.csv:
        version = subprocess.run([wanted.ovoid, "--version"], capture_output=True, text=True,
                                 check=True).stdout.split("\n")[0]
        common.write_table(wanted.csv, f"{version}; bench/tolerance.py {wanted.kind}", COLUMNS,
                           rows)


if __name__ == "__main__":
    main()
