"""Table 1 of paper 000 under a needle: the state that `reproduce` writes against the least elastic energy, by Newton's method.

The energy of a constraint is C^2/(2*alpha), with C as the paper has it: length, signed volume, angle between planes. Nothing moves here:
where the solver's substeps are fine enough, particles come to rest where the energy is least. Lengths in mm, forces in uN.
"""

import json

import numpy
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import splu


def cross(a, b):
    return numpy.cross(a, b)


class Tissue:
    """Constraints as arrays, and where the particles were built."""

    def __init__(self, state):
        split = lambda name, part: numpy.array([one[part] for one in state[name]])
        self.points = numpy.array(state["points"])[:, :3]
        self.built = numpy.array(state["built"])[:, :3]
        self.moves = numpy.array(state["points"])[:, 3] > 0.0
        self.parts = {name: [split(name, part) for part in range(3)] for name in ("distances", "volumes", "bendings")}
        self.ties = [split("ties", part) for part in range(5)]
        corners, weights = (numpy.array(part) for part in state["held"])
        self.held = numpy.zeros(len(self.points))
        numpy.add.at(self.held, corners, weights)

    def constraints(self, x):
        """Each kind's particles, C, slopes of C at each particle, and alpha."""
        ends, rest, soft = self.parts["distances"]
        gap = x[ends[:, 0]] - x[ends[:, 1]]
        length = numpy.linalg.norm(gap, axis=1)
        along = gap / length[:, None]
        yield ends, length - rest, numpy.stack([along, -along], axis=1), soft
        corners, rest, soft = self.parts["volumes"]
        e = x[corners[:, 1:]] - x[corners[:, :1]]
        slopes = numpy.stack([cross(e[:, 1], e[:, 2]), cross(e[:, 2], e[:, 0]), cross(e[:, 0], e[:, 1])], axis=1) / 6.0
        volume = (e[:, 2] * slopes[:, 2]).sum(axis=1)
        yield corners, volume - rest, numpy.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1), soft
        corners, rest, soft = self.parts["bendings"]
        angle, slopes = bending(x[corners])
        yield corners, angle - rest, slopes, soft
        particle, corners, weights, offset, soft = self.ties
        gap = x[particle] - (weights[:, :, None] * x[corners]).sum(axis=1) - offset
        # Three constraints of one tie: its energy is that of its length.
        for axis in range(3):
            slopes = numpy.zeros((len(particle), 1 + corners.shape[1], 3))
            slopes[:, 0, axis], slopes[:, 1:, axis] = 1.0, -weights
            yield numpy.concatenate([particle[:, None], corners], axis=1), gap[:, axis], slopes, soft

    def energy(self, x):
        """uN*mm."""
        return sum(float((c * c / (2.0 * soft)).sum()) for _, c, _, soft in self.constraints(x))

    def forces(self, x):
        """Of all constraints on each particle, uN."""
        forces = numpy.zeros_like(x)
        for particles, c, slopes, soft in self.constraints(x):
            numpy.add.at(forces, particles, -(c / soft)[:, None, None] * slopes)
        return forces

    def curvature(self, x):
        """Gauss-Newton's: sum of slope * slope^T / alpha."""
        rows, columns, values = [], [], []
        for particles, _, slopes, soft in self.constraints(x):
            freedoms = (3 * particles[:, :, None] + numpy.arange(3)).reshape(len(particles), -1)
            flat = slopes.reshape(len(particles), -1)
            values.append((flat[:, :, None] * flat[:, None, :] / soft[:, None, None]).ravel())
            rows.append(numpy.repeat(freedoms, flat.shape[1], axis=1).ravel())
            columns.append(numpy.tile(freedoms, flat.shape[1]).ravel())
        size = 3 * len(x)
        joined = [numpy.concatenate(part) for part in (rows, columns, values)]
        return coo_matrix((joined[2], (joined[0], joined[1])), shape=(size, size)).tocsc()


def bending(p):
    """Signed angle between the planes of two triangles with the edge p0-p1, from flat, and its slopes (Bridson et al. 2003)."""
    edge = p[:, 1] - p[:, 0]
    long = numpy.linalg.norm(edge, axis=1)[:, None]
    n1, n2 = cross(p[:, 0] - p[:, 2], p[:, 1] - p[:, 2]), cross(p[:, 1] - p[:, 3], p[:, 0] - p[:, 3])
    angle = numpy.arctan2((cross(n1, n2) * edge).sum(axis=1) / long[:, 0], (n1 * n2).sum(axis=1))
    u1, u2 = (n / (n * n).sum(axis=1)[:, None] for n in (n1, n2))
    share = lambda corner, origin: ((p[:, corner] - p[:, origin]) * edge).sum(axis=1)[:, None] / long
    slopes = [-(share(2, 1) * u1 + share(3, 1) * u2), share(2, 0) * u1 + share(3, 0) * u2, -long * u1, -long * u2]
    return angle, numpy.stack(slopes, axis=1)


def at_rest(tissue, begin, held_at):
    """Where the energy is least, with the needle's place held where it is: Newton's method with damping."""
    x, damping = begin.copy(), 1.0
    free = numpy.repeat(tissue.moves, 3)
    where = numpy.flatnonzero(free)
    hold = 1e9  # uN/mm: 0.3 N give by a fraction of a um
    weights = numpy.kron(tissue.held[:, None], numpy.eye(3))  # 3n x 3
    pull = lambda x: held_at - tissue.held @ x if held_at is not None else numpy.zeros(3)
    objective = lambda x: tissue.energy(x) + 0.5 * hold * float((pull(x) ** 2).sum())
    now = objective(x)
    for _ in range(200):
        slope = -(tissue.forces(x).ravel() + hold * (weights @ pull(x)))[where]
        matrix = tissue.curvature(x)
        if held_at is not None:
            sparse = coo_matrix(weights).tocsc()
            matrix = matrix + hold * (sparse @ sparse.T)
        matrix = matrix[where][:, where].tocsc()
        step = numpy.zeros(3 * len(x))
        step[where] = splu((matrix + damping * 1e3 * identity(len(where), format="csc")).tocsc()).solve(-slope)
        after = x + step.reshape(-1, 3)
        reached = objective(after)
        if reached < now:
            fell, x, now, damping = now - reached, after, reached, max(damping / 4.0, 1e-3)
            if fell < 1e-7 * abs(now):
                break
        else:
            damping *= 8.0
    return x


def residual(tissue):
    """The force on particles that nothing holds, over that on the needle."""
    forces = tissue.forces(tissue.points)
    onto = forces[tissue.held > 0.0].sum(axis=0)
    free = (forces - tissue.held[:, None] * onto)[tissue.moves]
    return float(numpy.sqrt((free**2).sum()) / numpy.linalg.norm(onto))


def check(device, report):
    device._run("reproduce", "--paper", "000", "--out", device.folder)
    state = json.loads((device.folder / "paper-000-push.json").read_text())
    tissue = Tissue(state)
    here = tissue.energy(tissue.points)
    report.within("Table 1 pushed to 5 mm, its energy by another program", here * 1e-6 / state["energy_mj"] - 1.0, 0.01, "")
    report.within("Table 1, its residual by another program", residual(tissue) - state["residual"], 0.05, "")
    pushed = at_rest(tissue, tissue.points, tissue.held @ tissue.points)
    free = at_rest(tissue, tissue.points, None)
    least = tissue.energy(pushed)
    print(f"      least energy {least * 1e-6:.3f} mJ pushed, {tissue.energy(free) * 1e-6:.3f} mJ free")
    report.within("Table 1, energy of the push over the least there is", (here - least) / (least - tissue.energy(free)), 0.04, "")
    gone = numpy.linalg.norm(pushed - tissue.points, axis=1)
    report.within("Table 1, particles against those of the least energy, largest", gone.max(), 0.5, "mm")
    surface = float((tissue.held @ (pushed - free))[2])
    report.within("Table 1, how far the surface is pushed in, against least energy", surface - state["depth_mm"], 0.25, "mm")
