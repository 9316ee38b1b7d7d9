#!/usr/bin/env bash
# Runs every check and installs what that needs. Continuous integration and people run this very script.
set -euo pipefail
cd "$(dirname "$0")"
cargo fmt --all --check
cargo clippy --workspace --all-targets -- -D warnings
cargo test
