"""A recording as Foxglove's own reader (PyPI's `mcap`) sees it: named channels with JSON schemas, units in the names.

Run by `cargo xtask test clients` with host-sim's path.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

from mcap.reader import make_reader

SECONDS = 3
COUNTS = {"/setup": 1, "/pose": 1_000 * SECONDS}


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "a.mcap"
        command = [program, "run", "--headless", "--fast", "--seconds", str(SECONDS), "--record", file]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        counts, samples = {}, 0
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json"), channel
                said, wanted = json.loads(message.data), json.loads(schema.data)["properties"]
                assert set(said) <= set(wanted), f"{channel.topic} holds {set(said) - set(wanted)} beside its schema"
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
                samples += len(said["count"]) if channel.topic == "/samples" else 0
    for topic, count in COUNTS.items():
        assert abs(counts[topic] - count) <= 2, f"{counts[topic]} messages on {topic}"
    assert samples == 10_000 * SECONDS, f"{samples} samples"
    print(f"recording: pass ({', '.join(sorted(counts))})")


if __name__ == "__main__":
    main(sys.argv[1])
