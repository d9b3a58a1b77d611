"""Runs an exported rig in MuJoCo and compares its motion with host-sim's own: within 1 % of the travel.

python mujoco_rig.py PROGRAM, where PROGRAM is the built host-sim. Needs mujoco (see xtask/src/test.rs for the version).
"""

import csv
import functools
import json
import math
import subprocess
import sys
import tempfile
import types
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


# Somebody's model: an elbow behind a shoulder that is not patched, with defaults, a comment and spacing of its own.
THEIRS = """<mujoco model='theirs'>
  <compiler angle="degree"/>  <!-- <joint name="elbow"/> is below -->
  <option timestep="0.0005" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/><default class="geared"><joint armature="0.002" damping="0.3"/><motor gear="5 0 0 0 0 0"/></default></default>
  <worldbody>
    <body name="base">
      <body name="upper">
        <joint name="shoulder"   axis="0 1 0" range="-90 90"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass="1"/>
      </body>
      <body name="fore" pos="0 0 -.3" childclass="geared">
        <joint name='elbow' axis="0 1 0" />
        <geom type="capsule" fromto="0 0 0 0 0 -.25" size=".02" mass=".4"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="a" joint="shoulder"/>
    <motor  class="geared" name="b" joint="elbow" ctrlrange="-9 9"/>
  </actuator>
</mujoco>
"""

NOMINAL = """format = 1
name = "elbow"
kind = "rotary"
[model]
inertia = {inertia:.9e}
viscous = 0.3
[actuator]
gain = 5.0
command_unit = "A"
[encoder]
counts_per_unit = 1e5
"""

PATCHED = """format = 1
name = "elbow"
kind = "rotary"
[model]
inertia = {more:.9e}
viscous = 0.2
coulomb = 0.15
offset = 0.05
[actuator]
gain = 4.5
command_unit = "A"
limit = 0.2
[encoder]
counts_per_unit = 1e5
[[effect]]
name = "command_delay"
shape = {{ delay = 0.004 }}
[[effect]]
name = "position_spring"
shape = {{ from = 0.3 }}
coefficients = {{ stiffness = 0.4 }}
"""

ELBOW = """format = 1
name = "elbow"
kind = "rotary"
[model]
inertia = {inertia:.9e}
viscous = 0.3
coulomb = 0.15
[actuator]
gain = 5.0
command_unit = "A"
[encoder]
counts_per_unit = 1e5
[[effect]]
"""

# The law of a gap is that of both masses, 1 / inertia and dry friction / inertia of the whole.
GAP = ELBOW + """name = "backlash"
shape = {{ gap = 0.01, contact_hz = 60.0, ratio = 5.0, coast = {coast:.9e}, dry = {dry:.9e}, viscous = {damping:.9e}, per_command = {force:.9e} }}
coefficients = {{ inertia_ratio = 5.0 }}
"""


# Bristles that bend before they slide, friction that falls with speed, and cogging: a `dcmotor` without a winding.
LUGRE = ELBOW + """name = "{name}"
shape = {{ {shape} }}
coefficients = {{ {coefficients} }}
"""
OF_A_MOTOR = [
    ("presliding_friction", "deflection = 0.02", "coulomb = 0.12, damping = 0.002"),
    ("stribeck_friction", "speed = 0.5, exponent = 2.0", "peak = 0.05"),
    ("cogging", "turn = 6.283185307179586, order_7 = 7.0, order_12 = 12.0", "cos_7 = 0.05, sin_7 = 0.08, cos_12 = 0.0, sin_12 = -0.04"),
]


def current(t):
    return 0.09 * math.sin(2 * math.pi * 0.9 * t) + 0.16 * math.sin(2 * math.pi * 0.41 * t)


def simulated(program, nominal, patched, folder, options, recorded=lambda i: 1 - math.cos(i * 1e-3)):
    """The patched motion by host-sim, its first speed, and the recording's step; `recorded` is the motion of the recording, by its rows."""
    rows, step = 4000, 1e-3
    with (folder / "recording.csv").open("w") as file:
        file.write("time_s,command,position_counts\n")
        for i in range(rows):
            file.write(f"{i * step:.4f},{current(i * step):.9f},{round(1e5 * recorded(i))}\n")
    (folder / "nominal-rig.toml").write_text(nominal)
    (folder / "patched-rig.toml").write_text(patched)
    subprocess.run(
        [program, "simulate", "--rig", folder / "patched-rig.toml", "--recording", folder / "recording.csv", *options, "--out", folder / "out"],
        check=True, stdout=subprocess.DEVNULL,
    )
    with (folder / "out/simulation.csv").open() as file:
        read = list(csv.DictReader(file))
    return [float(row["position_patched"]) for row in read], float(read[0]["velocity_patched"]), step


def moved(model, joint, control, rows, speed, step, load=None):
    """MuJoCo's motion of a joint; the motor begins at the flank that pushes."""
    data = mujoco.MjData(model)
    data.joint(joint).qvel[0] = speed
    if load:
        data.joint(load).qvel[0] = speed
        data.joint(load).qpos[0] = -model.tendon_range[0][1]
    places = []
    for i in range(rows):
        places.append(data.joint(joint).qpos[0])
        control(data, float(f"{current(i * step):.9f}"))
        for _ in range(round(step / model.opt.timestep)):
            mujoco.mj_step(model, data)
    return places


def off(model, joint, control, motion, speed, step, load=None):
    """Largest distance between MuJoCo's motion of a joint and a motion, as a part of its travel."""
    places = moved(model, joint, control, len(motion), speed, step, load)
    return max(abs(a - b) for a, b in zip(places, motion)) / (max(motion) - min(motion))


def into(program, folder):
    """Their own model with its elbow patched moves as host-sim says, and the rest of the file is as it was."""
    theirs = folder / "theirs.xml"
    theirs.write_bytes(THEIRS.encode())
    model = mujoco.MjModel.from_xml_path(str(theirs))
    inertia = model.dof_M0[model.joint("elbow").dofadr[0]]
    nominal = NOMINAL.format(inertia=inertia)
    options = ["--export", "mjcf", "--into", theirs, "--joint", "elbow"]
    per = {"coast": 0.1 / inertia, "dry": 0.15 / inertia, "damping": 0.3 / inertia, "force": 5.0 / inertia}
    motors = [(f"{name} of a dcmotor", LUGRE.format(inertia=inertia, name=name, shape=shape, coefficients=values), "elbow", ["--dcmotor"])
              for name, shape, values in OF_A_MOTOR]
    for what, patched, drives, more in [
        ("one hinge", PATCHED.format(more=1.2 * inertia), "elbow", []),
        ("a gap as two hinges", GAP.format(inertia=inertia, **per), "elbow_motor", []),
        *motors,
    ]:
        motion, speed, step = simulated(program, nominal, patched, folder, options + more)
        assert theirs.read_bytes() == THEIRS.encode(), "their file was changed"
        text = (folder / "theirs-patched.xml").read_bytes().decode()
        assert bool(more) == ("<dcmotor" in text), text
        changed = ["'elbow'", 'joint="elbow"', "</actuator>"]
        kept = [line for line in THEIRS.splitlines() if not any(part in line for part in changed) and not line.startswith("</")]
        missing = [line for line in kept if line not in text]
        assert not missing or drives != "elbow" and missing == ["  </worldbody>"], missing
        model = mujoco.MjModel.from_xml_string(text)
        shoulder = model.joint("shoulder").dofadr[0]
        assert model.dof_damping[shoulder] == 0 and model.dof_frictionloss[shoulder] == 0

        def control(data, command):
            data.actuator("b").ctrl = command

        if "cogging" in what:
            # host-sim finds the phase of a wave in the recording, which has to be of this joint.
            places = moved(model, drives, control, len(motion), 0.0, step)
            motion, speed, step = simulated(program, nominal, patched, folder, options + more, places.__getitem__)
        share = off(model, drives, control, motion, speed, step, "elbow" if drives != "elbow" else None)
        print(f"into their model, {what}: {100 * share:.2f} % of the travel off")
        assert share < 0.01, f"{what}: {100 * share:.2f} %"


def isaac_lab(program, folder):
    """The settings for Isaac Lab, read by a stand-in for its class and put into MuJoCo, move as host-sim says."""
    nominal = NOMINAL.format(inertia=0.02)
    motion, speed, step = simulated(program, nominal, nominal.replace("viscous = 0.3", "viscous = 0.2\ncoulomb = 0.1"), folder, ["--export", "isaaclab"])
    actuators = types.ModuleType("isaaclab.actuators")
    actuators.DelayedPDActuatorCfg = functools.partial(types.SimpleNamespace)
    sys.modules.update({"isaaclab": types.ModuleType("isaaclab"), "isaaclab.actuators": actuators})
    settings = {}
    exec((folder / "out/patched_rig_isaaclab.py").read_text(), settings)
    one = settings["actuator"]("elbow", dt=5e-4, links_inertia=0.005)
    assert one.joint_names_expr == ["elbow"] and one.min_delay == one.max_delay == 0 and one.effort_limit is None
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.0005" gravity="0 0 0" integrator="implicitfast"/><worldbody><body>
      <joint name="elbow" axis="0 0 1" armature="{one.armature}" damping="{one.viscous_friction}" frictionloss="{one.dynamic_friction}"
        solreffriction="0.001 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/><inertial pos="0 0 0" mass="1" diaginertia="0.005 0.005 0.005"/>
      </body></worldbody></mujoco>""")

    def control(data, command):
        data.qfrc_applied[0] = settings["FORCE_PER_COMMAND"] * command + settings["FORCE_THAT_IS_ALWAYS_THERE"]

    share = off(model, "elbow", control, motion, speed, step)
    print(f"Isaac Lab's settings: {100 * share:.2f} % of the travel off")
    assert share < 0.01, f"{100 * share:.2f} %"


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
    for check in [into, isaac_lab]:
        with tempfile.TemporaryDirectory() as folder:
            check(sys.argv[1], Path(folder))


main()
