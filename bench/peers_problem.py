"""The adaptive method's problem once more, in numpy: what peers.py minimises.

The points and what is asked for there are those of host/fit/adaptive/target.c and the lattice that
host/fit/adaptive/adaptive.c lays; the constants below have to follow the ones there. Lengths in angstrom.
"""

import collections

import numpy

from common import read_atoms

DECAY, ISOVALUE = 0.5, 1.0
SPACING = 0.7  # OVOID_DEFAULT_SPACING_ADAPTIVE
PADDING, FIELD_PADDING = 3.0, 2.5
# ov_target_options_init()
LOW, HIGH = 0.02, 2.0
SLOPE_MIN = 0.7
WINDOW, FLOOR = 0.5, 0.05
INSIDE_EVERY, INSIDE_WEIGHT = 2, 2.0
OUTSIDE_EVERY, OUTSIDE_LOW, OUTSIDE_WEIGHT = 3, 1e-4, 0.5
CUTOFF = 1e-7  # of an atom's Gaussian; OV_TARGET_CUTOFF

# At each point of xyz a value within [low, high] is asked for; outside, weight * (distance to it)^2
# is charged. float64 but for the last three.
Problem = collections.namedtuple("Problem", "xyz low high weight")


# ---- molecules -----------------------------------------------------------------------------------


def read_molecule(path):
    """x, y, z and radius of the atoms of a PQR or XYZR file."""
    return numpy.array(read_atoms(path))


# ---- points and targets --------------------------------------------------------------------------


def default_spacing(atoms):
    return min(max(0.35 * (atoms / 40.0) ** 0.25, 0.35), SPACING)


def lattice_axes(xyzr):
    spacing = default_spacing(len(xyzr))
    padding = max(PADDING, xyzr[:, 3].max() + FIELD_PADDING)
    axes = []
    for axis in range(3):
        low, high = xyzr[:, axis].min() - padding, xyzr[:, axis].max() + padding
        steps = max(1, int(numpy.ceil((high - low) / spacing - 1e-9)))
        axes.append(low + (numpy.arange(steps) + 1) * ((high - low) / steps))
    return axes


def field(xyzr, axes):
    """phi and its gradient at all lattice points: each atom adds to those within its reach."""
    shape = tuple(len(axis) for axis in axes)
    phi = numpy.zeros(shape)
    gradient = [numpy.zeros(shape) for _ in axes]
    for *centre, radius in xyzr:
        reach = numpy.sqrt(radius**2 - numpy.log(CUTOFF) / DECAY)
        spans, factors, slopes = [], [], []
        for axis, at in zip(axes, centre):
            first, last = numpy.searchsorted(axis, (at - reach, at + reach))
            distance = axis[first:last] - at
            spans.append(slice(first, last))
            factors.append(numpy.exp(-DECAY * distance**2))
            slopes.append(-2.0 * DECAY * distance * factors[-1])
        factors[0] *= numpy.exp(DECAY * radius**2)
        slopes[0] *= numpy.exp(DECAY * radius**2)
        spans = tuple(spans)
        phi[spans] += numpy.einsum("i,j,k->ijk", *factors)
        for axis in range(3):
            along = [slopes[k] if k == axis else factors[k] for k in range(3)]
            gradient[axis][spans] += numpy.einsum("i,j,k->ijk", *along)
    return phi, gradient


def every(step, shape):
    chosen = numpy.zeros(shape, dtype=bool)
    chosen[::step, ::step, ::step] = True
    return chosen


def make_problem(xyzr):
    axes = lattice_axes(xyzr)
    phi, gradient = field(xyzr, axes)
    low, high, outside = LOW * ISOVALUE, HIGH * ISOVALUE, OUTSIDE_LOW * ISOVALUE
    followed = (phi >= low) & (phi <= high)
    inner = (phi > high) & every(INSIDE_EVERY, phi.shape)
    outer = (phi < low) & (phi >= outside) & every(OUTSIDE_EVERY, phi.shape)
    kept = numpy.nonzero(followed | inner | outer)
    value = phi[kept]
    scale = numpy.sqrt(2.0 * DECAY)
    slope = numpy.sqrt(sum(part[kept]**2 for part in gradient)) / scale
    slope = numpy.maximum(slope, SLOPE_MIN * ISOVALUE)
    delta = (value - ISOVALUE) / slope / WINDOW
    root = numpy.select(
        [value > high, value < low],
        [INSIDE_WEIGHT / ISOVALUE, OUTSIDE_WEIGHT / ISOVALUE],
        (FLOOR + numpy.exp(-delta**2)) / slope)
    largest = numpy.finfo(numpy.float32).max
    return Problem(
        numpy.stack([axis[index] for axis, index in zip(axes, kept)], axis=1),
        numpy.select([value > high, value < low], [high, -largest], value).astype(numpy.float32),
        numpy.select([value > high, value < low], [largest, low], value).astype(numpy.float32),
        (root**2).astype(numpy.float32))


# ---- models --------------------------------------------------------------------------------------


def rotation(alpha, beta, gamma):
    """As in the paper; its rows are the directions of the axes."""
    ca, cb, cg = numpy.cos((alpha, beta, gamma))
    sa, sb, sg = numpy.sin((alpha, beta, gamma))
    return numpy.array([
        [cb * cg, -ca * sg - sa * sb * cg, sa * sg - ca * cg * sb],
        [cb * sg, ca * cg - sa * sb * sg, -sa * cg - ca * sb * sg],
        [sb, cb * sa, ca * cb]])


def angles(r):
    cosine = numpy.hypot(r[0, 0], r[1, 0])
    beta = numpy.arctan2(r[2, 0], cosine)
    if cosine > 1e-12:
        return numpy.arctan2(r[2, 1], r[2, 2]), beta, numpy.arctan2(r[1, 0], r[0, 0])
    return 0.0, beta, numpy.arctan2(-r[0, 1], r[1, 1])


LOWER = numpy.tril_indices(3)  # rows of L: l00 l10 l11 l20 l21 l22


def read_model(path):
    """Rows of ln a, the centre and L, the lower triangle with L L^T = A, of a model file."""
    rows = []
    for amplitude, *rest in numpy.loadtxt(path, ndmin=2):
        r = rotation(*rest[6:])
        factor = numpy.linalg.cholesky(r.T @ numpy.diag(rest[:3]) @ r)
        rows.append([numpy.log(amplitude), *rest[3:6], *factor[LOWER]])
    return numpy.array(rows)


def write_model(path, parameters, factor=1.0):
    """The model of such rows, its amplitudes times `factor`."""
    with open(path, "w", encoding="ascii") as out:
        out.write(f"# ovoid model 1\n# decay: {DECAY}\n# isovalue: {ISOVALUE}\n")
        for row in parameters:
            lower = numpy.zeros((3, 3))
            lower[LOWER] = row[4:]
            decay, axes = numpy.linalg.eigh(lower @ lower.T)
            r = axes.T[::-1].copy()
            r[2] = numpy.cross(r[0], r[1])
            values = [factor * numpy.exp(row[0]), *decay[::-1], *row[1:4], *angles(r)]
            out.write(" ".join(f"{value:.9g}" for value in values) + "\n")
