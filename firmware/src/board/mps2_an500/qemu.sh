#!/usr/bin/env bash
# Runs a firmware image on QEMU's mps2-an500: qemu.sh IMAGE [ARGUMENT...]
#
# -icount shift=N: an instruction takes 2^N ns, so that the board's timers count instructions and two
# runs are alike to the last bit. 0 counts finest; 2 is 250 MHz at one instruction a cycle, near the
# 216 MHz of the STM32F746. EVTACH_ICOUNT_SHIFT chooses.
#
# EVTACH_FLASH names a file of at most 16 MiB that stands in a serial flash behind the SPI controller.
#
# EVTACH_SERIAL names where the serial port leads, in QEMU's words: pty, tcp::5025,server=on,wait=off, ... Then the
# board's time keeps to that of the world. Without it the port is not connected and time flies while the board sleeps.
set -euo pipefail
image=$1
shift
config=enable=on,target=native,arg=evtach
for argument in "$@"; do
  config+=,arg=${argument//,/,,}
done
options=()
if [ -n "${EVTACH_FLASH:-}" ]; then
  # The chip is as large as it is: what follows the file reads as zeros. The copy has no name left once QEMU runs.
  chip=$(mktemp)
  cp -- "$EVTACH_FLASH" "$chip"
  truncate -s 16M "$chip"
  exec 3<>"$chip"
  rm -- "$chip"
  options+=(-drive if=none,id=flash,format=raw,file=/dev/fd/3 -device n25q128a11,drive=flash)
fi
sleep=off
[ -z "${EVTACH_SERIAL:-}" ] || sleep=on
exec qemu-system-arm -machine mps2-an500 -icount "shift=${EVTACH_ICOUNT_SHIFT:-0},sleep=$sleep" \
  -display none -monitor none -serial "${EVTACH_SERIAL:-none}" "${options[@]}" \
  -semihosting-config "$config" -kernel "$image"
