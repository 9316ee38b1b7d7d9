"""Writes and reads event recordings with software that is not ours.

peers.py write EVENTS.npy WIDTH HEIGHT FOLDER   writes FOLDER/<peer>.<format>... for every peer and format
peers.py read FOLDER                            reads FOLDER/<format>.* with every peer, saves <format>.<peer>.npy
peers.py imu FILE                               prints FILE's inertial samples as dv-processing reads them, a line each:
                                                us, then rates about x, y, z in rad/s, then acceleration in m/s^2
peers.py time FILE                              decodes FILE with faery, prints events and seconds
"""

import pathlib
import sys
import time

import numpy as np

DTYPE = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")])

EVENT_PACKET = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
"""


def columns(events, dtype):
    out = np.zeros(len(events), dtype=dtype)
    names = {"p": "on" if "on" in out.dtype.names else "p"}
    for name in ("t", "x", "y", "p"):
        out[names.get(name, name)] = events[name]
    return out


def write_faery(events, size, folder):
    import faery

    stream = lambda: faery.events_stream_from_array(columns(events, faery.EVENTS_DTYPE), size)
    for name, options in {
        "faery.evt2.raw": {"version": "evt2"},
        "faery.evt3.raw": {"version": "evt3"},
        "faery.dat": {"version": "dat2"},
        "faery.es": {},
        "faery.csv": {},
        "faery.aedat4": {},
        "faery.zstd.aedat4": {"compression": ("zstd", 3)},
        "faery.none.aedat4": {"compression": None},
    }.items():
        stream().to_file(folder / name, zero_t0=False, **options)


def write_expelliarmus(events, folder):
    from expelliarmus import Wizard

    dtype = np.dtype([("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "u1")])
    for encoding, name in {"evt2": "expelliarmus.evt2.raw", "dat": "expelliarmus.dat"}.items():
        Wizard(encoding=encoding).save(fpath=folder / name, arr=columns(events, dtype))


def write_dv(events, size, folder):
    import dv_processing as dv

    store = dv.EventStore()
    for event in events:
        store.push_back(int(event["t"]), int(event["x"]), int(event["y"]), bool(event["p"]))
    for name, compression in {
        "dv.none.aedat4": dv.CompressionType.NONE,
        "dv.lz4.aedat4": dv.CompressionType.LZ4,
        "dv.zstd.aedat4": dv.CompressionType.ZSTD,
    }.items():
        config = dv.io.MonoCameraWriter.Config("PEER_1")
        config.compression = compression
        config.addEventStream(size)
        config.addImuStream()
        writer = dv.io.MonoCameraWriter(str(folder / name), config)
        writer.writeEvents(store)
        for index in range(3):
            writer.writeImu(dv.IMU(int(events[0]["t"]) + index, 30.0, 0.1, -1.0, 0.2, 10.0, 20.0, 30.0 + index, 0.0, 0.0, 0.0))
        del writer


def write_numpy(events, folder):
    np.savez(folder / "numpy.columns.npz", t=events["t"], x=events["x"], y=events["y"], p=events["p"])
    np.savez_compressed(folder / "numpy.records.npz", events=events)
    table = np.stack([events[name].astype(np.float64) for name in ("x", "y", "t", "p")], axis=1)
    np.save(folder / "numpy.table.npy", table)
    np.savetxt(folder / "numpy.txt", table)
    np.savetxt(folder / "numpy.txt.gz", table[:, [2, 0, 1, 3]], fmt="%d")


def evt3_words(events):
    words, high, low, row = [], None, None, None
    for event in events:
        t, x, y, on = (int(event[name]) for name in ("t", "x", "y", "p"))
        if (t >> 12) != high:
            # A sensor repeats this word often enough that no wrap is missed.
            for step in range((t >> 12) if high is None else high + 1, (t >> 12) + 1):
                words.append(0x8000 | (step & 0xFFF))
            high, low = t >> 12, None
        if (t & 0xFFF) != low:
            low = t & 0xFFF
            words.append(0x6000 | low)
        if y != row:
            row = y
            words.append(y)
        words.append(0x2000 | on << 11 | x)
    return words


def libcaer_bytes(events, base):
    out = np.zeros((len(events), 2), dtype="<u4")
    out[:, 0] = 1 | events["p"].astype(np.uint32) << 1 | events["y"].astype(np.uint32) << 2 | events["x"].astype(np.uint32) << 17
    out[:, 1] = events["t"] - base
    return out.tobytes()


def write_rosbags(events, size, folder):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    kind = "event_camera_msgs/msg/EventPacket"
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(EVENT_PACKET, kind))
    header = store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    packet = store.types[kind]
    words = np.array(evt3_words(events), dtype="<u2").tobytes()
    chunks = [words[at : at + 4096] for at in range(0, len(words), 4096)]
    for name, plugin in {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}.items():
        for encoding in ("evt3", "libcaer"):
            bag = folder / f"rosbags.{encoding}.{name}.bag"
            with Writer(bag, version=9, storage_plugin=plugin) as writer:
                if name == "mcap" and encoding == "libcaer":
                    pass
                topic = writer.add_connection("/event_camera/events", kind, typestore=store)
                if encoding == "evt3":
                    parts = [(0, chunk) for chunk in chunks]
                else:
                    parts = []
                    for at in range(0, len(events), 500):
                        part = events[at : at + 500]
                        base = int(part["t"][0])
                        parts.append((base * 1000, libcaer_bytes(part, base)))
                for seq, (base, data) in enumerate(parts):
                    message = packet(
                        header(stamp(seq, 0), "camera"),
                        size[1],
                        size[0],
                        seq,
                        base,
                        encoding,
                        False,
                        np.frombuffer(data, dtype=np.uint8),
                    )
                    writer.write(topic, 1_000_000 * seq, store.serialize_cdr(message, kind))


def write(events_path, width, height, folder):
    events = np.load(events_path)
    assert events.dtype.names == ("t", "x", "y", "on"), events.dtype
    events = np.array([tuple(event) for event in events.tolist()], dtype=DTYPE)
    size, folder = (width, height), pathlib.Path(folder)
    write_faery(events, size, folder)
    write_expelliarmus(events, folder)
    write_dv(events, size, folder)
    write_numpy(events, folder)
    write_rosbags(events, size, folder)


def read_faery(path):
    import faery

    return columns(rename(np.concatenate(list(faery.events_stream_from_file(path)))), DTYPE)


def rename(events):
    out = events.view()
    out.dtype = np.dtype({"names": ["t", "x", "y", "p"], "formats": ["<u8", "<u2", "<u2", "?"]})
    return out


def read_expelliarmus(encoding):
    def read(path):
        from expelliarmus import Wizard

        return columns(Wizard(encoding=encoding).read(fpath=path), DTYPE)

    return read


def read_dv(path):
    import dv_processing as dv

    recording = dv.io.MonoCameraRecording(str(path))
    parts = []
    while (batch := recording.getNextEventBatch()) is not None:
        events = batch.numpy()
        part = np.zeros(len(events), dtype=DTYPE)
        part["t"], part["x"], part["y"], part["p"] = events["timestamp"], events["x"], events["y"], events["polarity"]
        parts.append(part)
    return np.concatenate(parts)


def read_numpy(path):
    events = np.load(path)
    out = np.zeros(len(events), dtype=DTYPE)
    # The field has two names.
    out["t"], out["x"], out["y"], out["p"] = events["t"], events["x"], events["y"], events["p"]
    assert (events["p"] == events["on"]).all()
    return out


def read(folder):
    folder = pathlib.Path(folder)
    for name, peers in {
        "evt2.raw": {"faery": read_faery, "expelliarmus": read_expelliarmus("evt2")},
        "evt3.raw": {"faery": read_faery},
        "dat": {"faery": read_faery, "expelliarmus": read_expelliarmus("dat")},
        "aedat4": {"faery": read_faery, "dv": read_dv},
        "imu.aedat4": {"faery": read_faery, "dv": read_dv},
        "csv": {"faery": read_faery},
        "es": {"faery": read_faery},
        "npy": {"numpy": read_numpy},
    }.items():
        for peer, reader in peers.items():
            np.save(folder / f"{name}.{peer}.read.npy", reader(folder / f"ours.{name}"))


def print_imu(path):
    import dv_processing as dv

    recording = dv.io.MonoCameraRecording(path)
    while (batch := recording.getNextImuBatch()) is not None:
        for sample in batch:
            print(sample.timestamp, *sample.getAngularVelocities(), *sample.getAccelerations())


def clock(path):
    import faery

    best, count = None, 0
    for _ in range(5):
        start = time.perf_counter()
        count = sum(len(part) for part in faery.events_stream_from_file(path))
        spent = time.perf_counter() - start
        best = spent if best is None else min(best, spent)
    print(count, best)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["write", events, width, height, folder]:
            write(events, int(width), int(height), folder)
        case ["read", folder]:
            read(folder)
        case ["imu", path]:
            print_imu(path)
        case ["time", path]:
            clock(path)
        case _:
            sys.exit(__doc__)
