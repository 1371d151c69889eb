#!/usr/bin/env python3
"""What Python costs beside the tool: the same fit of the same molecule, each in a process of its own.

    OVOID_LIBRARY=build/release/host/libovoid.so PYTHONPATH=python/src \\
        python3 bench/python_overhead.py build/release/ovoid MOLECULE... [--runs N]

It takes numpy alone (Debian: python3-numpy). Prints seconds of both from start to end (the least of N runs,
taken in turns), the difference, and the same of the processor's time, which a busy machine changes less;
before that, what it takes to import numpy and ovoid. Both read, fit to the default tolerance, measure and
write. The record is results/python_overhead.csv, whole or not at all.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
COLUMNS = "molecule,tool,python,difference,percent,tool_cpu,python_cpu,difference_cpu"
CODE = """
import sys, ovoid
molecule = ovoid.read(sys.argv[1])
model = molecule.fit()
model.measure(molecule)
model.write(sys.argv[2])
"""
DEVICE = """
import ovoid, platform
device = ovoid.use_device(None)
print(f"ovoid {ovoid.__version__}, Python {platform.python_version()}, {device.name}, driver {device.driver}")
"""


def seconds(command):
    """From start to end, and of the processor."""
    begin = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise subprocess.CalledProcessError(child.returncode, command)
    return time.perf_counter() - begin, used.ru_utime + used.ru_stime


def heading(given):
    """What it was measured on, and what imports take."""
    imports = {
        name: min(seconds([sys.executable, "-c", code])[0] for _ in range(given.runs))
        for name, code in (("none", ""), ("numpy", "import numpy"), ("ovoid", "import ovoid"))
    }
    device = subprocess.run([sys.executable, "-c", DEVICE], check=True, capture_output=True, text=True)
    yield f"# bench/python_overhead.py: {device.stdout.strip()}; the least of {given.runs} runs, seconds"
    yield (f"# import of numpy {imports['numpy'] - imports['none']:.3f} s, of ovoid beyond it "
           f"{imports['ovoid'] - imports['numpy']:.3f} s, of Python itself {imports['none']:.3f} s")


def row(given, molecule, out):
    tool = [given.tool, "fit", molecule, "-o", out, "--quiet"]
    python = [sys.executable, "-c", CODE, molecule, out]
    seconds(tool), seconds(python)  # kernels are compiled
    runs = [(*seconds(tool), *seconds(python)) for _ in range(given.runs)]
    wall, cpu, our_wall, our_cpu = (min(column) for column in zip(*runs))
    return (f"{os.path.basename(molecule)},{wall:.3f},{our_wall:.3f},{our_wall - wall:.3f},"
            f"{100 * (our_wall - wall) / wall:.1f},{cpu:.3f},{our_cpu:.3f},{our_cpu - cpu:.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tool")
    parser.add_argument("molecules", nargs="+")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--out", default=os.path.join(HERE, "results", "python_overhead.csv"))
    given = parser.parse_args()
    lines = [*heading(given), COLUMNS]
    print(*lines, sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for molecule in given.molecules:
            lines.append(row(given, molecule, os.path.join(folder, "model.ovoid")))
            print(lines[-1], flush=True)
    with open(given.out + ".part", "w", encoding="utf-8") as out:
        out.write("\n".join(lines) + "\n")
    os.replace(given.out + ".part", given.out)


if __name__ == "__main__":
    main()
