"""The live streams as other people's programs read them: pyigtl (3D Slicer's protocol), websockets, plain UDP.

Run by `cargo xtask test clients` with host-sim's path; everything is on loopback.
"""

import asyncio
import json
import math
import re
import socket
import struct
import subprocess
import sys
import time

import crcmod
import numpy as np
import pyigtl
import websockets

PATIENCE_S = 20
# The scripted hand goes in and out within 6 s, at 10 images a second.
IMAGES = 80


def start(program, *flags):
    """A virtual device with `flags`, and the ports that it says it serves."""
    command = [program, "run", "--headless", *flags]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    ports = {}
    while len(ports) < flags.count("--stream"):
        line = child.stdout.readline()
        found = re.match(r"(\w+) stream at [\d.]+:(\d+)", line)
        if not found:
            child.kill()
            raise SystemExit(f"host-sim said {line!r} instead of where a stream is")
        ports[found[1]] = int(found[2])
    return child, ports


def check_openigtlink(port):
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
    transforms = []
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and len(transforms) < 20:
        transforms += [each for each in client.get_latest_messages() if each.message_type == "TRANSFORM" and each.device_name == "Needle"]
        time.sleep(0.02)
    client.stop()
    assert transforms, "no TRANSFORM came"
    matrix, tips = transforms[-1].matrix, [each.matrix[:3, 3] for each in transforms]
    for row in range(3):
        length = math.sqrt(sum(matrix[row, column] ** 2 for column in range(3)))
        assert abs(length - 1) < 1e-5, f"row {row} of the rotation is {length} long"
    assert transforms[-1].device_name == "Needle"
    assert any(abs(a - b).max() > 0.01 for a, b in zip(tips, tips[1:])), "the needle does not move"
    print(f"openigtlink: pass ({len(tips)} transforms)")


def check_openigtlink_image(port):
    """The ultrasound image and its probe: where they are, and that the needle is seen in the image as it goes in."""
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
    images, probes, begin = [], [], time.monotonic()
    end = begin + PATIENCE_S
    while time.monotonic() < end and len(images) < IMAGES:
        for each in client.get_latest_messages():
            if each.message_type == "IMAGE":
                images.append(each)
            elif each.device_name == "Probe":
                probes.append(each)
        time.sleep(0.01)
    seconds = time.monotonic() - begin
    client.stop()
    assert len(images) == IMAGES and probes, f"{len(images)} images, {len(probes)} probes"
    assert len(images) / seconds < 12, f"{len(images)} images in {seconds:.1f} s"
    image, probe = images[-1], probes[-1]
    assert image.device_name == "Ultrasound" and image.image.shape == (1, 512, 256) and image.image.dtype == np.uint8
    to_world = image.ijk_to_world_matrix
    spacing = np.linalg.norm(to_world[:3, :3], axis=0)
    assert np.allclose(spacing, [24 / 256, 16 / 512, 24 / 256], atol=1e-5), spacing
    # Column 127.5 of the first row, the middle of the upper edge, is the middle of the probe's face.
    face = to_world @ [127.5, -0.5, 0, 1]
    assert np.allclose(face[:3], probe.matrix[:3, 3], atol=0.01), (face, probe.matrix)
    assert np.allclose(probe.matrix[:3, 0], [1, 0, 0], atol=1e-5) and np.allclose(probe.matrix[:3, 1], [0, 0, -1], atol=1e-5), probe.matrix
    # Blood is dark and the fat over it is not: 4.8 to 7.8 mm and 2.0 to 4.8 mm below the skin.
    row = lambda mm: round(mm * 512 / 16)
    before = min(images, key=lambda each: each.image[0, row(5.6):row(7.0)].mean()).image[0]
    assert before[row(5.6):row(7.0)].mean() < 0.5 * before[row(2.6):row(4.2)].mean()
    with_needle = max(each.image[0, row(5.6):row(7.0)].mean() for each in images)
    assert with_needle > 1.2 * before[row(5.6):row(7.0)].mean(), "the needle is never seen in the vein"
    print(f"openigtlink image: pass ({len(images)} images, {len(images) / seconds:.1f} a second)")


def check_openigtlink_status(port):
    """pyigtl knows no STATUS: its header and checksum by hand."""
    checksum = crcmod.mkCrcFun(0x142F0E1EBA9EA3693, initCrc=0, rev=False, xorOut=0)
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as client:
        stream = client.makefile("rb")
        for _ in range(100):
            _, kind, _, _, length, crc = struct.unpack(">H12s20sQQQ", stream.read(58))
            body = stream.read(length)
            assert checksum(body) == crc, f"the checksum of a {kind} is wrong"
            if kind.rstrip(b"\0") == b"STATUS":
                code, _, name = struct.unpack(">Hq20s", body[:30])
                assert body.endswith(b"\0") and 1 <= code <= 19, body
                print(f"openigtlink status: pass ({code}, {name.rstrip(bytes(1)).decode()})")
                return
    raise AssertionError("no STATUS came")


async def read_websocket(port, count):
    async with websockets.connect(f"ws://127.0.0.1:{port}/pose") as client:
        return [json.loads(await asyncio.wait_for(client.recv(), PATIENCE_S)) for _ in range(count)]


def check_poses(name, poses):
    times = [pose["t_s"] for pose in poses]
    assert times == sorted(times) and times[-1] > times[0], f"times {times[:3]}…{times[-3:]}"
    for pose in poses:
        tip = math.sqrt(sum(part * part for part in pose["tip_mm"]))
        assert abs(tip - abs(pose["depth_mm"])) < 1e-6, pose
        assert {"force_n", "motor_n", "speed_mm_s", "tilt_rad", "state"} <= set(pose)
    print(f"{name}: pass ({len(poses)} poses)")


def check_udp(receiver, count):
    poses = [json.loads(receiver.recv(4096)) for _ in range(count)]
    assert all(pose["timestamp"] == pose["t_s"] for pose in poses)
    check_poses("udp", poses)


def check_token(program):
    """Beyond this computer nothing is served without a token."""
    done = subprocess.run([program, "run", "--headless", "--stream", "websocket=0.0.0.0:0"], capture_output=True, text=True)
    assert done.returncode == 2 and "--stream-token" in done.stderr, done
    print("token: pass")


def main(program):
    check_token(program)
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(PATIENCE_S)
    udp = f"udp=127.0.0.1:{receiver.getsockname()[1]}"
    child, ports = start(
        program, "--stream", udp, "--stream", "openigtlink=127.0.0.1:0", "--stream", "websocket=127.0.0.1:0"
    )
    try:
        check_udp(receiver, 100)
        check_poses("websocket", asyncio.run(read_websocket(ports["websocket"], 100)))
        check_openigtlink(ports["openigtlink"])
        check_openigtlink_image(ports["openigtlink"])
        check_openigtlink_status(ports["openigtlink"])
    finally:
        child.terminate()
        child.wait(PATIENCE_S)


if __name__ == "__main__":
    main(sys.argv[1])
