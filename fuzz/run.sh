#!/usr/bin/env bash
# Runs every fuzz target for SECONDS_EACH (default 120) from the seeds in the tree; stops at the first finding.
# Needs cargo-fuzz and a nightly toolchain. Memory above 1 GiB or an input that takes 20 s counts as a finding.
set -euo pipefail
cd "$(dirname "$0")"
seconds="${SECONDS_EACH:-120}"
targets=("$@")
[ ${#targets[@]} -gt 0 ] || mapfile -t targets < <(cargo +nightly fuzz list)
# SQLite, compiled into one file, defines a table twice on purpose.
export ASAN_OPTIONS="detect_odr_violation=0"
for target in "${targets[@]}"; do
  mkdir -p "corpus/$target"
  cargo +nightly fuzz run --release "$target" "corpus/$target" "seeds/$target" -- \
    -max_total_time="$seconds" -rss_limit_mb=1024 -timeout=20 -print_final_stats=1
done
