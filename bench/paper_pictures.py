"""Pictures of bench/paper.py that `ovoid render` takes: surfaces, and what they are made of."""

import os
import subprocess
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SURFACES = ("ADP", "1MAG", "FAS2")  # the rows of the paper's figure of surfaces
KERNELS = "1MAG"  # the molecule of its figure of Gaussians
WIDTH, HEIGHT = 1400, 400


def render(ovoid, inputs, options, path):
    subprocess.run([ovoid, "render", *inputs, *options, "-o", path, "--quiet"], check=True)
    return plt.imread(path)


def stack(pictures, titles, columns, path):
    """Pictures of one size with their titles, row by row."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    figure, axes = plt.subplots(rows, columns, squeeze=False,
                                figsize=(columns * width / 100, rows * (height + 30) / 100))
    for place, picture, title in zip(axes.flat, pictures, titles):
        place.imshow(picture)
        place.set_title(title, fontsize=13, pad=4)
        place.axis("off")
    figure.savefig(path, dpi=100, metadata={"Software": None})
    plt.close(figure)


def surfaces(ovoid, folder, paths, files, work):
    """The atoms' surface, the model's with its centres, and both, of each molecule."""
    pictures, titles = [], []
    for name in SURFACES:
        if name in files:
            pictures.append(render(ovoid, [paths[name], files[name][0]],
                                   ["--panel", "--size", f"{WIDTH}x{HEIGHT}"],
                                   os.path.join(work, name + ".png")))
            titles.append(f"{name}: the atoms' surface, the model's with its centres, both")
    if pictures:
        stack(pictures, titles, 1, os.path.join(folder, "paper-surfaces.png"))


def kernels(ovoid, folder, paths, files, work):
    """The ellipsoids of a model beside the spheres of the atoms: a fit that leaves them as they are."""
    if KERNELS not in files:
        return
    spheres = os.path.join(work, "spheres.ovoid")
    subprocess.run([ovoid, "fit", paths[KERNELS], "--ratio", "1", "--steps", "0", "--no-measure",
                    "--quiet", "-o", spheres], check=True)
    pictures, titles = [], []
    for model, what in ((files[KERNELS][0], "ellipsoids of the model"), (spheres, "atoms")):
        with open(model, encoding="utf-8") as lines:
            count = sum(not line.startswith("#") for line in lines if line.strip())
        pictures.append(render(ovoid, [paths[KERNELS], model],
                               ["--view", "ellipsoids", "--size", f"{WIDTH // 2}x{HEIGHT + 60}"],
                               os.path.join(work, f"kernels{len(pictures)}.png")))
        titles.append(f"{KERNELS}: {count} {what}")
    stack(pictures, titles, 2, os.path.join(folder, "paper-kernels.png"))


def draw(ovoid, folder, paths, files):
    """paths: molecule -> its file; files: molecule -> its model and trace at decay 0.5."""
    with tempfile.TemporaryDirectory() as work:
        surfaces(ovoid, folder, paths, files, work)
        kernels(ovoid, folder, paths, files, work)
