"""Recordings of an axis whose rig is complete, with rows that are skewed by part of a row or that Euler's method made.

The diagnosis may name nothing in them. The plant is integrated here, 20 steps a row, and the recordings are written by hand: nothing
of this project takes part before `diagnose` reads them.
"""

import numpy as np

INERTIA, GAIN, VISCOUS, DRY = 2.4e-6, 0.0234, 1.2e-6, 4.0e-4
COUNTS_PER_RAD = 4000 / (2 * np.pi)
SECONDS, STEPS_A_ROW = 8, 20
RIG = f"""format = 1
name = "skewed rows"
kind = "rotary"
[model]
inertia = {INERTIA}
viscous = {VISCOUS}
coulomb = {DRY}
offset = 0.0
[uncertainty]
inertia = 0.15
viscous = 0.5
coulomb = 0.5
gain = 0.1
offset = 2e-5
[actuator]
gain = {GAIN}
command_unit = "A"
[encoder]
counts_per_unit = {COUNTS_PER_RAD}
turn = 6.283185307
"""


def command(random, rate):
    """A multisine of 14 lines between 0.5 and 40 Hz, 60 mA root mean square."""
    time = np.arange(SECONDS * rate) / rate
    lines = zip(random.uniform(0.5, 40, 14), random.uniform(0, 2 * np.pi, 14))
    signal = sum(np.sin(2 * np.pi * hz * time + phase) for hz, phase in lines)
    return 0.06 * signal / np.std(signal)


def acceleration(force, speed, values):
    """Acceleration under dry and viscous friction, and whether friction holds the axis at rest."""
    inertia, viscous, dry = values
    free = force - viscous * speed
    if speed == 0 and abs(free) <= dry:
        return 0.0, True
    way = np.sign(speed) if speed else np.sign(free)
    return (free - dry * way) / inertia, abs(free) <= dry


def skewed(u, rate, late_rows, values):
    """Positions where each row's command acts `late_rows` rows after its time stamp."""
    positions, position, speed = [], 0.0, 0.0
    step = 1 / (rate * STEPS_A_ROW)
    for row in range(len(u)):
        positions.append(position)
        for part in range(STEPS_A_ROW):
            acts = int(np.clip(np.floor(row + part / STEPS_A_ROW - late_rows + 1e-9), 0, len(u) - 1))
            rate_of_change, holds = acceleration(GAIN * u[acts], speed, values)
            after = speed + step * rate_of_change
            after = 0.0 if speed and after * speed < 0 and holds else after
            position, speed = position + step * (speed + after) / 2, after
    return np.array(positions)


def by_euler(u, rate, is_implicit, values):
    """Positions of Euler's method with one step a row, explicit or semi-implicit."""
    positions, position, speed = [], 0.0, 0.0
    for force in GAIN * u:
        positions.append(position)
        after = speed + acceleration(force, speed, values)[0] / rate
        after = 0.0 if speed and after * speed < 0 else after
        position, speed = position + (after if is_implicit else speed) / rate, after
    return np.array(positions)


CASES = {
    "half a row late, 500 Hz": (500, 0.5, lambda *axis: skewed(*axis[:2], 0.5, axis[2])),
    "half a row early, 1 kHz": (1000, -0.5, lambda *axis: skewed(*axis[:2], -0.5, axis[2])),
    "explicit Euler, 1 kHz": (1000, 0.5, lambda *axis: by_euler(*axis[:2], False, axis[2])),
    "semi-implicit Euler, 500 Hz": (500, -0.5, lambda *axis: by_euler(*axis[:2], True, axis[2])),
}


def write(path, u, rate, positions):
    counts = np.floor(positions * COUNTS_PER_RAD).astype(int)
    rows = (f"{row / rate:.6f},{value:.6f},{count}" for row, (value, count) in enumerate(zip(u, counts)))
    path.write_text("time_s,command,position_counts\n" + "\n".join(rows) + "\n")


def check(device, report):
    (device.folder / "rig.toml").write_text(RIG)
    for seed, (name, (rate, late_rows, integrate)) in enumerate(CASES.items()):
        random = np.random.default_rng(7300 + seed)
        off = ((INERTIA, 0.08), (VISCOUS, 0.2), (DRY, 0.2))
        values = [value * (1 + part * random.standard_normal()) for value, part in off]
        for file in ("fit-1", "fit-2", "holdout"):
            u = command(random, rate)
            write(device.folder / f"{file}.csv", u, rate, integrate(u, rate, values))
        found = device.diagnose("rig.toml", ("fit-1.csv", "fit-2.csv"), "holdout.csv")
        names = [effect["name"] for effect in found["effects"]]
        report.holds(f"{name}: no effect is named", not names, names)
        report.within(f"{name}: the skew", found.get("command_late_rows", 0.0) - late_rows, 0.1, "rows")
