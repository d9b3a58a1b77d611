"""The package on a machine that is made up here, by another integrator than the package's own."""

import ast
import inspect
import json
from pathlib import Path

import needle_diagnosis as nd
import numpy as np
import pandas as pd
import pytest

INERTIA, COULOMB, VISCOUS, GAIN = 2e-4, 4e-3, 9e-4, 0.02
COUNTS = 8192 / (2 * np.pi)
RIG = f"""format = 1
kind = "rotary"
model = {{ inertia = {INERTIA}, coulomb = {COULOMB} }}
actuator = {{ gain = {GAIN}, command_unit = "A", limit = 5.0 }}
encoder = {{ counts_per_unit = {COUNTS}, turn = {2 * np.pi} }}
"""


def recording(seed, seconds=12.0, rate_hz=1000.0, steps=20):
    """An axis with the rig's dry friction, and viscous friction that the rig does not have, stepped finely."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    lines = [(hertz, random.uniform(0, 2 * np.pi)) for hertz in (0.4, 0.9, 1.7, 3.1, 5.3)]
    command = sum(0.55 * np.sin(2 * np.pi * hertz * time_s + phase) for hertz, phase in lines)
    angle, speed, angles = 0.0, 0.0, []
    step = 1.0 / rate_hz / steps
    for asked in command:
        angles.append(angle)
        for _ in range(steps):
            free = GAIN * asked - VISCOUS * speed
            friction = COULOMB * np.sign(speed) if speed else np.clip(free, -COULOMB, COULOMB)
            next_speed = speed + (free - friction) / INERTIA * step
            # Friction stops an axis and never turns it round.
            speed = 0.0 if speed * next_speed < 0 and abs(free) <= COULOMB else next_speed
            angle += speed * step
    counts = np.floor(np.array(angles) * COUNTS + 0.5)
    return pd.DataFrame({"time_s": time_s, "command": command, "position_counts": counts})


@pytest.fixture(scope="module")
def frames():
    return [recording(seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def report(frames):
    return nd.diagnose(RIG, fit=frames[:2], holdout=frames[2])


# A law that the library does not have: a force with the third power of speed.
FORMULA = """[[effect]]
name = "cubic"
formula = "-c*v*v*v"
parameters = { c = [1e-9, 1e-3] }
"""


def test_progress_goes_from_zero_to_one_and_may_raise(frames):
    told = []
    nd.diagnose(RIG, frames[:2], frames[2], effects=FORMULA, progress=lambda stage, part: told.append((stage, part)))
    assert len({stage for stage, _ in told}) > 3 and told[-1] == ("done", 1.0), told
    assert all(0.0 <= part <= 1.0 for _, part in told)

    def stop(stage, part):
        raise KeyError(stage)

    with pytest.raises(KeyError):
        nd.diagnose(RIG, frames[:2], frames[2], progress=stop)


def test_a_formula_is_searched_and_a_wrong_one_refused(frames):
    found = nd.diagnose(RIG, frames[:2], frames[2], effects=FORMULA)
    names = [one["name"] for key in ("hypotheses", "untested", "effects") for one in found.json.get(key) or []]
    assert "cubic" in names, names
    with pytest.raises(nd.InputError, match="cubic"):
        nd.diagnose(RIG, frames[:2], frames[2], effects=FORMULA.replace("v*v*v", "w*w*w"))


def test_an_experiment_is_designed_from_a_report(report, tmp_path):
    demo = Path(__file__).parents[3] / "host-sim" / "demo" / "cannot-tell"
    unsure = nd.diagnose(demo / "rig.toml", [demo / "fit-a.csv", demo / "fit-b.csv"], demo / "holdout.csv")
    limits = {"travel": 6.0, "speed": 8.0, "force": 4.0, "seconds": 8.0}
    designed = nd.experiment(unsure, tmp_path / "next", **limits)
    assert {"reference.csv", "command.csv"} <= {path.name for path in designed.files}, designed
    command = pd.read_csv(tmp_path / "next" / "command.csv")
    assert 3.0 < command.iloc[-1, 0] <= 8.1 and designed.summary, command
    again = nd.experiment(tmp_path / "next" / "report", tmp_path / "again", **limits)
    assert again.summary == designed.summary
    with pytest.raises(nd.InputError, match="4 to 30"):
        nd.experiment(unsure, tmp_path / "next", seconds=60.0)
    with pytest.raises(nd.InputError, match="nothing to distinguish"):
        nd.experiment(report, tmp_path / "sure")


def test_a_virtual_device_settles_its_diagnosis(tmp_path):
    hidden = Path(__file__).parents[3] / "tests" / "fixtures" / "hidden.toml"
    told = []
    settled = nd.settle(hidden, tmp_path / "out", rounds=1, motion=20.0, compensate=False, progress=lambda *one: told.append(one))
    assert settled.conclusion and (settled.folder / "settle.html").is_file()
    assert any(words == "diagnosing" for words, _ in told) and any(words.startswith("round 1") for words, _ in told)
    with pytest.raises(nd.InputError, match="1 to 5"):
        nd.settle(hidden, tmp_path / "out", rounds=9)


def test_a_check_says_what_one_speed_cannot_show(frames):
    lively = nd.check(RIG, frames[:2], frames[2])
    assert lively[0].startswith("fit[0]: 12 s at 1000 rows a second"), lively
    assert not any("one speed" in sentence for sentence in lively), lively
    # The axis turns evenly under a command that its own friction takes.
    time_s = np.arange(0.0, 6.0, 1e-3)
    steady = [pd.DataFrame({"time_s": time_s, "command": 0.4 + 0.02 * np.sin(5 * time_s + seed), "position_counts":
        np.floor(8.0 * COUNTS * time_s)}) for seed in (1, 2)]
    assert any("one speed" in sentence for sentence in nd.check(RIG, steady[0], steady[1]))
    with pytest.raises(nd.InputError):
        nd.check(RIG, frames[0][:20], frames[1])


def test_the_types_list_what_the_package_has():
    types = ast.parse(Path(nd.__file__).with_suffix(".pyi").read_text()).body
    typed = {one.name: one for one in types if isinstance(one, (ast.FunctionDef, ast.ClassDef))}
    assert set(typed) == set(nd.__all__)
    for name, one in typed.items():
        if isinstance(one, ast.FunctionDef):
            listed = [*one.args.args, *filter(None, [one.args.vararg]), *one.args.kwonlyargs]
            assert [argument.arg for argument in listed] == list(inspect.signature(getattr(nd, name)).parameters), name


def test_what_is_missing_is_found_with_its_size(report):
    assert report.verdict == "missing_physics", report
    assert [effect.name for effect in report.effects] == ["viscous_friction"], report
    effect = report.effects[0]
    assert effect.confidence > 0.9 and effect.alternatives[0] == "viscous_friction"
    value = next(iter(effect.parameters.values()))["value"]
    assert value == pytest.approx(VISCOUS, rel=0.05)


def test_the_patched_rig_follows_a_held_out_recording(report, frames):
    true = frames[2]["position_counts"].to_numpy() / COUNTS

    def off(rig):
        run = nd.simulate(rig, frames[2])
        assert list(run.columns) == ["time_s", "position", "velocity"] and len(run) == len(true)
        return np.sqrt(np.mean((run["position"] - (true - true[0])) ** 2))

    assert off(report.patched_rig) < 0.1 * off(report.nominal_rig)
    errors = report.force_error()
    assert errors.loc["patched", "holdout"] < 0.2 * errors.loc["nominal", "holdout"]


def test_files_and_frames_say_the_same(report, frames, tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    for name, frame in zip(("a.csv", "b.csv", "c.csv"), frames):
        frame.to_csv(tmp_path / name, index=False)
    read = nd.diagnose(tmp_path / "rig.toml", fit=[tmp_path / "a.csv", tmp_path / "b.csv"], holdout=tmp_path / "c.csv")
    assert read.sentence == report.sentence
    assert read.json["fit"] == report.json["fit"]


def test_a_notebook_shows_the_page_and_a_folder_keeps_it(report, tmp_path):
    shown = report._repr_html_()
    assert shown.startswith("<iframe") and "viscous" in shown and "<script" not in shown.split("srcdoc")[0]
    report.save(tmp_path / "report")
    kept = json.loads((tmp_path / "report" / "diagnosis.json").read_text())
    assert kept["sentence"] == report.sentence
    assert (tmp_path / "report" / "report.html").is_file()


def test_a_table_of_degrees_is_imported(frames, tmp_path):
    table = pd.DataFrame(
        {
            "t": frames[0]["time_s"],
            "current": frames[0]["command"],
            "theta": np.degrees(frames[0]["position_counts"] / COUNTS),
        }
    )
    table.to_csv(tmp_path / "log.csv", index=False)
    hints = ["time=t:s", "command=current:A", "position=theta:deg"]
    imported = nd.import_recording(tmp_path / "log.csv", out=tmp_path / "out", columns=hints, counts_per_turn=8192)
    assert imported.rig.is_file() and len(imported.recordings) == 1
    read = pd.read_csv(imported.recordings[0])
    assert np.abs(np.diff(read["position_counts"])).max() < 1000
    table.drop(columns=["t", "current"]).to_csv(tmp_path / "bare.csv", index=False)
    options = {"rate": 500.0, "undriven": True, "split": 0.6, "counts_per_turn": 8192}
    imported = nd.import_recording(tmp_path / "bare.csv", out=tmp_path / "bare", columns=hints[2:], **options)
    assert [path.name for path in imported.recordings] == ["fit.csv", "holdout.csv"]


@pytest.mark.parametrize(
    "change, hint",
    [
        (lambda frame: frame.drop(columns="command"), "command"),
        (lambda frame: frame.assign(time_s=0.0), "time"),
        (lambda frame: frame.head(3), "fit[0]"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(frames, change, hint):
    with pytest.raises(nd.InputError) as refused:
        nd.diagnose(RIG, fit=change(frames[0]), holdout=frames[2])
    assert hint in str(refused.value) and "\n" not in str(refused.value)


def test_a_rig_that_is_not_there_is_named():
    with pytest.raises(nd.InputError, match="nowhere.toml"):
        nd.diagnose("nowhere.toml", fit="a.csv", holdout="b.csv")


def test_the_example_notebook_runs(tmp_path, monkeypatch):
    notebook = json.loads((Path(__file__).parent.parent / "examples" / "diagnose.ipynb").read_text())
    monkeypatch.chdir(tmp_path)
    scope = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "diagnose.ipynb", "exec"), scope)
    assert scope["report"].effects[0].name == "position_spring"
