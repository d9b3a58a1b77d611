"""Makes recordings with the virtual device and reads them as a stranger would: the exported CSV and rig.toml, nothing else.

Forces are in N and resist insertion where positive; depths are in mm along the needle, from the skin.
"""

import json
import math
import pathlib
import subprocess
import tomllib

import numpy

TICK_S = 1e-4


class Recording:
    """One run of the virtual device: a row per tick of 0.1 ms."""

    def __init__(self, rig, rows):
        radius_mm = 1.0 / (2.0 * math.pi) * rig["encoder"]["turn"] * 10.0  # the device's roller: 10 mm
        counts_per_mm = rig["encoder"]["counts_per_unit"] / radius_mm
        self.time_s = rows[:, 0]
        # The command times the gain is the motor's torque, which pushes the needle in where positive.
        self.force_n = -rows[:, 1] * rig["actuator"]["gain"] / (radius_mm * 1e-3)
        self.depth_mm = rows[:, 2] / counts_per_mm
        self.tilt_rad = rows[:, 3]
        self.state = rows[:, 4].astype(int)
        self.force_step_n = rig["actuator"]["gain"] / (radius_mm * 1e-3)
        self.depth_step_mm = 1.0 / counts_per_mm
        self.score = None

    def between(self, begin_s, end_s):
        """The rows of a span of time, as a slice."""
        return slice(*numpy.searchsorted(self.time_s, [begin_s, end_s]))

    def inside(self, from_mm=0.0):
        """The rows of the first stretch deeper than `from_mm`."""
        deeper = self.depth_mm > from_mm
        begin = int(numpy.argmax(deeper))
        length = int(numpy.argmin(deeper[begin:]))
        return slice(begin, begin + length if length else len(deeper))

    def way_in(self):
        """The rows up to the deepest place."""
        return slice(0, int(numpy.argmax(self.depth_mm)))


class Device:
    """The program under test, and a folder for what it writes."""

    def __init__(self, program, folder):
        self.program, self.folder, self.count = program, pathlib.Path(folder), 0

    def _run(self, *arguments):
        command = [self.program, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
        return done.stdout

    def diagnose(self, rig, fits, holdout):
        """Diagnoses files of the folder; the report, as read from `diagnosis.json`."""
        fitted = [argument for file in fits for argument in ("--fit", self.folder / file)]
        out = self.folder / "report"
        self._run("diagnose", "--rig", self.folder / rig, *fitted, "--holdout", self.folder / holdout, "--out", out)
        return json.loads((out / "diagnosis.json").read_text())

    def record(self, patient, hand, seconds, angle_deg=None):
        """Records `seconds` of a patient, given as the text of a profile, under the hand of a procedure, given likewise."""
        self.count += 1
        stem = self.folder / f"{self.count:02}"
        stem.mkdir()
        (stem / "patient.toml").write_text(patient)
        (stem / "hand.toml").write_text(hand)
        angle = [] if angle_deg is None else ["--angle", angle_deg]
        self._run("run", "--headless", "--fast", "--seconds", seconds, "--profile", stem / "patient.toml",
                  "--procedure", stem / "hand.toml", "--record", stem / "a.mcap", *angle)  # fmt: skip
        self._run("export", stem / "a.mcap", "--out", stem / "csv")
        rig = tomllib.loads((stem / "csv" / "rig.toml").read_text())
        rows = numpy.loadtxt(stem / "csv" / "recording.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2, 3, 4))
        recording = Recording(rig, rows)
        recording.score = json.loads(self._run("score", stem / "a.mcap", "--json"))["insertions"]
        return recording


def way_between_counts(depth_mm):
    """The needle's way as straight lines between the ticks at which the encoder steps, where the true depth is between two counts."""
    steps = numpy.flatnonzero(numpy.diff(depth_mm)) + 1
    ticks = numpy.concatenate([[0], steps, [len(depth_mm) - 1]])
    middles = 0.5 * (depth_mm[steps - 1] + depth_mm[steps])
    return numpy.interp(numpy.arange(len(depth_mm)), ticks, numpy.concatenate([depth_mm[:1], middles, depth_mm[-1:]]))


class Report:
    """Prints a line per check and counts the failures."""

    def __init__(self):
        self.failures = 0

    def within(self, what, found, allowed, unit):
        """Passes where `found`, a difference, is at most `allowed`."""
        ok = bool(numpy.isfinite(found)) and abs(found) <= allowed
        self.failures += not ok
        print(f"{'pass' if ok else 'FAIL'}  {what}: differs by {found:.4g} {unit}, allowed {allowed:g}", flush=True)

    def holds(self, what, ok, seen):
        """Passes where `ok`; `seen` is what was found."""
        self.failures += not ok
        print(f"{'pass' if ok else 'FAIL'}  {what}: {seen}", flush=True)


def hand(steps, start_mm=-1.0, entry_deg=None, tremor_mm=0.0):
    """The text of a procedure by a stage, which trembles only where it is told to; `steps` are tables of TOML."""
    entry = "" if entry_deg is None else f"entry_deg = {float(entry_deg)}\n"
    text = f'format = 1\nname = "independent"\nstart_mm = {float(start_mm)}\n{entry}' + (
        f"[hand]\nstiffness_n_per_mm = 10.0\ndamping_n_s_per_mm = 0.02\ntremor_mm = {float(tremor_mm)}\nseed = 1\n"
        '[[step]]\nname = "until the torque has faded in"\nseconds = 0.5\n'
    )
    return text + "".join(f'[[step]]\nname = "{number}"\n{step}\n' for number, step in enumerate(steps))
