#!/usr/bin/env bash
# Makes a virtual environment for the interop tests and prints where its Python is.
#   setup.sh          the peers that recordings are compared with
#   setup.sh visa     PyVISA, which talks to the device
set -euo pipefail
root="$(cd "$(dirname "$0")/../.." && pwd)"
case "${1:-}" in
    visa)
        venv="${CARGO_TARGET_DIR:-$root/target}/venv-visa"
        wanted="pyvisa==1.16.2 pyvisa-py==0.8.1 pyserial==3.5"
        ;;
    *)
        venv="${CARGO_TARGET_DIR:-$root/target}/venv"
        wanted="faery==0.7.1 dv-processing==2.0.4 expelliarmus==1.1.12 rosbags==0.11.9 numpy<3"
        ;;
esac
if [ "$(cat "$venv/peers.txt" 2>/dev/null || true)" != "$wanted" ]; then
    python3 -m venv "$venv" >&2
    # shellcheck disable=SC2086 # a list of requirements
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check $wanted >&2
    printf '%s' "$wanted" > "$venv/peers.txt"
fi
echo "$venv/bin/python"
