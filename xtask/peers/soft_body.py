"""MuJoCo's deformable body on a lattice of as many particles (17 x 17 x 17 = 4,913 in tetrahedra, linear elasticity), as the
peer of `xpbd_step_ms`: one step of 1/120 s, the substep of the tissue picture, on one core, twice for a picture."""

import statistics
import time

import mujoco

MODEL = """
<mujoco>
  <option timestep="0.00833" solver="CG" iterations="10" tolerance="1e-6" integrator="discrete"/>
  <size memory="1G"/>
  <worldbody>
    <flexcomp type="grid" dim="3" count="17 17 17" spacing="0.0013 0.0013 0.0013" pos="0 0 0" radius="0.0003"
              name="tissue" mass="0.5" rgba="1 .8 .7 1">
      <elasticity young="2e4" poisson="0.3" damping="0.01"/>
      <contact selfcollide="none" contype="0" conaffinity="0"/>
      <pin gridrange="0 0 0 16 16 0"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def main():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    times = []
    for _ in range(12):
        begin = time.perf_counter()
        for _ in range(2):
            mujoco.mj_step(model, data)
        times.append(1e3 * (time.perf_counter() - begin))
    print(f"xpbd_step_ms.peer=MuJoCo-{mujoco.__version__}-flex xpbd_step_ms.peer_value={statistics.median(times):.3f}")


main()
