#!/usr/bin/env bash
# Every check, and the tools they need. Continuous integration and people run this very script.
#
#   ./ci.sh            all steps, in this order: install format lint test bench board docs image budget fuzz deny
#   ./ci.sh STEP...    only these
#
# Some 40 minutes on two cores from nothing; half of it is compiling.
set -euo pipefail
cd "$(dirname "$0")"

target=thumbv7em-none-eabihf

# A red run must be red again when it is repeated. `cargo test` by hand draws new cases each time, and so does
# fuzz/run.sh.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-20260101}
# What is built only once keeps nothing for the next time, and no debugger sees it: a panic names its line all the same.
[ -z "${CI:-}" ] || export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=none

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

step_install() {
  if ! command -v rustup >/dev/null; then
    echo "rustup is missing: see https://rustup.rs, then run this again"
    exit 2
  fi
  # Any cargo command installs the toolchain that rust-toolchain.toml names, its target included,
  # unless rustup was told not to.
  cargo --version
  rustup target list --installed | grep -qx "$target" || rustup target add "$target"

  if ! command -v qemu-system-arm >/dev/null && ! install_qemu; then
    echo "qemu-system-arm could not be installed: do it by hand. Until then the tests on the emulated board are skipped."
  fi
  if ! command -v cmake >/dev/null && ! install_cmake; then
    echo "cmake could not be installed: do it by hand. Until then the tests on the emulated STM32F746G-DISCO are skipped."
  fi
  # Takes minutes, and other steps leave a core idle now and then.
  install_deny &
  deny=$!
}

# Done where CI is set, left to people.
install_deny() {
  [ -z "${CI:-}" ] || command -v cargo-deny >/dev/null || nice cargo install cargo-deny --locked --quiet --debug
}

# What the emulated STM32F746G-DISCO is built with.
install_cmake() {
  command -v apt-get >/dev/null || return 1
  as_root apt-get update -q &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -yq --no-install-recommends cmake
}

install_qemu() {
  command -v apt-get >/dev/null || return 1
  as_root apt-get update -q &&
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -yq --no-install-recommends qemu-system-arm
}

step_format() {
  cargo fmt --all --check
}

step_lint() {
  cargo clippy --workspace --all-targets -- -D warnings
  # What only the device compiles; and with all that it may log, which no program here links yet.
  cargo clippy -p evtach-core -p evtach-firmware --target "$target" -- -D warnings
  cargo clippy -p evtach-core -p evtach-firmware --target "$target" \
    --features evtach-core/defmt,evtach-firmware/defmt,evtach-firmware/stm32f746g-disco -- -D warnings
}

step_test() {
  # The images that tests run on the emulated boards are linked by one core each: beside the other tests, none of which waits.
  # Should one not build, the test that asks for it says so.
  if command -v qemu-system-arm >/dev/null; then
    (cargo fw-qemu && cargo fw) >/dev/null 2>&1 &
    images=$!
  fi
  cargo test --workspace
  [ -z "${images:-}" ] || wait "$images" || true
}

# The one that the tests have compiled, which looks for overflow. `cargo run` would compile another: without the tests, some
# dependencies have fewer features.
evtach() {
  cargo test --workspace --no-run --quiet
  "${CARGO_TARGET_DIR:-target}/debug/evtach" "$@"
}

# A few minutes of three of the tables: two fail where a reading is more than 1 % off or told where no rotor is, one where a mean over
# the speeds is more than twice what is asked of it.
step_bench() {
  evtach bench accuracy --only speeds --seeds 2 --tuning
  evtach bench blind --quick
  evtach bench trust --quick
}

# The emulated STM32F746G-DISCO itself, which is a workspace of its own; `test` runs the device's image on it.
step_board() {
  cargo fmt --manifest-path tests/board/Cargo.toml --check
  if ! command -v cmake >/dev/null; then
    echo "skipped: no cmake"
    return
  fi
  local board=(--release --manifest-path tests/board/Cargo.toml --target-dir target/board)
  cargo clippy "${board[@]}" --all-targets -- -D warnings
  cargo test "${board[@]}"
}

step_docs() {
  RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
}

# The limits on the core's state and store are assertions in the firmware: past them it does not build.
step_image() {
  cargo build --profile firmware -p evtach-core --target "$target"
  cargo fw-qemu
  cargo fw
}

# Instructions, counted in QEMU, and memory: both fail past what is asked.
step_budget() {
  if ! command -v qemu-system-arm >/dev/null; then
    echo "skipped: no qemu-system-arm"
    return
  fi
  # Each is one core's work.
  local cost failed=0
  cost=$(mktemp)
  evtach bench cost >"$cost" 2>&1 &
  evtach bench budget || failed=1
  wait $! || failed=1
  cat "$cost"
  return $failed
}

# A smoke run over the seeds, without cargo-fuzz and its instrumentation; fuzz/run.sh is the real thing.
step_fuzz() {
  if ! rustup toolchain list | grep -q '^nightly'; then
    echo "skipped: no nightly toolchain"
    return
  fi
  # What runs for two seconds each need not be fast.
  (cd fuzz && CARGO_TARGET_DIR=target CARGO_PROFILE_RELEASE_OPT_LEVEL=1 cargo build --release)
  printf '%s\0' fuzz/seeds/*/ | xargs -0 -n 1 -P 2 bash -c 'set -o pipefail; fuzz_from "$1"' _
}

# Two seconds from these seeds.
fuzz_from() {
  local program found
  program=$(basename "$1")
  found=$(mktemp -d)
  "fuzz/target/release/$program" "$found" "$1" \
    -max_total_time=2 -rss_limit_mb=1024 -timeout=20 -artifact_prefix="$found/" 2>&1 | tail -n 1 | sed "s/^/$program: /"
}
export -f fuzz_from

step_deny() {
  if [ -n "${deny:-}" ]; then
    wait "$deny"
  else
    install_deny
  fi
  if ! command -v cargo-deny >/dev/null; then
    echo "skipped: no cargo-deny (cargo install cargo-deny --locked)"
    return
  fi
  cargo deny check bans licenses sources
  # The emulated board has its own rules: its processor is GPL-2.0.
  cargo deny --manifest-path tests/board/Cargo.toml --config tests/board/deny.toml check bans licenses sources
  # The database of advisories lies on GitHub, out of reach of some machines. That it cannot be
  # fetched is no finding; what it says is.
  if cargo deny fetch db 2>/dev/null; then
    cargo deny check advisories
  else
    echo "skipped: the database of advisories cannot be fetched"
  fi
}

steps=("$@")
[ ${#steps[@]} -gt 0 ] || steps=(install format lint test bench board docs image budget fuzz deny)
for step in "${steps[@]}"; do
  if ! declare -F "step_$step" >/dev/null; then
    echo "ci.sh: no step \"$step\": choose from install format lint test bench board docs image budget fuzz deny"
    exit 2
  fi
done
for step in "${steps[@]}"; do
  printf '\n==== %s ====\n' "$step"
  SECONDS=0
  "step_$step"
  echo "---- $step: done in $SECONDS s"
done
