"""Opens recordings of host-sim in Rerun with their plots: python open-in-rerun.py RECORDING.mcap … (needs PyPI's rerun-sdk, 0.41 or newer).

Each becomes RECORDING.rrd, which holds the recording and its blueprint: `--no-viewer` writes it alone, and `rerun RECORDING.rrd` opens it.
"""

import sys
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

# A recording of the device, and one that `simulate` wrote: a view a line, with the field of each topic that it shows.
DEVICE = {
    "depth, mm": {"/needle": "depth_mm"},
    "force of the law, N": {"/needle": "force_n"},
    "torque, mN·m": {"/needle": "torque_mnm"},
    "speed, mm/s": {"/needle": "speed_mm_s"},
}
MODELS = ["nominal", "refit", "patched"]
COLOURS = [(194, 87, 26), (138, 124, 200), (22, 115, 177), (120, 130, 145)]


def simulated(kind):
    position, force = {"rotary": ("position_rad", "force_nm"), "linear": ("position_m", "force_n")}[kind]
    topics = ["/recording", *(f"/simulation/{model}" for model in MODELS)]
    left = [f"/residual/{model}" for model in MODELS]
    return {
        position: {topic: position for topic in topics},
        f"{position}, recorded − simulated": {topic: position for topic in left},
        f"{force}, recorded − simulated": {topic: force for topic in left},
    }


def view(name, fields, message):
    """A plot of one field of some topics."""
    overrides = {}
    for colour, (topic, field) in zip(COLOURS, fields.items()):
        mapping = VisualizerComponentMapping(
            target="Scalars:scalars", source_kind=ComponentSourceKind.SourceComponent, source_component=message, selector=f".{field}"
        )
        overrides[topic] = rr.SeriesLines(names=topic.strip("/"), colors=colour).visualizer(mappings=[mapping])
    return rrb.TimeSeriesView(name=name, contents=list(fields), overrides=overrides)


def blueprint(path):
    """The views of a file, by the fields that its schemas have."""
    schemas = path.read_bytes()
    if b"needle.Numbers" in schemas:
        views = [view(name, fields, "needle.Numbers:message") for name, fields in DEVICE.items()]
    elif b"needle.Motion" in schemas:
        kind = "rotary" if b"position_rad" in schemas else "linear"
        views = [view(name, fields, "needle.Motion:message") for name, fields in simulated(kind).items()]
    else:
        raise SystemExit(f"{path}: is no recording of host-sim, or is from before its numbers were Protobuf; record it again")
    return rrb.Blueprint(rrb.Vertical(*views), rrb.SelectionPanel(state="collapsed"))


def main(arguments):
    paths = [Path(one) for one in arguments if one != "--no-viewer"]
    if not paths:
        raise SystemExit(__doc__)
    written = []
    for path in paths:
        views = blueprint(path)
        written.append(path.with_suffix(".rrd"))
        with rr.RecordingStream(f"needle-{path.stem}") as stream:
            stream.save(written[-1], default_blueprint=views)
            stream.log_file_from_path(path)
        stream.disconnect()
        print(written[-1])
    if "--no-viewer" not in arguments:
        rr.spawn(connect=False)
        for one in written:
            rr.init(one.stem)
            rr.connect_grpc()
            rr.log_file_from_path(one)


if __name__ == "__main__":
    main(sys.argv[1:])
