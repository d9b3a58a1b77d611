"""Makes the recordings that `host-sim demo` comes with: a rotor whose simulation lacks cogging, and
one that lacks drag and runs at one speed, from which nobody can tell. A plant of its own, integrated here with
none of this project's code; the seed is fixed, so the files are the same on every machine.

    python3 tests/independent/demo.py host-sim/demo
"""

import math
import random
import sys
from pathlib import Path

INERTIA, VISCOUS, COULOMB = 0.02, 0.05, 0.10  # kg·m², N·m·s/rad, N·m
ORDER = 14  # cycles a turn: 7 pairs of poles
COUNTS = 20000 / math.tau  # counts a rad
RATE, FINE = 250, 80  # rows a second, steps a row
HEADER = "time_s,command,position_counts"

RIG = """# {text}
format = 1
name = "{name}"
kind = "rotary"

[model]
inertia = 0.02
viscous = 0.05
coulomb = 0.1

[uncertainty]
inertia = 0.1
viscous = 0.3
coulomb = 0.3
gain = 0.05

[actuator]
gain = 1.0
command_unit = "N·m"

[encoder]
counts_per_unit = {counts!r}
turn = {turn!r}
"""


def record(seconds, reference, seed, cogging, drag):
    """One recording under a position loop, as the lines of a CSV."""
    chance = random.Random(seed)
    tones = [chance.uniform(0, math.tau) for _ in range(4)]
    start = chance.uniform(0, math.tau)
    q = v = slow = 0.0
    h = 1.0 / (RATE * FINE)
    lines = [HEADER]
    for row in range(int(seconds * RATE)):
        t = row / RATE
        counts = round(q * COUNTS)
        want, speed = reference(t, tones)
        command = round(6.0 * (want - counts / COUNTS) + 0.35 * (speed - v), 5)
        lines.append(f"{t:.4f},{command:.5f},{counts}")
        for _ in range(FINE):
            # A disturbance that wanders within 20 ms, 2 mN·m rms.
            slow += -slow * h / 0.02 + chance.gauss(0, 1) * 0.002 * math.sqrt(2 * h / 0.02)
            force = command + slow + cogging * math.sin(ORDER * (q + start)) - VISCOUS * v - drag * v * abs(v)
            if v == 0.0 and abs(force) <= COULOMB:
                continue
            way = math.copysign(1.0, v if v else force)
            new = v + (force - COULOMB * way) / INERTIA * h
            v = 0.0 if v * new < 0 else new
            q += v * h
    return "\n".join(lines) + "\n"


def lively(t, tones):
    """Strokes of several speeds: place and speed."""
    parts = [(1.6, 0.31), (0.7, 0.83), (0.25, 1.9), (0.08, 3.7)]
    place = sum(a * (math.sin(math.tau * f * t + p) - math.sin(p)) for (a, f), p in zip(parts, tones))
    speed = sum(a * math.tau * f * math.cos(math.tau * f * t + p) for (a, f), p in zip(parts, tones))
    return place, speed


def steady(t, _):
    """One speed, one way."""
    return 2.0 * t, 2.0


def write(folder, name, reference, seeds, **missing):
    folder.mkdir(parents=True, exist_ok=True)
    text = "The rotor as its author believes it: friction, and nothing else"
    rig = RIG.format(name=name, text=text, counts=COUNTS, turn=math.tau)
    (folder / "rig.toml").write_text(rig)
    for file, seed in zip(("fit-a", "fit-b", "holdout"), seeds):
        (folder / f"{file}.csv").write_text(record(8.0, reference, seed, **missing))


def main():
    top = Path(sys.argv[1])
    write(top / "missing", "a rotor", lively, (1, 2, 3), cogging=0.08, drag=0.0)
    write(top / "cannot-tell", "a rotor at one speed", steady, (4, 5, 6), cogging=0.0, drag=0.02)


main()
