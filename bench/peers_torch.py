"""The misfit and its gradient in PyTorch, float32, as peers.py gives them to torch.optim.

All forms compute the exponents of points and ellipsoids as a product of the points' monomials and
the ellipsoids' coefficients.

  plain    every point with every ellipsoid, the gradient by automatic differentiation
  dense    the same with the gradient of the coefficients by hand, as a second product: one pass over
           the pairs, in pieces that stay in the cache
  blocked  so, with blocks of neighbouring points, each with the ellipsoids that reach it
"""

import numpy
import torch

CUTOFF = 1e-4  # of an ellipsoid's value at a block, as in host/fit/adaptive/refine.c
SKIN = 1.0  # angstrom by which reaches are enlarged, so that lists last for some steps
EMPTY = -1e4  # exponent of what only fills up a list


def monomials(xyz):
    x, y, z = xyz.unbind(-1)
    return torch.stack([torch.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z], -1)


def forms(parameters):
    """ln a, the centre and the six elements of A = L L^T, from rows of ln a, the centre and L."""
    l00, l10, l11, l20, l21, l22 = parameters[:, 4:].unbind(1)
    a = [l00 * l00, l10 * l10 + l11 * l11, l20 * l20 + l21 * l21 + l22 * l22,
         l00 * l10, l00 * l20, l10 * l20 + l11 * l21]
    return torch.cat([parameters[:, :4], torch.stack(a, 1)], 1)


def coefficients(rows):
    """What the monomials are multiplied by: ln a - (x - c)^T A (x - c)."""
    log, cx, cy, cz, xx, yy, zz, xy, xz, yz = rows.unbind(1)
    lx, ly, lz = xx * cx + xy * cy + xz * cz, xy * cx + yy * cy + yz * cz, xz * cx + yz * cy + zz * cz
    return torch.stack([log - (cx * lx + cy * ly + cz * lz), 2 * lx, 2 * ly, 2 * lz,
                        -xx, -yy, -zz, -2 * xy, -2 * xz, -2 * yz], 1)


def reaches(rows):
    """Half the edges of the boxes beyond which the ellipsoids are below CUTOFF."""
    log, _, _, _, xx, yy, zz, xy, xz, yz = rows.unbind(1)
    minors = torch.stack([yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy], 1)
    determinant = xx * minors[:, 0] - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    height = (log - numpy.log(CUTOFF)).clamp(min=0.0)
    return (height[:, None] * minors / determinant[:, None]).clamp(min=0.0).sqrt()


class Plain:
    name = "plain"
    work = 1 << 25  # pairs that are remembered at once

    def __init__(self, problem, origin, device):
        def on_device(array):
            return torch.tensor(array, dtype=torch.float32, device=device)

        self.terms = monomials(on_device(problem.xyz - origin))
        self.low, self.high = on_device(problem.low), on_device(problem.high)
        self.weight = on_device(problem.weight)

    def misfit(self, parameters):
        """The objective as a number; its gradient is left in parameters.grad."""
        parameters.grad = None
        step, total = max(self.work // len(parameters), 64), 0.0
        for first in range(0, len(self.weight), step):
            part = slice(first, first + step)
            phi = torch.exp(self.terms[part] @ coefficients(forms(parameters)).T).sum(1)
            r = phi - torch.clamp(phi, self.low[part], self.high[part])
            misfit = (self.weight[part] * r * r).sum()
            misfit.backward()
            total += misfit.item()
        return total


class Dense:
    name = "dense"

    def __init__(self, problem, origin, device, work):
        def on_device(array):
            return torch.tensor(array, dtype=torch.float32, device=device)

        self.work = work  # pairs of points and ellipsoids at once
        self.terms = monomials(on_device(problem.xyz - origin))
        self.low, self.high = on_device(problem.low), on_device(problem.high)
        self.weight = on_device(problem.weight)
        self.room = None

    def misfit(self, parameters):
        coefficient = coefficients(forms(parameters))
        matrix = coefficient.detach().T.contiguous()
        count = matrix.shape[1]
        step = max(self.work // count, 64)
        if self.room is None or self.room.shape != (step, count):
            self.room = matrix.new_empty((step, count))
        slope, total = matrix.new_zeros((10, count)), matrix.new_zeros((), dtype=torch.float64)
        for first in range(0, len(self.weight), step):
            part = slice(first, first + step)
            terms = self.terms[part]
            value = torch.mm(terms, matrix, out=self.room[:len(terms)]).exp_()
            phi = value.sum(1)
            r = phi - torch.clamp(phi, self.low[part], self.high[part])
            wr = self.weight[part] * r
            total += torch.dot(wr, r)
            slope.addmm_((terms * wr[:, None]).T, value, alpha=2.0)
        parameters.grad = None
        coefficient.backward(slope.T)
        return total.item()


def split_points(xyz, most):
    """Indices of equal blocks of neighbours, by halving along the longest edge."""
    parts = [numpy.arange(len(xyz))]
    while len(parts[0]) > most:
        halves = []
        for part in parts:
            at = xyz[part]
            axis = numpy.argmax(at.max(0) - at.min(0))
            order = part[numpy.argsort(at[:, axis], kind="stable")]
            halves += [order[:(len(order) + 1) // 2], order[(len(order) + 1) // 2:]]
        parts = halves
    return parts


class Blocked:
    name = "blocked"

    def __init__(self, problem, origin, device, work, block):
        self.work = work
        parts = split_points(problem.xyz, block)
        size = max(len(part) for part in parts)
        index = numpy.stack([numpy.pad(part, (0, size - len(part)), mode="edge") for part in parts])
        real = numpy.arange(size) < numpy.array([len(part) for part in parts])[:, None]
        xyz = problem.xyz[index] - origin
        corners = xyz.min(1), xyz.max(1)
        middle = 0.5 * (corners[0] + corners[1])

        def on_device(array):
            return torch.tensor(array, dtype=torch.float32, device=device)

        self.middle, self.half = on_device(middle), on_device(corners[1] - middle)
        self.terms = monomials(on_device(xyz - middle[:, None]))
        self.low, self.high = on_device(problem.low[index]), on_device(problem.high[index])
        self.weight = on_device(problem.weight[index] * real)
        self.listed = None  # boxes when the lists were made
        self.groups = []  # blocks with lists of about the same length

    def build(self, rows):
        """Lists of the ellipsoids whose box, enlarged, meets that of a block."""
        centre, reach = rows[:, 1:4], reaches(rows)
        if self.listed is not None:
            way = (centre - self.listed[0]).abs() + reach - self.listed[1]
            if way.max() <= SKIN:
                return
        self.listed = centre.clone(), reach.clone()
        near = True
        for middle, half, at, far in zip(*(t.T.contiguous() for t in (
                self.middle, self.half, centre, reach))):
            near = near & ((middle[:, None] - at).abs_() <= half[:, None] + (far + SKIN))
        length = near.sum(1)
        block, ellipsoid = near.nonzero(as_tuple=True)
        rank = torch.arange(len(block), device=block.device) - (length.cumsum(0) - length)[block]
        table = torch.zeros((len(near), max(int(length.max()), 1)), dtype=torch.long,
                            device=block.device)
        table[block, rank] = ellipsoid
        lengths = length.tolist()
        self.groups = []
        blocks = torch.argsort(length).tolist()
        first, size = 0, self.terms.shape[1]
        while first < len(blocks):
            # A group's lists are filled up to its longest.
            last, most = first, 1
            while last < len(blocks) and (last == first or (last + 1 - first) * size * max(
                    most, lengths[blocks[last]]) <= self.work):
                most = max(most, lengths[blocks[last]])
                last += 1
            chosen = torch.tensor(sorted(blocks[first:last]), device=block.device)
            entries = table[chosen, :most]
            empty = torch.arange(most, device=entries.device) >= length[chosen][:, None]
            self.groups.append((chosen, entries.contiguous(), empty))
            first = last
        self.parts = [tuple(t[g[0]].contiguous() for t in
                            (self.terms, self.low, self.high, self.weight)) for g in self.groups]
        self.owner = torch.cat([g[1].reshape(-1) for g in self.groups])
        self.shift = torch.cat([self.middle[g[0]].repeat_interleave(g[1].shape[1], 0)
                                for g in self.groups])
        self.empty = torch.cat([g[2].reshape(-1) for g in self.groups])

    def misfit(self, parameters):
        rows = forms(parameters)
        self.build(rows.detach())
        taken = rows.index_select(0, self.owner)
        taken = torch.cat([taken[:, :1], taken[:, 1:4] - self.shift, taken[:, 4:]], 1)
        coefficient = coefficients(taken)
        matrix = coefficient.detach().clone()
        matrix[:, 0].masked_fill_(self.empty, EMPTY)
        slope, total = torch.empty_like(matrix), matrix.new_zeros((), dtype=torch.float64)
        first = 0
        for (_, entries, _), (terms, low, high, weight) in zip(self.groups, self.parts):
            last = first + entries.numel()
            own = matrix[first:last].view(*entries.shape, 10)
            value = torch.bmm(terms, own.mT).exp_()
            phi = value.sum(2)
            r = phi - torch.clamp(phi, low, high)
            wr = weight * r
            total += (wr * r).sum()
            torch.bmm(value.mT, terms * (2.0 * wr[:, :, None]),
                      out=slope[first:last].view(*entries.shape, 10))
            first = last
        parameters.grad = None
        coefficient.backward(slope)
        return total.item()


def evaluators(problem, origin, device):
    """All forms with the settings that are worth a try."""
    yield lambda: Plain(problem, origin, device)
    for work in (1 << 17, 1 << 20):
        yield lambda: Dense(problem, origin, device, work)
    for work in (1 << 16, 1 << 17):
        for block in (64, 128, 256):
            yield lambda: Blocked(problem, origin, device, work, block)
