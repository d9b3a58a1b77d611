"""A recording as Foxglove's own readers (PyPI's `mcap` and `mcap-protobuf-support`) see it: named channels with JSON schemas, units in
the names, and needle and tissue in Foxglove's well-known messages.

Run by `cargo xtask test clients` with host-sim's path.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import build_file_descriptor_set

SECONDS = 3
COUNTS = {"/setup": 1, "/pose": 1_000 * SECONDS}


# Transforms a second, and metres in a millimetre.
TRANSFORM_HZ = 100
M_PER_MM = 1e-3


def check_foxglove(file):
    """The schemas are Foxglove's own, and the transform is the needle's."""
    depths, scenes, transforms = {}, [], []
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, channel, message in reader.iter_messages(topics=["/pose"]):
            depths.setdefault(message.log_time, []).append(json.loads(message.data)["depth_mm"])
        for schema, channel, message, said in reader.iter_decoded_messages(topics=["/tf", "/scene"]):
            own = {"/tf": FrameTransform, "/scene": SceneUpdate}[channel.topic]
            assert schema.name == own.DESCRIPTOR.full_name and schema.encoding == channel.message_encoding == "protobuf"
            assert schema.data == build_file_descriptor_set(own).SerializeToString(deterministic=True), schema.name
            assert said.SerializeToString(deterministic=True) == own.FromString(message.data).SerializeToString(deterministic=True)
            (transforms if channel.topic == "/tf" else scenes).append((message.log_time, said))
    assert abs(len(transforms) - TRANSFORM_HZ * SECONDS) <= 2, len(transforms)
    for time, said in transforms:
        assert said.parent_frame_id == "skin" and said.child_frame_id == "needle"
        assert said.timestamp.ToNanoseconds() == time
        place, turn = said.translation, said.rotation
        tilt = 2 * math.atan2(turn.y, turn.w)
        along = math.hypot(place.x, place.z)
        assert any(math.isclose(along, abs(depth) * M_PER_MM, abs_tol=1e-9) for depth in depths[time]), (along, depths[time])
        assert math.isclose(place.x * math.sin(tilt), -place.z * math.cos(tilt), abs_tol=1e-9), "the tip is on the needle's line"
    assert max(said.translation.x for _, said in transforms) > 2 * M_PER_MM, "the needle goes in"
    (_, scene), = scenes
    needle, tissue = scene.entities
    assert (needle.frame_id, tissue.frame_id) == ("needle", "skin") and needle.frame_locked and tissue.frame_locked
    assert [round(each.size.z / M_PER_MM) for each in needle.cylinders] == [25, 7], "cannula and hub"
    tops = [each.pose.position.z + each.size.z / 2 for each in tissue.cubes]
    assert [round(top / M_PER_MM, 3) for top in tops] == [0, -2], "skin and fat of the adult"
    vessel, = tissue.cylinders
    assert math.isclose(vessel.pose.position.z, -6.3 * M_PER_MM, abs_tol=1e-6) and math.isclose(vessel.size.x, 3 * M_PER_MM, abs_tol=1e-6)
    print(f"foxglove: pass ({len(transforms)} transforms, a scene of {len(scene.entities)} entities)")


def check_numbers(file):
    """The needle's numbers are those of the poses, and the layout plots what there is."""
    poses, numbers, topics = [], [], {}
    with file.open("rb") as stream:
        for schema, channel, message, said in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/needle"]):
            assert (schema.name, schema.encoding, channel.message_encoding) == ("needle.Numbers", "protobuf", "protobuf")
            numbers.append((message.log_time, said))
        stream.seek(0)
        for schema, channel, message in make_reader(stream).iter_messages(topics=["/pose"]):
            poses.append((message.log_time, json.loads(message.data)))
    assert abs(len(numbers) - TRANSFORM_HZ * SECONDS) <= 2, len(numbers)
    keys = ("depth_mm", "speed_mm_s", "force_n")
    said_then = {(time, *(pose[key] for key in keys)) for time, pose in poses}
    assert all((time, *(getattr(said, key) for key in keys)) in said_then for time, said in numbers)
    torques = [said.torque_mnm for _, said in numbers[10:]]
    # The motor does what the law asks for, but for a step of its converter and the lag of a pose: torque is force times radius, and negative
    # where it resists.
    force, torque = (sum(getattr(said, key) for _, said in numbers[10:]) for key in ("force_n", "torque_mnm"))
    assert min(torques) < -1.0 and 5.0 < -torque / force < 40.0, torque / force
    layout = json.loads(file.with_name("foxglove-layout.json").read_text())
    fields = [path["value"] for one in layout["configById"].values() for path in one.get("paths", []) if path["value"].startswith("/needle")]
    assert len(fields) == 3 and all(hasattr(numbers[0][1], field.split(".")[1]) for field in fields), fields
    topics = [topic for one in layout["configById"].values() for topic in one.get("topics", {})]
    assert topics == ["/scene"], topics
    print(f"numbers: pass ({len(numbers)})")


def check_rerun(folder, program, device):
    """Rerun reads the numbers of a recording and of a simulation, and the script next to them adds a blueprint that plots them."""
    simulated = folder / "simulated"
    demo = [program, "--quiet", "demo", "--no-browser", "--out", folder]
    subprocess.run(demo, check=True, stdout=subprocess.DEVNULL)
    rig, recording = folder / "missing/patched-rig.toml", folder / "missing/holdout.csv"
    subprocess.run([program, "--quiet", "simulate", "--rig", rig, "--recording", recording, "--out", simulated], check=True, stdout=subprocess.DEVNULL)
    for file, message, topic in [(device, "needle.Numbers:message", "/needle"), (simulated / "simulation.mcap", "needle.Motion:message", "/residual/patched")]:
        script = file.with_name("open-in-rerun.py")
        subprocess.run([sys.executable, script, file, "--no-viewer"], check=True, stdout=subprocess.DEVNULL)
        rerun = pathlib.Path(sys.executable).with_name("rerun")
        printed = subprocess.run([rerun, "rrd", "print", file.with_suffix(".rrd")], check=True, capture_output=True, text=True).stdout
        rows = [line for line in printed.splitlines() if f" - {topic} - " in line and f"[{message}]" in line]
        assert rows, f"{topic} is not read as numbers:\n{printed[:2000]}"
        assert any("VisualizerInstruction:component_map" in line and f"overrides{topic}/" in line for line in printed.splitlines()), printed[:2000]
    print("rerun: pass")


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "a.mcap"
        command = [program, "run", "--headless", "--fast", "--seconds", str(SECONDS), "--record", file]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        counts, samples = {}, 0
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
                if channel.topic in ("/tf", "/scene", "/needle"):
                    continue
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json"), channel
                said, wanted = json.loads(message.data), json.loads(schema.data)["properties"]
                assert set(said) <= set(wanted), f"{channel.topic} holds {set(said) - set(wanted)} beside its schema"
                samples += len(said["count"]) if channel.topic == "/samples" else 0
        check_foxglove(file)
        check_numbers(file)
        check_rerun(pathlib.Path(folder), program, file)
    for topic, count in COUNTS.items():
        assert abs(counts[topic] - count) <= 2, f"{counts[topic]} messages on {topic}"
    assert samples == 10_000 * SECONDS, f"{samples} samples"
    print(f"recording: pass ({', '.join(sorted(counts))})")


if __name__ == "__main__":
    main(sys.argv[1])
