"""MuJoCo's rollout of an axis like the device's (a roller with dry friction and damping, a needle in its grip by a soft
equality, a spring for the hand), as the peer of `plant_core_ticks_per_s`: one step of 100 us for each tick, on one core. Ours
takes ten steps of 10 us for each tick, and the control law."""

import statistics
import time

import mujoco
import numpy as np
from mujoco import rollout

MODEL = """
<mujoco>
  <option timestep="0.0001" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body name="roller"><joint name="roller" type="hinge" axis="0 1 0" damping="1.2e-6" frictionloss="4e-4" armature="1.4e-6"/>
      <inertial pos="0 0 0" mass="0.001" diaginertia="1e-9 1e-9 1e-9"/></body>
    <body name="needle"><joint name="needle" type="slide" axis="1 0 0" stiffness="300" damping="2"/>
      <inertial pos="0 0 0" mass="0.01" diaginertia="1e-8 1e-8 1e-8"/></body>
  </worldbody>
  <equality><joint joint1="needle" joint2="roller" polycoef="0 0.01 0 0 0" solref="0.001 1"/></equality>
  <actuator><motor joint="roller"/></actuator>
</mujoco>
"""
STEPS, RUNS = 20_000, 5


def main():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    control = 2e-3 * np.sin(np.arange(STEPS) * 1e-3).reshape(1, STEPS, 1)
    rates = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        rollout.rollout(model, data, state, control)
        rates.append(STEPS / (time.perf_counter() - begin))
    row = "plant_core_ticks_per_s"
    print(f"{row}.peer=MuJoCo-{mujoco.__version__}-rollout {row}.peer_value={statistics.median(rates):.0f}")


main()
