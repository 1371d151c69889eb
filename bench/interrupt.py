#!/usr/bin/env python3
"""Seconds from SIGINT to the end of the tool, at many moments of every command.

    interrupt.py --ovoid build/release/ovoid [--moments 12] [--commands mesh,...] [--device SELECTOR]
               [--output bench/results/interrupt.csv] MOLECULE
    interrupt.py --ovoid build/release/ovoid --molecules DIR

Runs each command on MOLECULE (default: 1aon of the folder DIR) once to its end, and then again and again, with a
SIGINT at moments that are spread over the time that it took. The stage is the one that the progress line named last,
`(start)` before there was any. Prints and writes a row per command and stage: how many signals, the largest and the
median number of seconds, how many were so late that the tool did not wait any longer for what was under way (0.5 s),
exit codes, and files that were left in the folder, which must be none. Code 0 is that of a command which had its files
in place already, and these do not count.
"""

import argparse
import os
import pty
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from common import find, short, write_table

COLUMNS = "command stage signals largest_seconds median_seconds given_up codes files_left".split()
PATIENCE = 0.5  # host/cli/interrupt.c
STAGES = ("read open compile selftest field mesh measure map render write sample sparse accuracy merge refine repair grow "
          "shrink").split()

# Name, arguments; MOLECULE and MODEL stand for the files.
COMMANDS = (
    ("fit", "fit MOLECULE --ratio 0.066 --steps 3 -o a.ovoid --report a.json --trace a.csv --owners a.owners"),
    ("fit tolerance", "fit MOLECULE --tolerance 2 -o a.ovoid"),
    ("fit l1", "fit MOLECULE --method l1 --iterations 30 --no-measure -o a.ovoid"),
    ("mesh obj", "mesh MOLECULE -o a.obj --spacing 0.4"),
    ("mesh ply", "mesh MODEL -o a.ply --spacing 0.5"),
    ("mesh, nothing compiled", "mesh MOLECULE -o a.stl"),
    ("measure", "measure MOLECULE MODEL --report a.json"),
    ("render", "render MOLECULE MODEL -o a.png"),
    ("render difference", "render MOLECULE MODEL -o a.png --view difference"),
    ("export map", "export MOLECULE -o a.mrc --spacing 1"),
    ("export dx", "export MODEL -o a.dx --spacing 1"),
    ("export page", "export MOLECULE MODEL -o a.html"),
    ("export cxc", "export MODEL -o a.cxc"),
)


class Run:
    """The tool at work in an empty folder, its standard error a terminal."""

    def __init__(self, command, cache=None):
        self.folder = tempfile.TemporaryDirectory()
        self.text = ""
        self.master, slave = pty.openpty()
        environment = dict(os.environ, TERM="xterm")
        if cache:
            environment["POCL_CACHE_DIR"] = environment["OVOID_CACHE_DIR"] = cache
        self.began = time.monotonic()
        self.process = subprocess.Popen(command, cwd=self.folder.name, env=environment, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=slave, start_new_session=True)
        os.close(slave)
        self.reader = threading.Thread(target=self.read)
        self.reader.start()

    def read(self):
        try:
            while part := os.read(self.master, 4096):
                self.text += part.decode(errors="replace")
        except OSError:
            pass  # the other end was closed

    def stage(self):
        named = [word for word in re.findall(r"\r(?:level \S+  )?(\w+)", self.text) if word in STAGES]
        return named[-1] if named else "(start)"

    def end(self):
        """Exit code, seconds since the start, and names of the files in the folder."""
        code = self.process.wait()
        code = 128 - code if code < 0 else code  # as shells have it: killed before the tool could catch the signal
        seconds = time.monotonic() - self.began
        self.reader.join()
        os.close(self.master)
        files = os.listdir(self.folder.name)
        self.folder.cleanup()
        return code, seconds, files


def interrupt(command, moment, cache):
    """One row's worth: stage, seconds, code, files; None where the command was faster."""
    run = Run(command, cache)
    try:
        run.process.wait(moment)
    except subprocess.TimeoutExpired:
        stage = run.stage()
        sent = time.monotonic()
        run.process.send_signal(signal.SIGINT)
        code, seconds, files = run.end()
        return stage, seconds - (sent - run.began), code, files
    run.end()
    return None


def moments_of(seconds, count):
    """Spread over the time, each somewhere in its part of it."""
    chance = random.Random(1)
    return [seconds * (k + chance.random()) / count for k in range(count)]


def rows_of(name, command, count):
    fresh = "nothing compiled" in name
    with tempfile.TemporaryDirectory() as place:
        caches = (os.path.join(place, str(k)) for k in range(count + 1))
        code, seconds, files = Run(command, next(caches) if fresh else None).end()
        if code not in (0, 7) or not files:
            sys.exit(f"interrupt.py: {' '.join(command)} ended with {code}")
        print(f"{name}: {seconds:.1f} s to its end", flush=True)
        outcomes = [interrupt(command, moment, next(caches) if fresh else None)
                    for moment in moments_of(seconds, count)]
    stages = {}
    for outcome in filter(None, outcomes):
        stages.setdefault(outcome[0], []).append(outcome)
    for stage, found in stages.items():
        seconds = [one[1] for one in found]
        yield {
            "command": name,
            "stage": stage,
            "signals": len(found),
            "largest_seconds": short(max(seconds), 2),
            "median_seconds": short(statistics.median(seconds), 2),
            "given_up": sum(one >= PATIENCE for one in seconds),
            "codes": " ".join(sorted({str(one[2]) for one in found})),
            "files_left": sum(len(one[3]) for one in found if one[2] != 0),
        }


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--ovoid", required=True, help="the tool")
    parser.add_argument("--molecules", help="a folder of molecules")
    parser.add_argument("--moments", type=int, default=12, help="signals to each command")
    parser.add_argument("--commands", help="only those whose names begin so, with commas between them")
    parser.add_argument("--device")
    parser.add_argument("--output", default=os.path.join(os.path.dirname(__file__), "results", "interrupt.csv"))
    parser.add_argument("molecule", nargs="?")
    arguments = parser.parse_args()
    arguments.ovoid = os.path.abspath(arguments.ovoid)
    arguments.molecule = arguments.molecule or (arguments.molecules and find(arguments.molecules, "1aon"))
    if not arguments.molecule:
        sys.exit("interrupt.py: which molecule? Name it, or --molecules DIR with 1aon in it")
    arguments.molecule = os.path.abspath(arguments.molecule)
    return arguments


def main():
    arguments = parse()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a job in the background would hand down that it is ignored
    wanted = tuple(arguments.commands.split(",")) if arguments.commands else ("",)
    device = ["--device", arguments.device] if arguments.device else []
    rows = []
    with tempfile.TemporaryDirectory() as place:
        model = os.path.join(place, "model.ovoid")
        subprocess.run([arguments.ovoid, "fit", arguments.molecule, "--ratio", "0.066", "--steps", "3",
                        "--no-measure", "-q", "-o", model] + device, check=True)
        files = {"MOLECULE": arguments.molecule, "MODEL": model}
        for name, text in COMMANDS:
            if not name.startswith(wanted):
                continue
            command = [arguments.ovoid] + [files.get(word, word) for word in text.split()] + device
            for row in rows_of(name, command, arguments.moments):
                print("  " + "  ".join(f"{key} {value}" for key, value in row.items() if key != "command"), flush=True)
                rows.append(row)
            write_table(arguments.output, f"ovoid interrupted: {os.path.basename(arguments.molecule)}", COLUMNS, rows)
    worst = max(rows, key=lambda row: row["largest_seconds"])
    print(f"largest: {worst['largest_seconds']} s ({worst['command']}, {worst['stage']})")


if __name__ == "__main__":
    main()
