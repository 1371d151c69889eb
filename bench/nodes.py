#!/usr/bin/env python3
"""nodes.py OVOID MOLECULES [--molecule NAME]

Fits in parts by one process, by one with two devices, by two with jobs, and by 1, 2 and 4 ranks of MPI on this machine:
seconds, what share of the workers' time is spent on parts, waiting for others and on what is not shared, and whether
the model is that of the first row, to the last bit. The devices are PoCL's, of one core each (POCL_MAX_PTHREAD_COUNT),
so that ranks do not take each other's cores while there are enough: `cores` says how many the machine has. Needs the
tool with MPI (cmake -DOVOID_MPI=ON) and mpirun. Writes CSV.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import common

FITS = {
    "AChE": ["--part-atoms", "600", "--ratio", "0.066", "--effort", "0"],
    "1aon": ["--part-atoms", "4096", "--ratio", "0.066", "--effort", "0"],
}
TRIALS = {"FAS2": ["--part-atoms", "64", "--ratio", "0.066", "--effort", "0"]}  # to try this program
# What shares the work: ranks, devices of each, jobs on each device.
CREWS = [(1, 1, 1), (1, 1, 2), (1, 2, 1), (2, 1, 1), (4, 1, 1)]


def environment(devices):
    return {
        **os.environ,
        "POCL_DEVICES": " ".join(["pthread"] * devices),
        "POCL_MAX_PTHREAD_COUNT": "1",
        "OVOID_DEVICE": ",".join(str(n) for n in range(devices)),
        "OCL_ICD_VENDORS": os.environ.get("OCL_ICD_VENDORS", "/etc/OpenCL/vendors/pocl.icd"),
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_hwloc_base_binding_policy": "none",
        "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # containers forbid it
    }


def fit(ovoid, molecule, crew, options, folder):
    ranks, devices, jobs = crew
    report, model = folder / "report.json", folder / "model.ovoid"
    command = [ovoid, "fit", molecule, "-q", "--no-measure", "--jobs", str(jobs), "-o", model, "--report", report]
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    began = time.monotonic()
    subprocess.run(launcher + command + options, check=True, env=environment(devices))
    return time.monotonic() - began, json.loads(report.read_text()), model.read_bytes()


def row_of(name, crew, seconds, report, one, same):
    times = report["work"]["ranks"]
    whole = sum(t["seconds"] * t["workers"] for t in times)
    busy, waiting = (sum(t[key] for t in times) for key in ("busy", "waiting"))
    return {
        "molecule": name,
        "parts": report["parts"],
        "ranks": crew[0],
        "devices": crew[1],
        "jobs": crew[2],
        "cores": os.cpu_count(),
        "seconds": f"{seconds:.2f}",
        "speedup": f"{one / seconds:.2f}",
        "busy": f"{busy / whole:.3f}",
        "waiting": f"{waiting / whole:.3f}",
        "not_shared": f"{1 - (busy + waiting) / whole:.3f}",
        "same_model": "yes" if same else "no",
    }


def body(model):
    """The file less its header, which says how it was made."""
    return [line for line in model.splitlines() if not line.startswith(b"#")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[2])
    parser.add_argument("ovoid")
    parser.add_argument("molecules")
    parser.add_argument("--molecule", action="append", choices=[*FITS, *TRIALS], help="of these alone; otherwise "
                        + " and ".join(FITS))
    options = parser.parse_args()
    out = None
    for name in options.molecule or FITS:
        molecule = common.find(options.molecules, name)
        if not molecule:
            print(f"nodes.py: no {name} in {options.molecules}", file=sys.stderr)
            continue
        one, first = None, None
        for crew in CREWS:
            with tempfile.TemporaryDirectory() as folder:
                seconds, report, model = fit(options.ovoid, molecule, crew, {**FITS, **TRIALS}[name], Path(folder))
            one, first = one or seconds, first or body(model)
            row = row_of(name, crew, seconds, report, one, body(model) == first)
            if not out:
                out = csv.DictWriter(sys.stdout, row, lineterminator="\n")
                out.writeheader()
            out.writerow(row)
            sys.stdout.flush()


if __name__ == "__main__":
    main()
