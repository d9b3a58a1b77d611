"""Paper 001: eq. 1 (jog effect), eq. 2 (friction cone), and the order of its three stages."""

import math

import numpy
from device import TICK_S, hand
from scipy.optimize import curve_fit

WALL = """[layer.wall]
elastic = { vertex_mm = 0.0, compliance_mm2_per_n = %s, base_n = %s }
puncture_mm = %s
relief = { vertex_mm = %s, compliance_mm2_per_n = %s, base_n = 0.0 }
unload_n_per_mm = 1.0
"""


def arm(skin_a, vessel_a, friction="", base_n=0.0):
    """An arm for the text of a profile: skin, muscle from 2 mm, vein from 4.8 to 7.8 mm."""
    layer = '[[layer]]\ntissue = "%s"\ndepth_mm = %s\nfriction_n_per_mm = 0.02\n'
    skin = WALL % (float(skin_a), base_n, 3.0, 4.0, 2.5)
    vein = WALL % (float(vessel_a), 0.0, 1.41, 2.12, 2.52)
    return (
        f'format = 1\nname = "independent"\nentry_deg = 30.0\n{friction}'
        + layer % ("skin", 0.0) + skin
        + layer % ("muscle", 2.0)
        + layer % ("vessel", 4.8) + vein
        + layer % ("far-wall", 7.8) + vein
    )  # fmt: skip


def eq_1(travel_mm, n, a, b):
    """f(T) = (T - n)^2 / a + b."""
    return (travel_mm - n) ** 2 / a + b


def eq_2(position_mm, s_f1_mm, s_f2, gain_n_per_mm, t_f_n, level_max):
    """The friction cone line by line as printed, times the gain from position to force that the paper leaves out.

    P_pre is the previous P_curr_f, as the equation's fourth line sets it. The level is bounded, as any exponential must be. `t_f_n` is
    T_f_min, negative, and T_f_max.
    """
    force = numpy.zeros(len(position_mm))
    p_pre = position_mm[0]
    for tick, p_now in enumerate(position_mm):
        level = min(math.exp(p_now / s_f1_mm), level_max)
        p_curr = p_pre + (p_now - p_pre) * s_f2
        p_diff = (p_now - p_curr) * level * gain_n_per_mm
        p_pre = p_curr
        force[tick] = min(max(p_diff, t_f_n[0]), t_f_n[1])
    return force


def largest_drop(recording, rows, within_s=2e-3):
    """Where the force falls most within 2 ms: the tick at which the fall begins."""
    width = round(within_s / TICK_S)
    force = recording.force_n[rows]
    fall = force[:-width] - numpy.minimum.reduce([force[k : len(force) - width + k] for k in range(1, width + 1)])
    steepest = int(numpy.argmax(fall))
    # The last tick before it: the highest within that window.
    return rows.start + steepest + int(numpy.argmax(force[steepest : steepest + width]))


def jog(device, report):
    injection = hand(["to_mm = 13.5\nspeed_mm_s = 5.0", "seconds = 0.5", "to_mm = -1.0\nspeed_mm_s = 5.0"])
    for skin_a, base_n in ((9.0, 0.0), (7.0, 0.05)):
        recording = device.record(arm(skin_a, 4.0, base_n=base_n), injection, 8.0)
        depth, force = recording.depth_mm, recording.force_n
        rows = recording.way_in()
        pushing = numpy.flatnonzero((depth[rows] > 0.05) & (depth[rows] < 2.95))
        wanted = eq_1(depth[pushing], 0.0, skin_a, base_n)
        worst = numpy.abs(force[pushing] - wanted).max()
        report.within(f"eq. 1, skin, a = {skin_a:g} mm2/N, b = {base_n:g} N", worst, 2 * recording.force_step_n, "N")
        skin = slice(0, int(numpy.searchsorted(depth[rows], 6.0)))
        drop = largest_drop(recording, skin)
        report.within("eq. 1, critical force of the skin", force[drop] - eq_1(3.0, 0.0, skin_a, base_n), 0.015, "N")
        report.within("eq. 1, travel at which the skin gives way", depth[drop] - 3.0, 2 * recording.depth_step_mm, "mm")
        after = force[drop + 20]
        report.holds("eq. 1, after the critical force it falls by half or more", after < 0.5 * force[drop], f"{force[drop]:.3f} N, then {after:.3f} N")
    vein_stage(recording, report)


def vein_stage(recording, report):
    """The vessel's rise has eq. 1's form with the smaller a, on top of the muscle's friction."""
    depth, force = recording.depth_mm, recording.force_n
    rows = slice(int(numpy.searchsorted(depth[recording.way_in()], 9.0)), recording.way_in().stop)
    drop = largest_drop(recording, rows)
    rise = slice(drop - round(1.0 / 5.0 / TICK_S), drop)  # the last mm before the vessel gives way
    rise_force = lambda d, contact, a, b: eq_1(d, contact, a, b)
    (contact, a, b), _ = curve_fit(rise_force, depth[rise], force[rise], p0=(depth[drop] - 1.4, 5.0, 0.2))
    report.within("eq. 1, vessel: a fitted to its rise", a - 4.0, 0.4, "mm2/N")
    report.within("eq. 1, vessel: travel from contact to its giving way", depth[drop] - contact - 1.41, 0.1, "mm")
    report.holds("friction of the muscle lies under the vessel's rise", 0.1 < b < 0.3, f"{b:.3f} N")
    out = (depth < 6.0) & (depth > 3.0) & (numpy.arange(len(depth)) > recording.way_in().stop)
    report.holds("force on the way out is felt, in the other direction", force[out].mean() < -0.03, f"{force[out].mean():.3f} N")


def friction_cone(device, report):
    """Eq. 2 in a body of muscle alone, as printed: in, held, further in, out."""
    s_f1, cap, tau_ms, gain, limit, limit_out = 23.0, 2.0, 50.0, 0.25, 0.5, 0.2
    friction = (
        f'[friction]\nlaw = "paper"\nlevel_length_mm = {s_f1}\nlevel_cap = {cap}\nanchor_ms = {tau_ms:.0f}\n'
        f"stiffness_n_per_mm = {gain}\nlimit_n = {limit}\nlimit_out_n = {limit_out}\n"
    )
    muscle = '[[layer]]\ntissue = "muscle"\ndepth_mm = 0.0\nfriction_n_per_mm = 0.02\n'
    body = f'format = 1\nname = "independent"\nentry_deg = 90.0\n{friction}{muscle}'
    steps = ["to_mm = 12.0\nspeed_mm_s = 20.0", "seconds = 0.5", "to_mm = 24.0\nspeed_mm_s = 60.0", "seconds = 0.4",
             "to_mm = 10.0\nspeed_mm_s = 40.0", "to_mm = -1.0\nspeed_mm_s = 20.0"]  # fmt: skip
    # The hold before the needle is drawn back matters: where the anchor still pushes it out, the device gives less than the equation,
    # because it never gives back more energy than the hand put in.
    recording = device.record(body, hand(steps), 4.0)
    rows = recording.inside()
    # S_f2 is dimensionless per tick; a first-order follower of 50 ms has this one.
    wanted = eq_2(recording.depth_mm[rows], s_f1, 1.0 - math.exp(-TICK_S * 1e3 / tau_ms), gain, (-limit_out, limit), cap)
    # The paper does not say where the anchor is when the tip arrives; it has followed after 5 time constants.
    difference = numpy.abs(recording.force_n[rows] - wanted)[round(5 * tau_ms * 1e-3 / TICK_S) :]
    report.within("eq. 2 as printed: in, held, in, out", difference.max(), 0.005, "N")
    report.holds("eq. 2 as printed: the run reaches more than half of its limit", wanted.max() > 0.25, f"{wanted.max():.3f} N")
    report.within("eq. 2, T_f_min: the least force on the way out", recording.force_n[rows].min() + limit_out, 0.005, "N")


def check(device, report):
    jog(device, report)
    friction_cone(device, report)
