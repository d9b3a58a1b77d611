"""Concealed plants for `host-sim settle`, with a key: does the loop of experiment and diagnosis end at the right name?

    python3 settle_plants.py --rig rig.toml --seed N --count K --out DIR

writes DIR/plant-000.toml and so on, and DIR/key.json. The author knew the formats of `docs/guide/diagnosis.md` and of the
contracts, and read nothing of the experiment, the laboratory, the proof or the diagnosis: how the experiments are designed,
which laws are fitted and how sizes are drawn there is unknown here. Never give the tool the key.

Kinds, in every 12 plants: 6 twins (one of two effects that are easily confused), 2 singles, 2 pairs that act in different
places, 1 null (only values are off), 1 outside (a force that no law of the library resembles). Inertia, friction and gain are
normal about the rig's, with a third (friction: a quarter) of the stated uncertainty, cut at two standard deviations.
A plain wrong gain is 15 to 25 % off, and nothing may be named there.

Laws. What can be a formula is a formula of this file, from the literature, with directions smoothed by tanh(v/0.05 rad/s);
what has a memory, and the encoder's eccentricity, takes the library's name. Their numbers mean this, found by comparing
steps of `host-sim simulate` with the simulation here, not by reading it: `inertia_ratio` of a compliance is load over motor,
that of a backlash the same times the gain; both frequencies are those of the reduced mass; `gap` is the full width; friction
is shared like the inertia, except that a load in a gap slows down by `coast` rad/s²; `coulomb` of the bristles (Dahl's law) is
the part of the dry friction that they carry, and their `damping` is force per speed times the deflection. In formulas a
minus binds before a power, exp(-(x^2)), and numbers have no exponent.

Strength. The unit is the force that whole counts look like below 50 Hz at 10 kHz. A count of d rad is white noise of variance
d²/12 over 5 kHz; the inertia J times its second derivative has, below B = 50 Hz, a root mean square of
J·d/√12·(2π)²·√(B⁵/(5·5000)). For 4000 counts a turn and J = 1.4e-6 kg·m² that is 2.8e-6 N·m (1.1 to 2.1e-6 when the motion
below is rounded to counts), 0.7 % of the dry friction of 4e-4 N·m: the device is quiet. The unit is therefore at least 5 % of
the dry friction, 2e-5 N·m for this rig. Strengths are drawn log-uniformly from 1 to 3 units.
The force of an effect is g = J·a − gain·u + viscous·v + dry·sgn(v), with the plant's values, along a reference motion of 21 s
in a position loop of 8 Hz: strokes of ±10 rad at 20, 8 and 3 rad/s, a ladder of reversals, and a multisine of a third of the
dry friction added. It is low-passed at 50 Hz; rest (under 0.2 rad/s) is left out; what other values of gain, viscous and dry
friction absorb is taken off by least squares (the inertia is held, else zero times everything would fit). The strength is the
root mean square of the remainder over the unit; for a plain wrong gain, which would be absorbed entirely, before that refit.
Every effect is simulated in the loop, alone, and sized by a few secant steps to about 3 % (the eccentricity is scaled along
the motion). Delays and lags stay within 0.3 to 3 ms, other sizes within MOST and other limits below; where a limit
keeps an effect from its drawn strength, the key has the strength that it really has. The two effects of a pair are drawn
equally strong, and the key has the smaller strength. Nulls have 0.
"""

import argparse
import json
import math
import random
import tomllib
from pathlib import Path

import numpy as np

STEP_S, RAMP, STILL, BAND_HZ = 1e-4, 800.0, 0.2, 50.0
STROKES = ((10, 20), (-20, 20), (20, 20), (-20, 8), (20, 20), (-20, 20), (20, 8), (-20, 3), (10, 5))
LADDER = tuple((sign * size, 5.0) for size in (0.1, 0.2, 0.5, 1.0, 2.0) for sign in (1, -1, 1, -1))
SMOOTH = "tanh(v/0.05)"
PLACE = {
    "cogging": "actuator", "torque_ripple": "actuator", "command_deadband": "actuator", "command_saturation": "actuator",
    "command_delay": "actuator", "electrical_lag": "actuator", "gain_drift": "actuator",
    "asymmetric_friction": "transmission", "stribeck_friction": "transmission", "presliding_friction": "transmission",
    "quadratic_drag": "transmission", "friction_drift": "transmission", "backlash": "transmission",
    "drive_compliance": "transmission", "mass_imbalance": "load", "position_spring": "load", "encoder_eccentricity": "sensor",
}
TWINS = (
    ("command_delay", "electrical_lag"), ("presliding_friction", "backlash"), ("gain_drift", "friction_drift"),
    ("position_spring", "mass_imbalance"), ("quadratic_drag", "stribeck_friction"), ("encoder_eccentricity", "mass_imbalance"),
    ("command_saturation", "wrong_gain"), ("drive_compliance", "command_delay"),
)
SINGLES = ("cogging", "torque_ripple", "command_deadband", "asymmetric_friction")
OUTSIDE = ("eddy_brake", "critical_speed", "vibration", "rotating_field")
MOST = {"gain_drift": 0.5, "torque_ripple": 0.4, "friction_drift": 2.0, "asymmetric_friction": 0.6, "stribeck_friction": 2.0}
MEMORY = ("command_delay", "electrical_lag", "backlash", "drive_compliance", "presliding_friction")


def drive_strokes():
    """Returns the reference speed, in rad/s, of all strokes, with ramps of RAMP rad/s²."""
    speed = np.concatenate([np.full(round(abs(way) / rate / STEP_S), math.copysign(rate, way)) for way, rate in STROKES + LADDER])
    out, now, most = np.empty_like(speed), 0.0, RAMP * STEP_S
    for i, wanted in enumerate(speed.tolist()):
        now += min(max(wanted - now, -most), most)
        out[i] = now
    return out


def multisine(steps):
    """Returns twelve fixed lines between 0.7 and 40 Hz, root mean square one."""
    time, lines = np.arange(steps) * STEP_S, np.geomspace(0.7, 40.0, 12)
    return sum(np.sin(2 * np.pi * hz * time + 2.4 * k * k) for k, hz in enumerate(lines)) / math.sqrt(6.0)


def counts_noise(rig):
    """Returns the force below BAND_HZ that whole counts cause, in N·m; the module's text derives it."""
    count = 1.0 / rig["encoder"]["counts_per_unit"]
    return rig["model"]["inertia"] * count / math.sqrt(12) * (2 * math.pi) ** 2 * math.sqrt(BAND_HZ**5 * 2 * STEP_S / 5)


def low_pass(columns):
    """Returns columns of samples through a fourth-order Butterworth magnitude at BAND_HZ, without phase."""
    hz = np.fft.rfftfreq(len(columns), STEP_S)[:, None]
    return np.fft.irfft(np.fft.rfft(columns, axis=0) / np.sqrt(1 + (hz / BAND_HZ) ** 8), len(columns), axis=0)


class Bench:
    """The loop and the reference motion around one plant's true values (`true`), as the rig's author would drive it."""

    def __init__(self, rig, true):
        nominal = rig["model"]
        self.true, self.limit, self.gain = true, rig["actuator"].get("limit", 1e9), rig["actuator"]["gain"]
        self.unit = max(counts_noise(rig), 0.05 * nominal["coulomb"])
        speed = drive_strokes()
        self.speed, self.way = speed.tolist(), (np.cumsum(speed) * STEP_S).tolist()
        ahead = nominal["inertia"] * np.gradient(speed, STEP_S) + nominal["viscous"] * speed
        ahead += nominal["coulomb"] * (np.sign(speed) + multisine(len(speed)) / 3)
        self.ahead, pole = ahead.tolist(), 2 * math.pi * 8.0
        self.stiff, self.damp = nominal["inertia"] * pole**2, nominal["inertia"] * 1.4 * pole
        self.time = np.arange(len(speed)) * STEP_S
        self.motion = self.run({})

    def run(self, law):
        """Simulates the loop with the law of one effect, none if empty; returns position, speed and command at every step."""
        true, load = self.true, law.get("load", 0.0)
        share = load / (1 + load)
        motor, far = true["inertia"] * (1 - share), max(true["inertia"] * share, 1e-30)
        far_dry = law["coast"] * far if "coast" in law else true["coulomb"] * share
        dry, bristle = true["coulomb"] - far_dry - law.get("bristle", 0.0), law.get("bristle", 0.0)
        viscous, far_viscous = true["viscous"] * (1 - share), true["viscous"] * share
        half, stiff, damp = law.get("gap", 0.0) / 2, law.get("stiff", 0.0), law.get("damp", 0.0)
        bend, ease, push = law.get("deflection", 1.0), law.get("ease", 0.0), law.get("push")
        late, keep = law.get("delay", 0.0) / STEP_S, math.exp(-STEP_S / law["time_constant"]) if "time_constant" in law else 0.0
        whole, part = int(late), late - int(late)
        queue, held, z = [0.0] * (whole + 2), 0.0, 0.0
        q = v = far_q = far_v = 0.0
        record, h = [], STEP_S
        for way, speed, ahead in zip(self.way, self.speed, self.ahead):
            u = round((ahead + self.stiff * (way - q) + self.damp * (speed - v)) / self.gain)
            u = min(max(u, -self.limit), self.limit)
            record.append((q, v, u))
            queue.insert(0, u)
            queue.pop()
            held = keep * held + (1 - keep) * ((1 - part) * queue[whole] + part * queue[whole + 1])
            force = true["gain"] * held - viscous * v
            if push:
                force += push(q, v, u, len(record) * h)
            if load:
                bent = q - far_q
                over = bent - min(max(bent, -half), half)
                joint = stiff * over + damp * (v - far_v) if over or not half else 0.0
                joint = joint if not half or joint * over > 0 else 0.0
                force -= joint
                far_v += h * (joint - far_viscous * far_v) / far
                far_v = math.copysign(max(abs(far_v) - h * far_dry / far, 0.0), far_v)
                far_q += h * far_v
            if bristle:
                before, z = z, (z + h * v) / (1 + h * abs(v) / bend)
                force -= bristle * z / bend + ease * (z - before) / h
            v += h * force / motor
            v = math.copysign(max(abs(v) - h * dry / motor, 0.0), v)
            q += h * v
        return np.array(record).T

    def residual(self, motion):
        """Returns the strength, in units, of what a simulated motion leaves of the true plant without its effect."""
        _, v, u = motion
        true, ahead = self.true, np.append(v[1:], v[-1])
        middle = (v + ahead) / 2
        sign = np.where(v * ahead >= 0, np.sign(middle), middle / (np.abs(v) + np.abs(ahead) + 1e-12) * 2)
        left = true["inertia"] * (ahead - v) / STEP_S - true["gain"] * u + true["viscous"] * middle + true["coulomb"] * sign
        return self.strength(left, motion)

    def strength(self, force, motion=None, before_refit=False):
        """Returns a force's root mean square over the unit: below BAND_HZ, moving, after a refit of all but the inertia."""
        _, v, u = self.motion if motion is None else motion
        moving = np.abs(v) > STILL
        columns = low_pass(np.stack([np.where(moving, x, 0.0) for x in (force, u, v, np.sign(v))], axis=1))[moving][::10]
        target, terms = columns[:, 0], columns[:, 1:]
        if not before_refit:
            target = target - terms @ np.linalg.lstsq(terms, target, rcond=None)[0]
        return float(np.sqrt(np.mean(target**2))) / self.unit


def compiled(text, library, **names):
    """Returns a formula as a function of q, v, u and t, on the functions of `math` or of `numpy`."""
    known = {"abs": abs, "__builtins__": {}, "sin": library.sin, "exp": library.exp, "tanh": library.tanh, **names}
    return eval("lambda q, v, u, t: " + text.replace("^", "**"), known)


def solve(strength_of, low, high, wanted, tries):
    """Returns the size in [low, high] that has the wanted strength, and its strength; strengths grow with the size."""
    ends = [(math.log(x), strength_of(x)) for x in (low, high)]
    if not ends[0][1] < wanted < ends[1][1]:
        at, has = ends[0] if wanted <= ends[0][1] else ends[1]
        return math.exp(at), has
    for i in range(tries):
        (a, fa), (b, fb) = ends
        slope = (math.log(wanted) - math.log(fa + 1e-9)) / (math.log(fb) - math.log(fa + 1e-9))
        at = a + (b - a) * (min(max(slope, 0.1), 0.9) if i % 3 < 2 else 0.5)
        has = strength_of(math.exp(at))
        if abs(has / wanted - 1) < 0.03:
            break
        ends[has > wanted] = (at, has)
    return math.exp(at), has


def harmonics(rng, base, most):
    """Returns the text of a sum of harmonics of the angle, each with a phase and about half of the one before."""
    orders = range(1, rng.randint(2, most) + 1)
    parts = [f"{rng.uniform(1.4, 2.6) / 2**k:.3f}*sin({base * k}*q + {rng.uniform(0, 6.283):.3f})" for k in orders]
    return "(" + " + ".join(parts) + ")"


def scaled_formula(rng, name, true):
    """Returns the formula of a law whose force is proportional to its coefficient `a`."""
    phase, tau = round(rng.uniform(0, 6.283), 3), round(rng.uniform(2, 8), 2)
    fluid = rng.uniform(0.1, 1.0) * true["viscous"] / true["coulomb"]
    if name == "stribeck_friction":
        x = f"(abs(v)/{round(math.exp(rng.uniform(math.log(1.0), math.log(5.0))), 3)})"
        fall = rng.choice((f"exp(-({x}^2))", f"exp(-{x})", f"1/(1 + {x}^2)"))  # Gaussian; Tustin; Hess and Soom
        return f"-a*{fall}*{SMOOTH}"
    if name == "asymmetric_friction":
        also = rng.choice(("", f" + {fluid:.6f}*abs(v)"))
        return f"{rng.choice(('', '-'))}a*({SMOOTH}^2{also})"
    if name == "friction_drift":
        return f"-a*({SMOOTH} + {fluid:.6f}*v)*exp(-t/{tau})"
    if name == "position_spring":
        x = f"(q - {round(rng.uniform(-3, 3), 3)})".replace("- -", "+ ")
        return rng.choice((f"-a*{x}", f"-a*25*tanh({x}/25)"))
    eddy, critical, wide = round(rng.uniform(5, 9), 2), round(rng.uniform(6.5, 9), 2), round(rng.uniform(1.2, 2.2), 2)
    hz, slow = round(rng.uniform(2.5, 8), 3), round(rng.uniform(0.05, 0.12), 4)
    order, turns = rng.choice((3, 5, 8)), round(rng.uniform(0.7, 3), 3)
    return {
        "gain_drift": f"-a*u*(1 - exp(-t/{tau}))",
        "mass_imbalance": f"-a*sin(q + {phase})",
        "quadratic_drag": "-a*v*abs(v)",
        "cogging": f"a*{harmonics(rng, rng.choice((6, 7, 9, 11, 12)), 3)}",
        "torque_ripple": f"a*u*{harmonics(rng, rng.choice((5, 7, 8, 10, 13)), 3)}",
        "eddy_brake": f"-a*2*(v/{eddy})/(1 + (v/{eddy})^2)",
        "critical_speed": f"-a*exp(-(((abs(v) - {critical})/{wide})^2))*{SMOOTH}",
        "vibration": f"a*(1 + 0.4*sin({2 * math.pi * slow:.5f}*t + {phase}))*sin({2 * math.pi * hz:.4f}*t)",
        "rotating_field": f"a*sin({order}*q - {2 * math.pi * turns:.4f}*t + {phase})",
    }[name]


def formula_effect(rng, name, bench, wanted):
    """Returns the block of an effect that is a formula, and its strength."""
    gain, (q, v, u) = bench.true["gain"], bench.motion
    if name in ("command_deadband", "command_saturation"):
        # Through abs, the command cut to ±w is (|u + w| − |u − w|)/2.
        dead, cut = name == "command_deadband", "(abs(u + w) - abs(u - w))/2"
        text, rest = f"-a*{cut}" if dead else f"-a*(u - {cut})", bench.true["coulomb"] / gain
        ends = (0.05 * rest, 1.5 * rest) if dead else (1 / float(np.abs(u).max()), 1 / (1.4 * rest))

        def has(x):
            push = compiled(text, math, a=gain, w=x if dead else 1 / x)
            return bench.residual(bench.run({"push": push}))

        size, strength = solve(has, *ends, wanted, 7)
        return block("formula", {"a": gain}, formula=text.replace("w", f"{size if dead else 1 / size:.4f}")), strength
    text = scaled_formula(rng, name, bench.true)
    size = wanted / bench.strength(compiled(text, np, a=1.0)(q, v, u, bench.time))
    most = MOST.get(name, math.inf) * (gain if name in ("gain_drift", "torque_ripple") else bench.true["coulomb"])
    for _ in range(4):
        tried = size = min(size, most)
        strength = bench.residual(bench.run({"push": compiled(text, math, a=size)}))
        if abs(strength / wanted - 1) < 0.03 or strength < wanted and size == most:
            break
        size *= wanted / strength
    return block("formula", {"a": tried}, formula=text), strength


def eccentricity(rng, bench, wanted):
    """Returns the block of an encoder off its centre, by at most 0.15 rad, and its strength."""
    q, v, _ = bench.motion
    phase = rng.uniform(0, 2 * math.pi)
    extra = v * np.cos(q + phase)  # the speed that an error of sin(q + phase) adds to the reading
    left = bench.true["inertia"] * np.gradient(extra, STEP_S) + bench.true["viscous"] * extra
    one = bench.strength(left)
    size = min(wanted / one, 0.15)
    parts = {"cos_1": size * math.sin(phase), "sin_1": size * math.cos(phase)}
    return block("encoder_eccentricity", parts, {"turn": 2 * math.pi}), size * one


def memory_effect(rng, name, bench, wanted):
    """Returns the block of an effect with a memory, sized by simulation within physical limits, and its strength."""
    true, inertia, gain = bench.true, bench.true["inertia"], bench.true["gain"]
    late = {"command_delay": "delay", "electrical_lag": "time_constant"}
    load, ratio = rng.uniform(0.4, 1.2), rng.uniform(0.3, 1.0)
    both = inertia * load / (1 + load) ** 2
    coast, contact = rng.uniform(0.5, 0.95) * true["coulomb"] / inertia, 2 * math.pi * rng.uniform(120, 200)

    def law(x):
        if name in late:
            return {late[name]: x}
        if name == "presliding_friction":
            return {"bristle": true["coulomb"], "deflection": x, "ease": ratio * math.sqrt(inertia * true["coulomb"] / x)}
        if name == "drive_compliance":
            pole = 2 * math.pi / x
            return {"load": load, "stiff": both * pole**2, "damp": 0.2 * ratio * both * pole}
        return {"load": load, "coast": coast, "gap": x, "stiff": both * contact**2, "damp": 2 * ratio * both * contact}

    low, high = {
        "command_delay": (3e-4, 3e-3), "electrical_lag": (3e-4, 3e-3), "backlash": (3e-3, 0.5),
        "presliding_friction": (2e-3, 0.25), "drive_compliance": (1 / 250, 1 / 8),
    }[name]
    size, has = solve(lambda x: bench.residual(bench.run(law(x))), low, high, wanted, 7)
    if name == "backlash":
        shape = {"gap": size, "coast": coast, "contact_hz": contact / (2 * math.pi), "ratio": ratio}
        shape |= {"dry": true["coulomb"] / inertia, "viscous": true["viscous"] / inertia, "per_command": gain / inertia}
        return block(name, {"inertia_ratio": load * gain}, shape), has
    if name == "presliding_friction":
        return block(name, {"coulomb": true["coulomb"], "damping": law(size)["ease"] * size}, {"deflection": size}), has
    if name == "drive_compliance":
        return block(name, {"inertia_ratio": load}, {"resonance_hz": 1 / size, "damping": 0.1 * ratio}), has
    return block(name, {}, {late[name]: size}), has


def block(name, coefficients, shape=None, formula=None):
    """Returns the text of one [[effect]] of a plant."""

    def table(values):
        return "{ " + ", ".join(f"{key} = {float(value)!r}" for key, value in values.items()) + " }"

    lines = ["", "[[effect]]", f'name = "{name}"']
    lines += [f'formula = "{formula}"'] if formula else [f"shape = {table(shape)}"]
    return "\n".join([*lines, f"coefficients = {table(coefficients)}", ""])


def effect(rng, name, bench, wanted):
    """Returns the block and the strength of one effect by its name."""
    if name in MEMORY:
        return memory_effect(rng, name, bench, wanted)
    return eccentricity(rng, bench, wanted) if name == "encoder_eccentricity" else formula_effect(rng, name, bench, wanted)


def plan(seed, count):
    """Returns (kind, laws) of every plant: a fixed proportion in every dozen, all members drawn evenly."""
    rng, decks = random.Random(f"plan {seed}"), {}

    def deal(deck, cards):
        if not decks.get(deck):
            decks[deck] = rng.sample(cards, len(cards))
        return decks[deck].pop()

    apart = [(a, b) for a in PLACE for b in PLACE if PLACE[a] != PLACE[b] and not any({a, b} <= set(twins) for twins in TWINS)]
    plants = []
    while len(plants) < count:
        dozen = ["twins"] * 6 + ["singles"] * 2 + ["pairs"] * 2 + ["nulls", "outside"]
        for kind in rng.sample(dozen, len(dozen)):
            if kind == "twins":
                twins = deal("twins", TWINS)
                plants.append((kind, (deal(str(twins), twins),)))
            elif kind == "pairs":
                plants.append((kind, rng.choice(apart)))
            else:
                plants.append((kind, (deal(kind, SINGLES if kind == "singles" else OUTSIDE),) if kind != "nulls" else ()))
    return plants[:count]


def true_values(rng, rig):
    """Returns the plant's own inertia, friction and gain."""
    nominal = {**rig["model"], "gain": rig["actuator"]["gain"]}
    wide = {"inertia": 1 / 3, "viscous": 1 / 4, "coulomb": 1 / 4, "gain": 1 / 3}
    off = {key: min(max(rng.gauss(0, 1), -2), 2) * part * rig["uncertainty"][key] for key, part in wide.items()}
    return {key: nominal[key] * (1 + off[key]) for key in wide}


def plant(seed, index, kind, laws, rig):
    """Returns the text of a plant, the names that may be given for it, and its strength."""
    rng = random.Random(f"plant {seed} {index}")
    true, wanted = true_values(rng, rig), math.exp(rng.uniform(0, math.log(3)))
    blocks, strength = "", 0.0
    if laws == ("wrong_gain",):
        right = rig["actuator"]["gain"]
        true["gain"] = right * (1 + rng.choice((1, -1)) * rng.uniform(0.15, 0.25))
        bench = Bench(rig, true)
        strength = bench.strength((true["gain"] - right) * bench.motion[2], before_refit=True)
    elif laws:
        bench = Bench(rig, true)
        parts = [effect(rng, law, bench, wanted) for law in laws]
        blocks, strength = "".join(text for text, _ in parts), min(has for _, has in parts)
    encoder = "\n".join(f"{key} = {json.dumps(value)}" for key, value in rig["encoder"].items())
    text = f'format = 1\nname = "a mechanism"\nkind = "{rig["kind"]}"\n\n[model]\n'
    text += "".join(f"{key} = {true[key]!r}\n" for key in ("inertia", "viscous", "coulomb"))
    text += f'\n[actuator]\ngain = {true["gain"]!r}\ncommand_unit = "{rig["actuator"]["command_unit"]}"\n'
    text += f"limit = {rig['actuator']['limit']!r}\n" if "limit" in rig["actuator"] else ""
    return text + f"\n[encoder]\n{encoder}\n{blocks}", [law for law in laws if law in PLACE], strength


def main():
    """Writes the plants and their key."""
    parser = argparse.ArgumentParser(description="Concealed plants for host-sim settle, and their key.")
    for name, kind in (("rig", Path), ("seed", int), ("count", int), ("out", Path)):
        parser.add_argument(f"--{name}", required=True, type=kind)
    asked = parser.parse_args()
    rig, plants = tomllib.loads(asked.rig.read_text()), []
    asked.out.mkdir(parents=True, exist_ok=True)
    for index, (kind, laws) in enumerate(plan(asked.seed, asked.count)):
        text, names, strength = plant(asked.seed, index, kind, laws, rig)
        file = f"plant-{index:03}.toml"
        (asked.out / file).write_text(text)
        plants.append({"file": file, "kind": kind, "names": names, "strength": round(strength, 3)})
    (asked.out / "key.json").write_text(json.dumps({"seed": asked.seed, "plants": plants}, indent=1) + "\n")


if __name__ == "__main__":
    main()
