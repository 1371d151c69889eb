"""Pages: how large they are, and how soon and how often a headless Chromium draws them.

    python3 bench/page.py OVOID MOLECULE... [--ratio 0.6] [--spacing X]... [--csv FILE]

Fits each molecule in three levels (to the default tolerance, or with so many ellipsoids per atom), writes
its page with each of some spacings and opens it at 1280 x 800 pixels. Time to first picture is from the
navigation to the first frame that is on the canvas; frames per second are those of 60 turns in each view,
or of as many as 10 seconds take, each drawn and waited for, and no more than the 60 of a screen. Without
a GPU Chromium draws by SwiftShader on the processor: the column "renderer" says so, and such frames are
those of a machine without a GPU. It takes Debian's chromium. The record is results/page.csv, whole or not
at all. Run it on a quiet machine.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "tests", "page"))
import browser  # noqa: E402
from inputs import Page  # noqa: E402

SPACINGS = (1.0, 0.5, 0.25)
TURNS, SECONDS = 60, 10
VIEWS = ("molecule", "model", "both", "difference", "ellipsoids")  # by the keys 1 to 5
COLUMNS = ["molecule", "spacing", "triangles", "ellipsoids", "bytes", "seconds_written", "seconds_first_picture",
           *("frames_" + view for view in VIEWS), "renderer"]
HERE = os.path.dirname(os.path.abspath(__file__))

# Turns as the arrow keys do, a picture for each. A pixel that is read waits until it is drawn.
FRAMES = """new Promise((done) => {
    const gl = document.getElementById('canvas').getContext('webgl2'), pixel = new Uint8Array(4);
    let drawn = 0;
    const begin = performance.now();
    const next = () => {
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        const seconds = (performance.now() - begin) / 1000;
        if (drawn === %d || (seconds > %d && drawn > 0))
            return done(drawn / seconds);
        drawn++;
        document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true }));
        requestAnimationFrame(next); // after the page's own, which draws
    };
    next();
})""" % (TURNS, SECONDS)
RENDERER = """(() => { const gl = document.createElement('canvas').getContext('webgl2');
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    return info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : ''; })()"""


def measure(tool, inputs, spacing, path):
    begin = time.monotonic()
    subprocess.run([tool, "export", *inputs, "-o", path, "-q", "--spacing", str(spacing), "--max-triangles", "1e7"],
                   check=True)
    row = {"molecule": os.path.basename(inputs[0]), "spacing": spacing, "bytes": os.path.getsize(path),
           "seconds_written": round(time.monotonic() - begin, 2)}
    scene = Page(path).scene
    row["triangles"] = max(s["triangles"] for s in scene["surfaces"])
    row["ellipsoids"] = max(level["ellipsoids"] for level in scene["levels"])
    with browser.Browser(1280, 800) as b:
        begin = time.monotonic()
        b.open(path)
        b.wait("document.getElementById('canvas').dataset.ready")
        row["seconds_first_picture"] = round(time.monotonic() - begin, 2)
        for key, view in enumerate(VIEWS, 1):
            b.key(str(key))
            b.wait(f"document.getElementById('canvas').dataset.view === '{view}'")
            b.settle()
            before = b.screenshot()
            row["frames_" + view] = round(b.ask(FRAMES), 1)
            b.settle()
            if b.screenshot() == before or b.complaints():
                sys.exit(f"{path}: nothing was drawn in the view {view}: {b.complaints()[:1]}")
        row["renderer"] = b.ask(RENDERER)
    return row


def models(tool, molecule, ratio, folder):
    """Its levels of detail."""
    goal = ["--ratio", str(ratio)] if ratio else []
    path = os.path.join(folder, "model.ovoid")
    subprocess.run([tool, "fit", molecule, "-o", path, "-q", "--no-measure", "--levels", "3", *goal], check=True)
    return [path, *(os.path.join(folder, f"model.level{n}.ovoid") for n in (2, 3))]


def write(path, tool, rows):
    version = subprocess.run([tool, "--version"], check=True, capture_output=True, text=True).stdout.split("\n")[0]
    chromium = subprocess.run([browser.find(), "--version"], check=True, capture_output=True, text=True).stdout
    with open(path + ".part", "w", encoding="utf-8", newline="") as file:
        file.write(f"# bench/page.py: {version}, {chromium.strip()}, headless, 1280 x 800, "
                   f"{os.cpu_count()} cores\n")
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    os.replace(path + ".part", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ovoid")
    parser.add_argument("molecules", nargs="+")
    parser.add_argument("--ratio", type=float, help="ellipsoids per atom (default: the tolerance of 0.5 Å)")
    parser.add_argument("--spacing", type=float, action="append", help="of the finest mesh (default: 1, 0.5, 0.25 Å)")
    parser.add_argument("--csv", default=os.path.join(HERE, "results", "page.csv"))
    given = parser.parse_args()
    if not browser.find():
        sys.exit("no program chromium here (Debian: chromium)")
    rows = []
    for molecule in given.molecules:
        with tempfile.TemporaryDirectory() as folder:
            inputs = [molecule, *models(given.ovoid, molecule, given.ratio, folder)]
            for spacing in given.spacing or SPACINGS:
                rows.append(measure(given.ovoid, inputs, spacing, os.path.join(folder, "view.html")))
                print(json.dumps(rows[-1]), flush=True)
    write(given.csv, given.ovoid, rows)


if __name__ == "__main__":
    main()
