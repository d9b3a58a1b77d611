"""The anatomy by ray casting: where along the needle a vein is first met, at any angle, aimed at its axis or beside it."""

import math

import paper_001
from device import hand

AXIS_MM, HEIGHT_MM, WIDTH_MM = 6.3, 3.0, 4.46


def inside(x, y, z):
    """True in the vein: an elliptic cylinder along x; y is across, z is the depth below the skin."""
    del x
    return (y / (WIDTH_MM / 2.0)) ** 2 + ((z - AXIS_MM) / (HEIGHT_MM / 2.0)) ** 2 <= 1.0


def cast(angle_deg, offset_mm, step_mm=0.002, reach_mm=30.0):
    """Marches along the needle's axis; the way to the first point in the vein in mm, or None where it passes beside."""
    sine, cosine = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    way = 0.0
    while way < reach_mm:
        if inside(way * cosine, offset_mm, way * sine):
            return way
        way += step_mm
    return None


def check(device, report):
    for angle_deg, offset_mm in ((20, 0.0), (30, 0.0), (45, 0.0), (60, 0.0), (90, 0.0), (45, 1.0), (45, -2.0), (45, 2.5)):
        wanted = cast(angle_deg, offset_mm)
        # A skin that gives way after 0.1 mm and springs back whole carries nothing along.
        patient = paper_001.arm(9.0, 4.0).replace("puncture_mm = 3.0", "puncture_mm = 0.1", 1)
        patient = patient.replace("relief = { vertex_mm = 4.0, compliance_mm2_per_n = 2.5", "relief = { vertex_mm = 0.2, compliance_mm2_per_n = 1000.0", 1)
        patient = patient.replace("unload_n_per_mm = 1.0\n", "unload_n_per_mm = 1.0\nspring_back = 0.0\n", 1)
        patient += f"[vessel]\nwidth_mm = {WIDTH_MM}\noffset_mm = {offset_mm}\n"
        deep_mm = 5.8 / math.sin(math.radians(angle_deg))
        steps = [f"to_mm = {deep_mm:.3f}\nspeed_mm_s = 20.0", "to_mm = -1.0\nspeed_mm_s = 20.0"]
        if wanted is not None:
            steps[0] = f"to_mm = {wanted + 0.8:.3f}\nspeed_mm_s = 20.0"
        recording = device.record(patient, hand(steps), 1.0 + 2.0 * (deep_mm + 2.0) / 20.0, angle_deg=angle_deg)
        met = recording.score[0]["vessel_contact_path_mm"]
        name = f"vein at {angle_deg} degrees, {offset_mm:g} mm beside its axis"
        if wanted is None:
            report.holds(f"{name}: passes beside", met is None, f"met at {met}")
        elif met is None:
            report.holds(f"{name}: met at {wanted:.2f} mm", False, "never met")
        else:
            report.within(f"{name}: met at {wanted:.2f} mm", met - wanted, 0.03, "mm")
