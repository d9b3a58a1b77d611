"""Writes the same short recording as other programs write it, into the folder given.

pip install numpy==2.4.6 pandas==3.1.1 pyarrow==26.0.1 mcap==1.6.0 scipy==1.17.1 rosbags==0.11.9 openpyxl==3.1.5 h5py==3.16.0; python make.py DIR

The motion is one that tests/import.rs knows: 2.5 s at 200 rows a second, an angle of 0.8·sin(2π·0.9·t) + 0.3·sin(2π·2.3·t) rad
under a torque of 0.4·cos(2π·0.9·t) N·m.
"""

import io
import json
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

out = Path(sys.argv[1])
t = np.arange(500) / 200.0
q = 0.8 * np.sin(2 * np.pi * 0.9 * t) + 0.3 * np.sin(2 * np.pi * 2.3 * t)
v = 0.8 * 2 * np.pi * 0.9 * np.cos(2 * np.pi * 0.9 * t) + 0.3 * 2 * np.pi * 2.3 * np.cos(2 * np.pi * 2.3 * t)
u = 0.4 * np.cos(2 * np.pi * 0.9 * t)

# pandas, with its index, dates and degrees.
stamps = pd.Timestamp("2024-03-01 10:00:00") + pd.to_timedelta(t, unit="s")
pd.DataFrame({"timestamp": stamps, "theta_deg": np.degrees(q), "tau [Nm]": u, "note": "ok"}).to_csv(out / "pandas.csv")

# pandas, as Germans set it up: semicolons, decimal commas, millinewtonmetres, milliseconds.
frame = pd.DataFrame({"Zeit (ms)": 1000 * t, "Winkel (deg)": np.degrees(q), "Moment (mNm)": 1000 * u})
frame.to_csv(out / "semicolons.csv", sep=";", decimal=",", index=False, float_format="%.6f")

# As MATLAB's fprintf and dlmwrite leave it: a percent sign, tabs, five digits, a row of units.
lines = ["% Bench 3, exported from MATLAB", "time\tposition\tcurrent", "s\trad\tmA"]
lines += [f"{a:.5f}\t{b:.7e}\t{c:.7e}" for a, b, c in zip(t, q, 2000 * u)]
(out / "matlab.csv").write_text("\n".join(lines) + "\n")

# NumPy, compressed, with what is no column beside.
np.savez_compressed(out / "arrays.npz", t=t, q=q.astype(np.float32), tau=u, mass=np.array(0.4), name=np.array("bench"))

# JSON in three of pandas' ways, and lines.
frame = pd.DataFrame({"time": t, "angle_rad": q, "torque_nm": u})
for orient in ["columns", "records", "split"]:
    (out / f"{orient}.json").write_text(frame.round(9).to_json(orient=orient, double_precision=9))
(out / "lines.jsonl").write_text(frame.to_json(orient="records", lines=True, double_precision=9))

# MCAP by the Python package, in its usual compression: two topics of different rates, JSON.
for name, compression in [("zstd", CompressionType.ZSTD), ("lz4", CompressionType.LZ4)]:
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=compression)
    writer.start()
    schema = writer.register_schema(name="any", encoding="jsonschema", data=b'{"type": "object"}')
    joint = writer.register_channel(topic="/joint", message_encoding="json", schema_id=schema)
    drive = writer.register_channel(topic="/drive", message_encoding="json", schema_id=schema)
    for i, (a, b, c) in enumerate(zip(t, q, u)):
        stamp = 1_700_000_000_000_000_000 + round(a * 1e9)
        if i % 2 == 0:
            message = json.dumps({"torque_nm": c}).encode()
            writer.add_message(drive, log_time=stamp, publish_time=stamp, data=message)
        message = json.dumps({"state": {"position_rad": b}, "ok": True}).encode()
        writer.add_message(joint, log_time=stamp, publish_time=stamp, data=message)
    writer.finish()
    (out / f"{name}.mcap").write_bytes(buffer.getvalue())

# Arrow's Parquet, snappy as it does by itself.
pd.DataFrame({"time": t, "angle_rad": q, "torque_nm": u}).to_parquet(out / "arrow.parquet", index=False)

# Degrees that wrap, speed alone, counts of a converter, stamps of a coarse clock, one stretch missing, rest at both ends.
pd.DataFrame({"t": t, "theta_deg": np.degrees(np.mod(9 * q, 2 * np.pi)), "tau_nm": u}).to_csv(out / "wrapped.csv", index=False)
pd.DataFrame({"t": t, "speed_rpm": v * 60 / (2 * np.pi), "tau_nm": u}).to_csv(out / "speed.csv", index=False)
counts = np.round(q * 4096 / (2 * np.pi)).astype(int)
pd.DataFrame({"t": np.arange(500) // 4 * 20.0, "enc": counts, "u_v": u}).to_csv(out / "coarse.csv", index=False)
gap = (t < 1.1) | (t > 1.4)
pd.DataFrame({"t": t[gap], "enc": counts[gap], "u_v": u[gap]}).to_csv(out / "gap.csv", index=False)
rest = np.concatenate([np.arange(600) / 200.0, 3 + t, 5.5 + np.arange(600) / 200.0])
pad = lambda x: np.concatenate([np.full(600, x[0]), x, np.full(600, x[-1])])
pd.DataFrame({"t": rest, "enc": pad(counts), "u_v": pad(u)}).to_csv(out / "rest.csv", index=False)
half = len(t) // 2
for name, part in [("first", slice(0, half)), ("second", slice(half, None))]:
    pd.DataFrame({"t": t[part], "enc": counts[part], "u_v": u[part]}).to_csv(out / f"{name}.csv", index=False)

# MATLAB's version 5 by SciPy: vectors beside a text and a scalar, compressed; a structure with a matrix whose rows are channels.
savemat(out / "vectors.mat", {"t": t, "q_rad": q, "tau_Nm": u.astype(np.float32), "note": "bench", "mass": 0.4}, do_compression=True)
log = {"time": t.reshape(-1, 1), "signals": {"values": np.vstack([q, u, np.round(1000 * q)])}}
savemat(out / "structure.mat", {"log": log}, oned_as="column")

# A ROS 2 bag by rosbags: joint states of two joints.
store = get_typestore(Stores.ROS2_HUMBLE)
JointState, Header, Time = (store.types[name] for name in ["sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"])
with tempfile.TemporaryDirectory() as folder:
    bag = Path(folder) / "bag"
    with BagWriter(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for a, b, c, d in zip(t, q, v, u):
            stamp = 1_700_000_000_000_000_000 + round(a * 1e9)
            header = Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="base")
            message = JointState(header=header, name=["wrist", "elbow"], position=np.array([b, -b]), velocity=np.array([c, -c]), effort=np.array([d, 0.0]))
            writer.write(connection, stamp, store.serialize_cdr(message, "sensor_msgs/msg/JointState"))
    (out / "ros2-bag").mkdir(exist_ok=True)
    (out / "ros2-bag/metadata.yaml").write_bytes((bag / "metadata.yaml").read_bytes())
    (out / "ros2-bag/bag.mcap").write_bytes((bag / "bag.mcap").read_bytes())

# A LeRobot dataset: two episodes in a file, lists of fixed length, their names in meta/info.json.
dataset = out / "lerobot"
(dataset / "meta").mkdir(parents=True, exist_ok=True)
(dataset / "data/chunk-000").mkdir(parents=True, exist_ok=True)
joints = ["wrist.pos", "elbow.pos"]
feature = lambda names: {"dtype": "float32", "shape": [len(names)], "names": names}
features = {"action": feature(joints), "observation.state": feature(joints), "observation.effort": feature(["wrist.torque"])}
info = {"codebase_version": "v3.0", "fps": 200, "features": features}
(dataset / "meta/info.json").write_text(json.dumps(info))
lists = lambda *columns: pa.FixedSizeListArray.from_arrays(pa.array(np.column_stack(columns).ravel(), pa.float32()), len(columns))
twice = lambda column: np.concatenate([column, column])
table = pa.table({
    "observation.state": lists(twice(q), -twice(q)),
    "observation.effort": lists(twice(u)),
    "action": lists(twice(q), twice(q)),
    "timestamp": pa.array(twice(t), pa.float32()),
    "frame_index": pa.array(twice(np.arange(500))),
    "episode_index": pa.array(np.repeat([0, 1], 500)),
})
pa.parquet.write_table(table, dataset / "data/chunk-000/file-000.parquet")

# What a spreadsheet saves.
pd.DataFrame({"t": t[:20], "theta_deg": q[:20], "u": u[:20]}).to_excel(out / "sheet.xlsx", index=False)

# Channels in rows, and a table without a header.
rows = [["time", "s", *t], ["theta", "deg", *np.degrees(q)], ["torque", "Nm", *u]]
(out / "rows.csv").write_text("\n".join(";".join(x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in rows) + "\n")
(out / "matrix.json").write_text(json.dumps([[round(x, 9) for x in row.tolist()] for row in (t, q, u)]))
np.savetxt(out / "bare.txt", np.column_stack([t, q, u]), fmt="%.7g")
# The same two columns in two files: an angle in one, a torque in the other.
pd.DataFrame({"time": t, "value": np.degrees(q)}).to_csv(out / "angle.csv", index=False, float_format="%.9g")
pd.DataFrame({"time": t, "value": u}).to_csv(out / "torque.csv", index=False, float_format="%.9g")

# HDF5 by h5py: named datasets in a group, compressed, beside what is no column.
with h5py.File(out / "datasets.h5", "w") as file:
    group = file.create_group("bench")
    group.create_dataset("time_s", data=t, compression="gzip")
    group.create_dataset("theta_deg", data=np.degrees(q), compression="gzip", shuffle=True)
    group.create_dataset("tau_Nm", data=u.astype(np.float32))
    group.create_dataset("operator", data="K.")
    group.create_dataset("mass", data=0.4)

# MATLAB's -v7.3 by its layout (h5py): a user block that says so, a struct as a group, a matrix with MATLAB's columns as rows, text as
# numbers of the class char, and what a cell refers to beside.
path = out / "v73.mat"
with h5py.File(path, "w", userblock_size=512) as file:
    log = file.create_group("log")
    log.attrs["MATLAB_class"] = np.bytes_("struct")
    for name, values in [("time_s", t), ("angle_rad", q)]:
        log.create_dataset(name, data=values[None, :], compression="gzip").attrs["MATLAB_class"] = np.bytes_("double")
    file.create_dataset("torque", data=np.stack([u, -u])).attrs["MATLAB_class"] = np.bytes_("double")
    text = file.create_dataset("note", data=np.frombuffer("bench".encode("utf-16-le"), np.uint16)[:, None])
    text.attrs["MATLAB_class"] = np.bytes_("char")
    refs = file.create_group("#refs#")
    refs.create_dataset("a", data=np.arange(500.0)[None, :])
with open(path, "r+b") as file:
    file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Fri Nov 27 12:00:00 2026 HDF5 schema 1.00 .".ljust(116))
    file.seek(124)
    file.write(b"\x00\x02IM")
