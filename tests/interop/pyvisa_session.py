"""A session as a laboratory would write it, with stock PyVISA.

    pyvisa_session.py PORT OUT.ev8

PORT is a serial port (/dev/ttyACM0, a pseudo-terminal) or a VISA resource (TCPIP::127.0.0.1::5025::SOCKET). Prints one
JSON object with what it found, and saves the recording that it made to OUT.ev8.
"""

import json
import sys
import time

import pyvisa


def open_device(port):
    resource = port if "::" in port else f"ASRL{port}::INSTR"
    device = pyvisa.ResourceManager("@py").open_resource(resource)
    device.read_termination = device.write_termination = "\n"
    device.timeout = 5_000
    if resource.startswith("ASRL"):
        device.baud_rate = 115_200
    return device


def main(port, out):
    device = open_device(port)
    found = {}
    device.write("*CLS")
    found["identity"] = device.query("*IDN?")

    device.write("*RST;UNIT HZ;:SENSe:BLADes 5;:CALCulate:LIMit:UPPer 30 HZ")
    found["blades"] = int(device.query("SENSe:BLADes?"))
    found["limit_hz"] = float(device.query("CALCulate:LIMit:UPPer?"))
    found["unit"] = device.query("UNIT?")

    found["speed_hz"] = float(device.query("MEASure?"))
    device.write("UNIT RPM")
    found["speed_rpm"] = float(device.query("FETCh?"))
    found["sigma_rpm"] = float(device.query("FETCh:SIGMa?"))
    found["direction"] = device.query("FETCh:DIRection?")
    found["alarm"] = int(device.query("CALCulate:LIMit:FAIL?"))

    device.write("SENSe:BLADes 99")
    found["error"] = device.query("SYSTem:ERRor?")
    found["events"] = int(device.query("*ESR?"))
    found["no_error"] = device.query("SYSTem:ERRor?")

    device.write("SYSTem:LOG ON")
    found["log"] = json.loads(device.read())
    device.write("SYSTem:LOG OFF")
    # Lines that were on their way.
    while not (answer := device.query("*OPC?")).startswith("1"):
        assert answer.startswith("{"), answer

    device.write("DATA:RECord:STARt 100000")
    deadline = time.monotonic() + 60
    while device.query("DATA:RECord:STATe?") != "FULL":
        assert time.monotonic() < deadline, "the recorder does not fill"
        time.sleep(0.05)
    device.write("DATA:RECord?")
    recording = read_block(device)
    with open(out, "wb") as file:
        file.write(recording)
    found["bytes"] = len(recording)
    found["after"] = device.query("*OPC?")
    print(json.dumps(found))


def read_block(device):
    """An IEEE 488.2 definite length block: # digits length bytes, and the newline behind it."""
    assert device.read_bytes(1) == b"#"
    digits = int(device.read_bytes(1))
    length = int(device.read_bytes(digits))
    data = device.read_bytes(length, chunk_size=65_536)
    assert device.read_bytes(1) == b"\n"
    return data


if __name__ == "__main__":
    main(*sys.argv[1:])
