from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Union

import pandas as pd

Recording = Union[str, PathLike[str], pd.DataFrame, Mapping[str, Any]]
Recordings = Union[Recording, Iterable[Recording]]

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

def check(rig: Union[str, PathLike[str]], fit: Recordings, holdout: Recordings) -> list[str]: ...
def diagnose(rig: Union[str, PathLike[str]], fit: Recordings, holdout: Recordings) -> Report: ...
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
