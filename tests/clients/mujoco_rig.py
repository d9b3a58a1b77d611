"""Runs an exported rig in MuJoCo and compares its motion with host-sim's own: within 1 % of the travel.

python mujoco_rig.py PROGRAM, where PROGRAM is the built host-sim. Needs mujoco (see xtask/src/test.rs for the version).
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco

ROTARY = """format = 1
name = "exported, a roller"
kind = "rotary"
[model]
inertia = 2.4e-6
viscous = 4.0e-6
coulomb = 4.0e-4
offset = 5.0e-5
[actuator]
gain = 0.0234
command_unit = "A"
limit = 0.12
delay_s = 0.001
lag_s = 0.002
[encoder]
counts_per_unit = 636.6197724
[[effect]]
name = "command_delay"
shape = { delay = 0.004 }
[[effect]]
name = "electrical_lag"
shape = { time_constant = 0.003 }
[[effect]]
name = "position_spring"
shape = { from = 0.5 }
coefficients = { stiffness = 2.0e-4 }
"""

LINEAR = """format = 1
name = "exported, a slide"
kind = "linear"
[model]
inertia = 95.1
viscous = 210.0
[actuator]
gain = 35.15
command_unit = "V"
limit = 10.0
[encoder]
counts_per_unit = 2.0e7
[[effect]]
name = "coulomb_friction"
coefficients = { coulomb = 20.1 }
[[effect]]
name = "asymmetric_friction"
coefficients = { coulomb_difference = 1.5 }
"""


def command(kind, t):
    """A command that pushes to and fro and lets go in between."""
    if kind == "rotary":
        return 0.05 * math.sin(2 * math.pi * 1.3 * t) + 0.09 * math.sin(2 * math.pi * 0.37 * t) if t % 3 < 2.4 else 0.0
    return 2.5 * math.sin(2 * math.pi * 0.5 * t) if t % 4 < 3 else 0.3


def compare(program, kind, rig, folder):
    # What was recorded does not matter here, but for its size: a simulation that runs far away from it is cut off.
    counts = 1e4 if kind == "rotary" else 1e7
    rows, step = 8000, 1e-3
    recording = folder / "recording.csv"
    with recording.open("w") as file:
        file.write("time_s,command,position_counts\n")
        for i in range(rows):
            file.write(f"{i * step:.4f},{command(kind, i * step):.9f},{round(counts * (1 - math.cos(i * step)))}\n")
    (folder / "rig.toml").write_text(rig)
    subprocess.run(
        [program, "simulate", "--rig", folder / "rig.toml", "--recording", recording, "--export", "mjcf", "--export", "urdf",
         "--export", "json", "--out", folder / "out"],
        check=True, stdout=subprocess.DEVNULL,
    )
    with (folder / "out/simulation.csv").open() as file:
        ours = [float(row["position_nominal"]) for row in csv.DictReader(file)]
        file.seek(0)
        speed = float(next(csv.DictReader(file))["velocity_nominal"])
    model = mujoco.MjModel.from_xml_path(str(folder / "out/patched-rig.xml"))
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    steps = round(step / model.opt.timestep)
    worst = 0.0
    for i in range(rows):
        worst = max(worst, abs(data.qpos[0] - ours[i]))
        data.ctrl[0] = float(f"{command(kind, i * step):.9f}")
        for _ in range(steps):
            mujoco.mj_step(model, data)
    travel = max(ours) - min(ours)
    share = worst / travel
    print(f"{kind}: MuJoCo {mujoco.__version__} is at most {worst:.3g} off over a travel of {travel:.3g}: {100 * share:.2f} %")
    assert share < 0.01, f"{kind}: {100 * share:.2f} % of the travel"
    same_joint(folder / "out", kind)


def same_joint(out, kind):
    """The URDF, as MuJoCo reads it, and the JSON say of the joint what the MJCF says."""
    said = json.loads((out / "patched-rig.json").read_text())["joint"]
    for file in ["patched-rig.xml", "patched-rig.urdf"]:
        model = mujoco.MjModel.from_xml_path(str(out / file))
        for field, key in [("dof_M0", "inertia"), ("dof_damping", "damping"), ("dof_frictionloss", "frictionloss")]:
            value = getattr(model, field)[0]
            assert math.isclose(value, said[key], rel_tol=1e-6), f"{kind}: {file} has {key} {value}, the JSON {said[key]}"


def main():
    for kind, rig in [("rotary", ROTARY), ("linear", LINEAR)]:
        with tempfile.TemporaryDirectory() as folder:
            compare(sys.argv[1], kind, rig, Path(folder))


main()
