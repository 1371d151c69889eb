#!/usr/bin/env python3
"""The self-test of one device, added to a table.

selftest_devices.py OVOID TABLE.csv NAME [--short] [VARIABLE=VALUE]...

NAME stands for the device in the table, VARIABLEs are set for the run (OCL_ICD_VENDORS, OVOID_SHAPE).
Rows of this name that were there are replaced. Seconds hold for a machine that does nothing else, with
the kernels compiled before: run it twice.
"""
import csv
import json
import os
import pathlib
import subprocess
import sys

COLUMNS = ["name", "device", "platform", "driver", "check", "verdict", "numbers", "error", "seconds", "text"]


def main():
    ovoid, table, name, *rest = sys.argv[1:]
    environment = dict(os.environ, **dict(word.split("=", 1) for word in rest if "=" in word))
    command = [ovoid, "selftest", "--json"] + [word for word in rest if word == "--short"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    sys.stderr.write(done.stderr)
    if done.returncode not in (0, 1, 5):
        sys.exit(f"exit code {done.returncode}")
    told = json.loads(done.stdout)
    path, rows = pathlib.Path(table), []
    if path.exists():
        with path.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["name"] != name]
    device = [told["device"][key] for key in ("name", "platform", "driver")]
    for check in told["checks"]:
        error = "" if check["error"] is None else f"{check['error']:.2g}"
        rows.append(dict(zip(COLUMNS, [name, *device, check["name"], check["verdict"], int(check["numbers"]),
                                       error, f"{check['seconds']:.2f}", check["text"]])))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"{name}: {told['passed']:.0f} passed, {told['wrong']:.0f} wrong, {told['failed']:.0f} failed")


if __name__ == "__main__":
    main()
