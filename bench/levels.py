#!/usr/bin/env python3
"""What levels of detail come to: ovoid fit --levels 5, the first to the default tolerance.

    levels.py --ovoid PATH --molecules DIR [--label TEXT] [NAME...]

Prints CSV, a line per level: errors, distances (angstrom), and what it took: steps of refinement and
iterations of conjugate gradients, which are the same on every run, and seconds, which are not.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

NAMES = ["ADP", "1MAG", "1crn", "FAS2", "barstar", "AChE"]


def fit(ovoid, molecule, folder):
    report = folder / "report.json"
    subprocess.run([ovoid, "fit", molecule, "--levels", "5", "-o", folder / "model.ovoid",
                    "--report", report, "--quiet"], check=True)
    return json.loads(report.read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ovoid", required=True)
    parser.add_argument("--molecules", required=True, type=pathlib.Path)
    parser.add_argument("--label", default="")
    parser.add_argument("names", nargs="*", default=NAMES)
    wanted = parser.parse_args()
    print("label,molecule,level,ellipsoids,area_error,volume_error,deviation,mean_distance,"
          "rms_distance,components,steps,solver_iterations,seconds")
    for name in wanted.names or NAMES:
        with tempfile.TemporaryDirectory() as folder:
            report = fit(wanted.ovoid, wanted.molecules / f"{name}.pqr", pathlib.Path(folder))
        for level in report["levels"]:
            print(f"{wanted.label},{name},{level['level']},{level['ellipsoids']},"
                  f"{level['area']['error']:.5f},{level['volume']['error']:.6f},"
                  f"{level['deviation']:.3f},{level['mean_distance']:.4f},"
                  f"{level['rms_distance']:.4f},{level['components']['sparse']},"
                  f"{level['iterations']},{level['solver_iterations']},{level['seconds']:.2f}",
                  flush=True)


if __name__ == "__main__":
    main()
