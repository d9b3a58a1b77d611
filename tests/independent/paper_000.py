"""Paper 000: F(depth, speed, angle) from a table, by two interpolations that are not the device's."""

import math

import numpy
from device import TICK_S, hand, way_between_counts
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

STEP_MM, SPEEDS, ANGLES = 0.8, (1.0, 3.0, 5.0), (30.0, 45.0, 60.0)
CURVE = (0.0, 0.07, 0.27, 0.6, 0.32, 0.36, 0.72, 0.4, 0.42, 0.6, 0.95, 0.55, 0.6, 0.65, 0.7, 0.75)
DEPTHS = STEP_MM * numpy.arange(len(CURVE))


def table():
    """Forces in N over depth, speed and angle; whole mN, as a table holds them."""
    factor = numpy.array([[(1.0 + 0.06 * (v - 1.0)) * a for a in (0.8, 0.9, 1.0)] for v in SPEEDS])
    return numpy.round(numpy.array(CURVE)[:, None, None] * factor[None], 3)


def phantom():
    """The text of a profile with that table: three layers, at 0, 4 and 7 mm."""
    rows = table().reshape(len(CURVE), -1).T
    force = ",\n".join("[" + ", ".join(f"{f:.3f}" for f in row) + "]" for row in rows)
    layers = "".join(f'[[layer]]\ntissue = "{name}"\ndepth_mm = {at}\n' for name, at in (("skin", 0.0), ("vessel", 4.0), ("far-wall", 7.0)))
    return (
        'format = 1\nname = "independent"\nentry_deg = 60.0\n[law]\nmodel = "xr"\nstiffness_n_per_mm = 1.5\nwithdrawal = 0.4\n'
        f"[force_table]\ngives_way = [3, 6, 10]\ndepth_step_mm = {STEP_MM}\nspeeds_mm_s = [1.0, 3.0, 5.0]\nangles_deg = [30.0, 45.0, 60.0]\n"
        f"measured = [{', '.join(['true'] * 9)}]\nforce_n = [\n{force},\n]\n{layers}"
    )


def no_buzz(device, report):
    """An even insertion has no line of its own: the force less a smooth curve through it, in a spectrum."""
    for speed in (1.0, 3.0, 5.0):
        flat = phantom().split("force_n = [")[0]
        flat += "force_n = [\n" + ",\n".join(str([0.03 * (k + 1) * (1.0 + 0.06 * v) for k in range(16)]) for v in range(9)) + "]\n"
        flat = flat.replace("gives_way = [3, 6, 10]\n", "") + phantom().split("]\n[[layer]]")[1].join(["[[layer]]", ""])
        way_mm = 11.0
        steps = [f"to_mm = {way_mm}\nspeed_mm_s = {speed}", "to_mm = -1.0\nseconds = 2.0"]
        recording = device.record(flat, hand(steps, entry_deg=60.0), 0.5 + (way_mm + 1.0) / speed)
        rows = slice(int(numpy.searchsorted(recording.depth_mm, 1.5)), int(numpy.searchsorted(recording.depth_mm, way_mm - 0.5)))
        force = recording.force_n[rows]
        where = numpy.arange(len(force)) / len(force)
        rest = force - numpy.polyval(numpy.polyfit(where, force, 12), where)
        window = numpy.hanning(len(rest))
        lines = 2.0 * numpy.abs(numpy.fft.rfft(rest * window)) / window.sum()
        hertz = numpy.fft.rfftfreq(len(rest), TICK_S)
        band = hertz > 15.0
        loudest = int(numpy.argmax(lines[band]))
        report.within(f"F at {speed:g} mm/s: the strongest line above 15 Hz, at {hertz[band][loudest]:.0f} Hz", lines[band][loudest], 0.003, "N")


def gives_way_once(device, report):
    """A layer tears once: in its track the needle feels less than before, beside it as much."""
    into = "to_mm = 10.5\nspeed_mm_s = 5.0"
    for name, steps in (
        ("through the old track", [into, "to_mm = 0.5\nspeed_mm_s = 10.0", into]),
        ("beside it", [into, "to_mm = 2.0\nspeed_mm_s = 10.0\nturned_deg = -20.0", "to_mm = 14.5\nspeed_mm_s = 5.0"]),
    ):
        recording = device.record(phantom(), hand([*steps, "to_mm = -1.0\nseconds = 2.0\nturned_deg = 0.0"], entry_deg=60.0), 10.0)
        turn = int(numpy.argmax(recording.depth_mm > 10.3))
        back = turn + int(numpy.argmin(recording.depth_mm[turn : turn + 30_000]))
        below = lambda rows: recording.depth_mm[rows] * numpy.sin(recording.tilt_rad[rows])
        peak = lambda rows: recording.force_n[rows][(below(rows) > 7.5) & (below(rows) < 8.2)].max()
        first, again = peak(slice(0, turn)), peak(slice(back, back + 25_000))
        ratio = again / first
        ok = ratio < 0.7 if name.startswith("through") else ratio > 0.8
        report.holds(f"the bottom skin, pierced again {name}", ok, f"{first:.3f} N, then {again:.3f} N")
        score = recording.score[0]
        report.holds("the score of that, layers that gave way", (score["punctures"] == 3) == name.startswith("through"), f"{score['punctures']}")


def check(device, report):
    no_buzz(device, report)
    gives_way_once(device, report)
    forces = table()
    linear = RegularGridInterpolator((DEPTHS, SPEEDS, ANGLES), forces)
    smooth = PchipInterpolator(DEPTHS, forces, axis=0)
    for speed, angle in ((1.0, 60.0), (3.0, 60.0), (5.0, 60.0), (5.0, 30.0), (5.0, 45.0), (2.0, 52.0), (4.0, 37.0)):
        way_mm = 10.0 / math.sin(math.radians(angle))
        steps = [f"to_mm = {way_mm:.3f}\nspeed_mm_s = {speed}", "to_mm = -1.0\nseconds = 2.0"]
        recording = device.record(phantom(), hand(steps, entry_deg=angle), 0.5 + (way_mm + 1.0) / speed + 2.0)
        rows = recording.way_in()
        depth = way_between_counts(recording.depth_mm[rows]) * math.sin(math.radians(angle))
        # The hand reaches its even speed a little past the start, and gives a little at the end.
        steady = (depth > 0.4) & (depth < 9.7)
        depth, force = depth[steady], recording.force_n[rows][steady]
        where = numpy.column_stack([depth, numpy.full(len(depth), speed), numpy.full(len(depth), angle)])
        difference = force - linear(where)
        name = f"F(d, {speed:g} mm/s, {angle:g} deg)"
        report.within(f"{name}, linear in all three, mean", difference.mean(), 0.004, "N")
        report.within(f"{name}, the same, largest", numpy.abs(difference).max(), 0.020, "N")
        # A smooth curve through the same knots: in the table's own cells both agree where the knots are.
        if speed in SPEEDS and angle in ANGLES:
            cell = smooth(depth)[:, SPEEDS.index(speed), ANGLES.index(angle)]
            near = numpy.abs(depth / STEP_MM - numpy.round(depth / STEP_MM)) < 0.02
            report.within(f"{name}, a smooth curve, at the knots, rms", math.sqrt(((force - cell)[near] ** 2).mean()), 0.012, "N")
