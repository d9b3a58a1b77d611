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

__all__ = ["Effect", "Imported", "InputError", "Report", "check", "diagnose", "import_recording", "simulate"]


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


def _rig(rig):
    """A rig's name and text, from a path or from TOML."""
    if isinstance(rig, str) and "\n" in rig:
        return ("rig", rig)
    path = _Path(rig)
    try:
        return (str(path), path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise InputError(f"{path}: the rig cannot be read ({cause.strerror}); check its path") from cause


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


def diagnose(rig, fit, holdout):
    """Diagnoses recordings of a rig.

    rig: a path, or TOML. fit, holdout: one recording or several; those to hold out only judge. Raises InputError, with a sentence that
    says what, where and what to do."""
    return Report(_native.diagnose(_rig(rig), _recordings(fit, "fit"), _recordings(holdout, "holdout")))


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
