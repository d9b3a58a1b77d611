"""SciPy on the tissue picture's own mesh, as the peer of `xpbd_step_ms`: one step of implicit Euler per substep, solved by L-BFGS until
every particle is in balance to less than 10 uN, which moves it by some micrometres. The particles, distances and volumes are those that the example `xpbd_speed` wrote to the file that `XPBD_MESH`
names; the bending of the vessel's wall and its ties to the tissue, 4 % of the constraints, are left out. All particles begin with a
push, so that every constraint works."""

import json
import os
import statistics
import time

import numpy
import scipy
from scipy.optimize import minimize

STEP_S = 1 / 60
PUSH_MM_PER_S = 40.0
# Largest force at which the solver stops, and above which its step counts as failed, uN.
TOLERANCE_UN = 1.0
FAILED_UN = 10.0


class Mesh:
    """The energy of a mesh whose particles are drawn to where they would be without forces; mm, g, s, uN."""

    def __init__(self, path, step_s):
        with open(path) as file:
            mesh = json.load(file)
        points = numpy.array(mesh["points"])
        self.substeps = mesh["substeps"]
        self.step_s = step_s / self.substeps
        self.rest, inverse = points[:, :3], points[:, 3]
        self.free = inverse > 0
        self.inertia = numpy.where(self.free, 1 / numpy.where(self.free, inverse, 1), 0)[:, None] / self.step_s**2
        self.ends = numpy.array([one[0] for one in mesh["distances"]])
        self.lengths, softness = numpy.array([one[1:] for one in mesh["distances"]]).T
        self.stiffness = 1 / softness
        self.corners = numpy.array([one[0] for one in mesh["volumes"]])
        self.volumes, softness = numpy.array([one[1:] for one in mesh["volumes"]]).T
        self.bulk = 1 / softness

    def value(self, flat, aim):
        """Energy, uN mm, and its gradient, uN."""
        x = flat.reshape(-1, 3)
        off = x - aim
        pull = self.inertia * off
        energy = 0.5 * numpy.sum(pull * off)
        first, second = self.ends.T
        way = x[second] - x[first]
        length = numpy.sqrt(numpy.einsum("ij,ij->i", way, way))
        stretch = length - self.lengths
        energy += 0.5 * numpy.sum(self.stiffness * stretch**2)
        force = (self.stiffness * stretch / length)[:, None] * way
        a, b, c, d = (x[self.corners[:, k]] for k in range(4))
        areas = [numpy.cross(c - a, d - a), numpy.cross(d - a, b - a), numpy.cross(b - a, c - a)]
        grown = numpy.einsum("ij,ij->i", areas[0], b - a) / 6 - self.volumes
        energy += 0.5 * numpy.sum(self.bulk * grown**2)
        pressure = (self.bulk * grown / 6)[:, None]
        places = numpy.concatenate([second, first, *(self.corners[:, k] for k in (1, 2, 3)), self.corners[:, 0]])
        parts = [pressure * area for area in areas]
        values = numpy.concatenate([force, -force, *parts, -sum(parts)])
        for axis in range(3):
            pull[:, axis] += numpy.bincount(places, values[:, axis], len(x))
        pull[~self.free] = 0
        return energy, pull.ravel()

    def step(self, x, speed):
        """Positions and speeds a substep later."""
        aim = numpy.where(self.free[:, None], x + self.step_s * speed, x)
        options = {"maxiter": 2000, "maxfun": 4000, "gtol": TOLERANCE_UN, "ftol": 0}
        found = minimize(self.value, aim.ravel(), (aim,), "L-BFGS-B", jac=True, options=options)
        left = numpy.abs(found.jac).max()
        if left > FAILED_UN:
            raise SystemExit(f"the step ended with a force of {left:.1f} uN: {found.message}")
        new = found.x.reshape(-1, 3)
        return new, (new - x) / self.step_s


def main():
    mesh = Mesh(os.environ["XPBD_MESH"], STEP_S)
    x, speed = mesh.rest, numpy.where(mesh.free[:, None], [0.0, 0.0, PUSH_MM_PER_S], 0.0)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(mesh.substeps):
            x, speed = mesh.step(x, speed)
        times.append(1e3 * (time.perf_counter() - begin))
    print(f"xpbd_step_ms.peer=SciPy-{scipy.__version__}-L-BFGS xpbd_step_ms.peer_value={statistics.median(times):.3f}")


main()
