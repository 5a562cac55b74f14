#!/usr/bin/env bash
# Puts an image on the memory card of an MPS2 or MPS2+ board, from which the board loads it at every start.
#
#   mps2_card.sh an386|an500 IMAGE.elf CARD
#
# CARD is where the board's USB drive (V2M-MPS2) is mounted, or the card itself. The board's controller reads which
# FPGA image and which program it loads from MB/HBI0263<revision>: this script names both there, and keeps what it changes
# as .bak. The FPGA images come with the board or from Arm and must be on the card.
set -euo pipefail

fail() {
    echo "mps2_card.sh: $*" >&2
    exit 1
}
[ $# -eq 3 ] || fail "usage: mps2_card.sh an386|an500 IMAGE.elf CARD"
application=${1^^} image=$2 card=$3
[[ $application =~ ^AN(386|500)$ ]] || fail "no such FPGA image: $1 (an386 or an500)"
[ -e "$image" ] || fail "no image $image: cmake --build --preset mps2-${1,,}"
shopt -s nullglob nocaseglob
boards=("$card"/MB/HBI0263?)
[ ${#boards[@]} -eq 1 ] || fail "$card: no MB/HBI0263<revision> on it: is this the board's drive, and is it mounted?"
board=${boards[0]}
fpga=("$board/$application"/*.txt)
[ ${#fpga[@]} -gt 0 ] || fail "$board: no FPGA image $application: copy its folder from Arm's application note $application"
[ -e "$board/board.txt" ] || fail "$board/board.txt is missing: restore the card from Arm's recovery files"

# Names on the card are 8.3, or the board does not find them.
mkdir -p "$card/SOFTWARE"
cp "$image" "$card/SOFTWARE/RADAR.AXF"
images=$board/$application/images.txt
[ ! -e "$images" ] || cp "$images" "${images%.txt}.bak"
printf '%s\r\n' "TITLE: Versatile Express Images Configuration File" "" "[IMAGES]" "TOTALIMAGES: 1" "" \
    "IMAGE0ADDRESS: 0x00000000" 'IMAGE0FILE: \SOFTWARE\RADAR.AXF' >"$images"
# board.txt names the FPGA image's own description, AN386\an386_v?.txt, which in turn names images.txt.
for file in "${fpga[@]}"; do
    [[ ${file##*/} == images.txt ]] || description=${file##*/}
done
[ -n "${description:-}" ] || fail "$board/$application: the FPGA image's description is missing beside images.txt"
cp "$board/board.txt" "$board/board.bak"
sed -i -E "s|^(APPFILE:[[:space:]]*)[^;[:space:]]*|\1$application\\\\$description|" "$board/board.txt"
grep -qi "^APPFILE:.*$application" "$board/board.txt" || fail "$board/board.txt has no APPFILE line: restore the card"
sync
echo "$application with $(basename "$image") on $card: eject it, then press the board's reset button"
