#!/usr/bin/env bash
# Loads an image into a connected board with OpenOCD and starts it: what `cmake --build --preset BOARD --target flash` runs.
#
#   flash.sh zcu102|mps2 IMAGE.elf
#
# ZCU102 under Linux: toolchains/remoteproc.sh. MPS2 from its memory card: toolchains/mps2_card.sh.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

fail() {
    echo "flash.sh: $*" >&2
    exit 1
}
[ $# -eq 2 ] || fail "usage: flash.sh zcu102|mps2 IMAGE.elf"
board=$1 image=$2
config=$here/openocd/$board.cfg
[ -e "$config" ] || fail "no such board: $board (zcu102 or mps2)"
[ -e "$image" ] || fail "no image $image: build the board's preset first"
type -P openocd >/dev/null || fail "openocd is not installed: apt-get install openocd"

case $board in
    zcu102) where="USB connector J2 (JTAG) to this PC, board powered and booted" ;;
    mps2) where="USB connector of the board to this PC, board powered" ;;
esac
log=$(mktemp)
trap 'rm -f "$log"' EXIT
code=0
openocd -f "$config" -c "flash_radar {$image}" 2>&1 | tee "$log" || code=$?
[ "$code" -ne 0 ] || exit 0
if grep -qE "no device found|unable to find|unable to open|No CMSIS-DAP|LIBUSB_ERROR_ACCESS" "$log"; then
    grep -q LIBUSB_ERROR_ACCESS "$log" &&
        fail "the board's adapter is there, but not for this user: add yourself to the group plugdev, or use sudo"
    fail "no $board found: $where?"
fi
fail "the board was found but could not be loaded (OpenOCD's exit code $code): power it off and on, then try again"
