"""Pages: how large they are, and how soon and how often a headless Chromium draws them.

    python3 bench/page.py OVOID MOLECULE MODEL... [--csv FILE]

Writes the page of a molecule and its models with each of some spacings and opens it at 1280 x 800
pixels. Time to first picture is from the navigation to the first frame that is on the canvas; frames
per second are those of 60 turns in the views "both" and "ellipsoids", each drawn and waited for
(gl.finish). Without a GPU Chromium draws by SwiftShader on the processor: then the frames are those of
a machine without one. Run it on a quiet machine.
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
TURNS = 60
COLUMNS = ["molecule", "spacing", "triangles", "ellipsoids", "bytes", "seconds_written", "seconds_first_picture",
           "frames_both", "frames_ellipsoids", "renderer"]

# Turns as the arrow keys do, a picture for each, and waits until the last one is drawn.
FRAMES = """new Promise((done) => {
    const gl = document.getElementById('canvas').getContext('webgl2');
    let left = %d;
    const begin = performance.now();
    const next = () => {
        gl.finish();
        if (left-- === 0)
            return done(%d * 1000 / (performance.now() - begin));
        window.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight' }));
        requestAnimationFrame(next);
    };
    next();
})""" % (TURNS, TURNS)
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
        for key, view in (("3", "both"), ("5", "ellipsoids")):
            b.key(key)
            b.wait(f"document.getElementById('canvas').dataset.view === '{view}'")
            b.settle()
            row["frames_" + view] = round(b.ask(FRAMES), 1)
        row["renderer"] = b.ask(RENDERER)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ovoid")
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("--csv")
    parser.add_argument("--spacing", type=float, action="append")
    given = parser.parse_args()
    if not browser.find():
        sys.exit("no program chromium here (Debian: chromium)")
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for spacing in given.spacing or SPACINGS:
            rows.append(measure(given.ovoid, given.inputs, spacing, os.path.join(folder, "view.html")))
            print(json.dumps(rows[-1]), flush=True)
    if given.csv:
        new = not os.path.exists(given.csv)
        with open(given.csv, "a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            if new:
                writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
