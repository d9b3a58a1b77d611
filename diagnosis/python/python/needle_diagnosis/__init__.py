"""Which physics does a simulation leave out? Recordings say, as pandas frames or as files.

    import needle_diagnosis as nd

    report = nd.diagnose("rig.toml", fit=["fit.csv"], holdout=["holdout.csv"])
    report                      # a notebook shows the page
    report.effects[0].name      # such as "cogging"
    report.patched_rig          # the simulation with what was missing, as TOML

Rigs and recordings have the forms of docs/measured/recordings.md. A recording is a path, a frame, or anything that pandas makes a frame of, with
the columns time_s, command and position_counts.
"""

from __future__ import annotations

import html as _html
import io as _io
import json as _json
import os as _os
from dataclasses import dataclass as _dataclass
from pathlib import Path as _Path

import pandas as _pandas

from . import _native
from ._native import InputError

__all__ = [
    "Effect", "Experiment", "Imported", "InputError", "Report", "Settled",
    "check", "diagnose", "experiment", "import_recording", "settle", "simulate",
]


@_dataclass(frozen=True)
class Effect:
    """One missing effect: its name, those that the recordings cannot tell from it (itself first), the probability that the class holds
    the truth, and its values with their 95 % intervals and units."""

    name: str
    alternatives: list
    confidence: float
    parameters: dict


class Report:
    """What a diagnosis found."""

    def __init__(self, native):
        self._native = native
        #: The whole report, as in diagnosis.json.
        self.json = _json.loads(native.json())
        self.verdict = self.json["verdict"]
        self.sentence = self.json["sentence"]
        self.effects = [
            Effect(one["name"], one["class"], one["confidence"], one["parameters"]) for one in self.json["effects"]
        ]
        #: The rigs, as TOML: as it was given, refitted, and with what was missing.
        self.nominal_rig, self.refit_rig, self.patched_rig = native.rigs()

    def force_error(self):
        """Root mean square of the force that each model leaves, on the fitted and the held-out recordings."""
        rows = {model: self.json["fit"][model] for model in ("nominal", "refit", "patched")}
        return _pandas.DataFrame.from_dict(rows, orient="index")[["fit", "holdout"]]

    def save(self, folder):
        """Writes report.html, diagnosis.json, the rigs and residuals.csv to a folder, which is made."""
        self._native.save(_os.fspath(folder))

    def __str__(self):
        return self._native.summary()

    def __repr__(self):
        return f"<Report {self.verdict}: {self.sentence}>"

    def _repr_html_(self):
        page = _html.escape(self._native.html(), quote=True)
        return f'<iframe title="diagnosis" style="width:100%;height:40em;border:0" srcdoc="{page}"></iframe>'


@_dataclass(frozen=True)
class Imported:
    """The rig and the recordings that import_recording wrote, and what it assumed."""

    rig: _Path
    recordings: list
    notes: list


@_dataclass(frozen=True)
class Experiment:
    """The input that experiment designed: a summary, and its files, of which reference.csv and command.csv are to be played."""

    summary: str
    files: list


@_dataclass(frozen=True)
class Settled:
    """What settle found: each name that is sure enough with those that cannot be distinguished from it and its probability, why it ended, and the
    folder with its pages."""

    names: list
    conclusion: str
    folder: _Path


def _rig(rig, what="rig"):
    """A rig's name and text, from a path or from TOML."""
    if isinstance(rig, str) and "\n" in rig:
        return (what, rig)
    path = _Path(rig)
    try:
        return (str(path), path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise InputError(f"{path}: the {what} cannot be read ({cause.strerror}); check its path") from cause


def _recording(recording, name):
    """A recording's name and text as CSV."""
    if isinstance(recording, (str, _os.PathLike)):
        path = _Path(recording)
        try:
            return (path.name, path.read_text(encoding="utf-8"))
        except OSError as cause:
            raise InputError(f"{path}: the recording cannot be read ({cause.strerror}); check its path") from cause
    # Numbers are written so that they are read back as the same.
    return (name, _pandas.DataFrame(recording).to_csv(index=False))


def _recordings(recordings, name):
    if isinstance(recordings, (str, _os.PathLike, _pandas.DataFrame, dict)):
        recordings = [recordings]
    return [_recording(one, f"{name}[{place}]") for place, one in enumerate(recordings)]


def check(rig, fit, holdout):
    """Says in a second what recordings can and cannot show, as a list of sentences: rate, resolution, faults of the log, values and
    effects that cannot be distinguished, with their correlation, and what to record next. Arguments and errors are those of diagnose."""
    return _native.check(_rig(rig), _recordings(fit, "fit"), _recordings(holdout, "holdout"))


def diagnose(rig, fit, holdout, effects=None, progress=None):
    """Diagnoses recordings of a rig.

    rig: a path, or TOML. fit, holdout: one recording or several; those to hold out only judge. effects: a file of formulas that are
    searched too, a path or TOML. progress: called with a stage and the fraction done, 0 to 1; what it raises is raised at the end.
    Raises InputError, with a sentence that says what, where and what to do."""
    formulas = None if effects is None else _rig(effects, "file of effects")
    return Report(_native.diagnose(_rig(rig), _recordings(fit, "fit"), _recordings(holdout, "holdout"), formulas, progress))


def experiment(report, out, travel=None, speed=None, force=None, seconds=30.0, seed=1):
    """Designs the input that best distinguishes the rivals of a diagnosis, and writes it to the folder out, as host-sim experiment does.

    report: a Report, or the folder that one was saved to. travel, speed, force: limits in rad or m, a second, and N·m or N; without them
    what the recordings did and the rig allows. seconds: the longest input, 4 to 30."""
    if not 4.0 <= seconds <= 30.0:
        raise InputError(f"seconds is {seconds}; it must be from 4 to 30")
    if isinstance(report, Report):
        report.save(_Path(out) / "report")
        report = _Path(out) / "report"
    limits = (travel, speed, force)
    summary, files = _native.experiment(_os.fspath(report), _os.fspath(out), limits, seconds, seed)
    return Experiment(summary, [_Path(one) for one in files])


def settle(plant, out, rig=None, rounds=5, motion=180.0, seed=1, compensate=True, progress=None):
    """Lets a virtual device settle its own diagnosis: it records, diagnoses, designs the deciding input and records again, as host-sim
    settle does; a real device moves beside a person, on the command line only.

    plant: the device's true mechanism, a path or TOML. rig: the simulation as its author believes it. rounds: at most, 1 to 5. motion:
    at most, 20 to 180 s. compensate: feed forward what was found. progress: called with words and the fraction done."""
    if not 1 <= rounds <= 5 or not 20.0 <= motion <= 180.0:
        raise InputError(f"rounds is {rounds} and motion {motion}; they must be 1 to 5, and 20 to 180 s")
    believed = None if rig is None else _rig(rig)
    limits = (rounds, motion, seed, compensate)
    names, conclusion = _native.settle(_rig(plant, "plant"), believed, _os.fspath(out), limits, progress)
    return Settled(names, conclusion, _Path(out))


def simulate(rig, recording):
    """Runs a rig under a recording's command. Returns a frame with time_s, position (rad or m from the start) and velocity."""
    name, text = _recording(recording, "recording")
    position, velocity = _native.simulate(_rig(rig), (name, text))
    time_s = _pandas.read_csv(_io.StringIO(text), usecols=["time_s"])["time_s"]
    return _pandas.DataFrame({"time_s": time_s, "position": position, "velocity": velocity})


def import_recording(*files, out, columns=(), counts_per_turn=None, rate=None, undriven=False, split=None):
    """Turns files as people have them into a folder that diagnose reads, as host-sim import does.

    columns: hints such as "position=theta:deg". rate: rows a second, where no column has the time.
    undriven: the command is zero. split: the part of each run that is fitted, such as 0.6; the rest is held out."""
    paths = [_os.fspath(file) for file in files]
    known = (rate, undriven, split)
    rig, recordings, notes = _native.import_recording(paths, _os.fspath(out), list(columns), counts_per_turn, known)
    return Imported(_Path(rig), [_Path(one) for one in recordings], notes)
