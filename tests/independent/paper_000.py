"""Paper 000: F(depth, speed, angle) from a table, by two interpolations that are not the device's."""

import math

import numpy
from device import hand
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
        f"[force_table]\ndepth_step_mm = {STEP_MM}\nspeeds_mm_s = [1.0, 3.0, 5.0]\nangles_deg = [30.0, 45.0, 60.0]\n"
        f"measured = [{', '.join(['true'] * 9)}]\nforce_n = [\n{force},\n]\n{layers}"
    )


def check(device, report):
    forces = table()
    linear = RegularGridInterpolator((DEPTHS, SPEEDS, ANGLES), forces)
    smooth = PchipInterpolator(DEPTHS, forces, axis=0)
    for speed, angle in ((1.0, 60.0), (3.0, 60.0), (5.0, 60.0), (5.0, 30.0), (5.0, 45.0), (2.0, 52.0), (4.0, 37.0)):
        way_mm = 10.0 / math.sin(math.radians(angle))
        steps = [f"to_mm = {way_mm:.3f}\nspeed_mm_s = {speed}", "to_mm = -1.0\nseconds = 2.0"]
        recording = device.record(phantom(), hand(steps, entry_deg=angle), 0.5 + (way_mm + 1.0) / speed + 2.0)
        rows = recording.way_in()
        depth = recording.depth_mm[rows] * math.sin(math.radians(angle))
        # The hand reaches its even speed a little past the start, and gives a little at the end.
        steady = (depth > 0.4) & (depth < 9.7)
        depth, force = depth[steady], recording.force_n[rows][steady]
        where = numpy.column_stack([depth, numpy.full(len(depth), speed), numpy.full(len(depth), angle)])
        difference = force - linear(where)
        name = f"F(d, {speed:g} mm/s, {angle:g} deg)"
        report.within(f"{name}, linear in all three, mean", difference.mean(), 0.015, "N")
        report.within(f"{name}, the same, largest", numpy.abs(difference).max(), 0.080, "N")
        # A smooth curve through the same knots: in the table's own cells both agree where the knots are.
        if speed in SPEEDS and angle in ANGLES:
            cell = smooth(depth)[:, SPEEDS.index(speed), ANGLES.index(angle)]
            near = numpy.abs(depth / STEP_MM - numpy.round(depth / STEP_MM)) < 0.02
            report.within(f"{name}, a smooth curve, at the knots, rms", math.sqrt(((force - cell)[near] ** 2).mean()), 0.030, "N")
