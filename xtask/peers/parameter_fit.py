"""SciPy's least_squares on the fit of `fit_speed`, as the peer of `parameter_fit_s`: inertia, viscous and dry friction of a rig, by
what its free run is off in windows of 1 s, then of 5 s, then over the whole recording; the same plant, in plain Python, which is
faster here than NumPy on a few windows. Runs ours and this by turns: parameter_fit.py PROGRAM RIG RECORDING."""

import csv
import statistics
import subprocess
import sys
import time
import tomllib

import numpy as np
import scipy
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

NAMES = ("inertia", "viscous", "coulomb")
STAGES_S = (1.0, 5.0, float("inf"))
RUNS, MOST_ROWS, STEP, ENOUGH = 3, 4000, 5e-4, 1e-4
# Both stop when an iteration gains less than 1e-4 of the sum of squares; the friction is known no better by that.
TOLERANCE = 0.02


class Recording:
    def __init__(self, rig, path):
        with open(path, newline="") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
        limit = rig["actuator"].get("limit", float("inf"))
        column = lambda name: np.array([float(row[name]) for row in rows])
        self.time = column("time_s")
        self.drive = (rig["actuator"]["gain"] * np.clip(column("command"), -limit, limit)).tolist()
        counts = column("position_counts")
        self.position = (counts - counts[0]) / rig["encoder"]["counts_per_unit"]
        self.dt = float(np.mean(np.diff(self.time)))
        # A parabola through the rows within 10 ms on either side, as ours.
        width = 2 * round(0.01 / self.dt) + 1
        self.speed = savgol_filter(self.position, width, 2, deriv=1, delta=self.dt)
        self.every = max(1, -(-len(rows) // MOST_ROWS))

    def off(self, values, seconds):
        rows = len(self.drive)
        window = rows if seconds == float("inf") else round(seconds / self.dt)
        runs = [self.run(values, begin, min(begin + window, rows)) for begin in range(0, rows, window)]
        simulated = np.concatenate(runs)
        kept = slice(None, None, self.every)
        return simulated[kept] - self.position[kept]

    def run(self, values, begin, end):
        """Dry friction stops the axis; it never turns it round within a step."""
        inertia, viscous, coulomb = values
        dt, drive = self.dt, self.drive
        gain = dt / inertia
        q, v = float(self.position[begin]), float(self.speed[begin])
        places = []
        for row in range(begin, end):
            places.append(q)
            free = drive[row] - viscous * v
            before = v
            if v == 0.0:
                if free > coulomb:
                    v = (free - coulomb) * gain
                elif free < -coulomb:
                    v = (free + coulomb) * gain
            else:
                coasting = v + free * gain
                v = coasting - (coulomb if before > 0.0 else -coulomb) * gain
                if v * before < 0.0 and (coasting * before > 0.0 or -coulomb <= free <= coulomb):
                    v = 0.0
            q += 0.5 * (before + v) * dt
        return np.array(places)


def fit(rig, recording):
    values = np.array([rig["model"][name] for name in NAMES])
    for seconds in STAGES_S:
        scale = values.copy()
        at = lambda theta: np.maximum(scale * (1.0 + theta), (0.05 * scale[0], 0.0, 0.0))
        off = lambda theta: recording.off(at(theta), seconds)
        found = least_squares(off, np.zeros(3), diff_step=STEP, ftol=ENOUGH, x_scale=0.1)
        values = at(found.x)
    return values


def ours(program, rig, recording):
    out = subprocess.run([program, rig, recording], check=True, capture_output=True, text=True).stdout
    words = dict(word.split("=") for word in out.split())
    return float(words["parameter_fit_s"]), np.array([float(words[name]) for name in NAMES])


def main():
    program, rig_path, recording_path = sys.argv[1:]
    with open(rig_path, "rb") as file:
        rig = tomllib.load(file)
    recording = Recording(rig, recording_path)
    times = ([], [])
    for _ in range(RUNS):
        seconds, mine = ours(program, rig_path, recording_path)
        times[0].append(seconds)
        begin = time.perf_counter()
        theirs = fit(rig, recording)
        times[1].append(time.perf_counter() - begin)
    apart = float(np.max(np.abs(theirs / mine - 1.0)))
    rms = lambda values: float(np.sqrt(np.mean(recording.off(values, float("inf")) ** 2)))
    for name, a, b in zip(NAMES, mine, theirs):
        print(f"parameter fit: {name} {a:.4e} here, {b:.4e} by SciPy")
    print(f"parameter fit: at most {100 * apart:.2f} % apart, tolerance {100 * TOLERANCE:.0f} %;", end=" ")
    print(f"free run off by {rms(mine):.4g} rad here, {rms(theirs):.4g} rad by SciPy")
    print(f"parameter_fit_s={statistics.median(times[0]):.4f}", end=" ")
    print(f"parameter_fit_s.peer=SciPy-{scipy.__version__} parameter_fit_s.peer_value={statistics.median(times[1]):.3f}")
    if apart > TOLERANCE:
        sys.exit("the two fits do not give the same answer")


main()
