#!/usr/bin/env bash
# Makes the virtual environment with the peers that the interop tests compare with; prints where its Python is.
set -euo pipefail
root="$(cd "$(dirname "$0")/../.." && pwd)"
venv="${CARGO_TARGET_DIR:-$root/target}/venv"
wanted="faery==0.7.1 dv-processing==2.0.4 expelliarmus==1.1.12 rosbags==0.11.9 numpy<3"
if [ "$(cat "$venv/peers.txt" 2>/dev/null || true)" != "$wanted" ]; then
    python3 -m venv "$venv" >&2
    # shellcheck disable=SC2086 # a list of requirements
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check $wanted >&2
    printf '%s' "$wanted" > "$venv/peers.txt"
fi
echo "$venv/bin/python"
