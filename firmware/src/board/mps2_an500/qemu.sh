#!/usr/bin/env bash
# Runs a firmware image on QEMU's mps2-an500: qemu.sh IMAGE [ARGUMENT...]
#
# -icount shift=N: an instruction takes 2^N ns, so that the board's timers count instructions and two
# runs are alike to the last bit. 0 counts finest; 2 is 250 MHz at one instruction a cycle, near the
# 216 MHz of the STM32F746. EVTACH_ICOUNT_SHIFT chooses.
set -euo pipefail
image=$1
shift
config=enable=on,target=native,arg=evtach
for argument in "$@"; do
  config+=,arg=${argument//,/,,}
done
exec qemu-system-arm -machine mps2-an500 -icount "shift=${EVTACH_ICOUNT_SHIFT:-0},sleep=off" \
  -display none -monitor none -serial none -semihosting-config "$config" -kernel "$image"
