from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Union

import pandas as pd

Recording = Union[str, PathLike[str], pd.DataFrame, Mapping[str, Any]]
Recordings = Union[Recording, Iterable[Recording]]
Progress = Union[Callable[[str, float], object], None]

class InputError(ValueError): ...

@dataclass(frozen=True)
class Effect:
    name: str
    alternatives: list[str]
    confidence: float
    parameters: dict[str, dict[str, Any]]

class Report:
    json: dict[str, Any]
    verdict: str
    sentence: str
    effects: list[Effect]
    nominal_rig: str
    refit_rig: str
    patched_rig: str
    def force_error(self) -> pd.DataFrame: ...
    def save(self, folder: Union[str, PathLike[str]]) -> None: ...

@dataclass(frozen=True)
class Imported:
    rig: Path
    recordings: list[Path]
    notes: list[str]

@dataclass(frozen=True)
class Experiment:
    summary: str
    files: list[Path]

@dataclass(frozen=True)
class Settled:
    names: list[tuple[list[str], float]]
    conclusion: str
    folder: Path

def check(rig: Union[str, PathLike[str]], fit: Recordings, holdout: Recordings) -> list[str]: ...
def diagnose(
    rig: Union[str, PathLike[str]],
    fit: Recordings,
    holdout: Recordings,
    effects: Union[str, PathLike[str], None] = ...,
    progress: Progress = ...,
) -> Report: ...
def experiment(
    report: Union[Report, str, PathLike[str]],
    out: Union[str, PathLike[str]],
    travel: Union[float, None] = ...,
    speed: Union[float, None] = ...,
    force: Union[float, None] = ...,
    seconds: float = ...,
    seed: int = ...,
) -> Experiment: ...
def settle(
    plant: Union[str, PathLike[str]],
    out: Union[str, PathLike[str]],
    rig: Union[str, PathLike[str], None] = ...,
    rounds: int = ...,
    motion: float = ...,
    seed: int = ...,
    compensate: bool = ...,
    progress: Progress = ...,
) -> Settled: ...
def simulate(rig: Union[str, PathLike[str]], recording: Recording) -> pd.DataFrame: ...
def import_recording(
    *files: Union[str, PathLike[str]],
    out: Union[str, PathLike[str]],
    columns: Iterable[str] = ...,
    counts_per_turn: Union[float, None] = ...,
    rate: Union[float, None] = ...,
    undriven: bool = ...,
    split: Union[float, None] = ...,
) -> Imported: ...
