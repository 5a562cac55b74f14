#!/bin/sh
# Starts the image on the ZCU102's real-time processor from the Linux that runs on the same chip, by the kernel's remoteproc.
#
#   remoteproc.sh [--host USER@BOARD] start IMAGE.elf
#   remoteproc.sh [--host USER@BOARD] stop|status
#
# With --host from a PC, over ssh; without it on the board itself, as root. The kernel needs CONFIG_XLNX_R5_REMOTEPROC and
# a device tree whose RPU is in lockstep (xlnx,cluster-mode = <1>) and which leaves uart0, uart1, can1 and ttc0 to the
# radar (status = "disabled") but not their clocks (boot with clk_ignore_unused). The image needs no resource table.
# --sysfs and --firmware name other folders than /sys/class/remoteproc and /lib/firmware.
set -eu

fail() {
    echo "remoteproc.sh: $*" >&2
    exit 1
}
host='' sysfs=/sys/class/remoteproc firmware=/lib/firmware
while [ $# -gt 0 ]; do
    case $1 in
        --host) host=${2:?--host needs USER@BOARD}; shift 2 ;;
        --sysfs) sysfs=${2:?--sysfs needs a folder}; shift 2 ;;
        --firmware) firmware=${2:?--firmware needs a folder}; shift 2 ;;
        -*) fail "unknown option $1" ;;
        *) break ;;
    esac
done
action=${1:-} image=${2:-}
case $action in
    start) [ -n "$image" ] || fail "start needs an image" ;;
    stop | status) ;;
    *) fail "usage: remoteproc.sh [--host USER@BOARD] start IMAGE.elf | stop | status" ;;
esac
if [ "$action" = start ] && [ ! -e "$image" ]; then
    fail "no image $image: cmake --build --preset zcu102-r5"
fi

if [ -n "$host" ]; then
    remote=
    if [ "$action" = start ]; then
        remote=/tmp/radar_zcu102.elf
        scp -q "$image" "$host:$remote" || fail "$host: the image could not be copied there (scp)"
    fi
    exec ssh "$host" sh -s -- "$action" $remote <"$0"
fi

processor=''
for candidate in "$sysfs"/remoteproc*; do
    [ -e "$candidate/name" ] || continue
    case $(cat "$candidate/name") in
        *r5*)
            [ -z "$processor" ] || fail "two real-time processors in $sysfs: the RPU is split, and the image needs it in" \
                "lockstep: xlnx,cluster-mode = <1> in the device tree"
            processor=$candidate
            ;;
    esac
done
[ -n "$processor" ] || fail "no real-time processor in $sysfs: does the kernel have CONFIG_XLNX_R5_REMOTEPROC, and the" \
    "device tree an RPU node (zynqmp-r5fss)?"

state() {
    cat "$processor/state"
}
# set_state WORD STATE WHY: writes WORD and looks whether that led to STATE.
set_state() {
    echo "$1" 2>/dev/null >"$processor/state" || true
    i=0
    while [ "$(state)" != "$2" ]; do
        i=$((i + 1))
        [ $i -le 20 ] || fail "the processor is '$(state)' after '$1', not '$2': $3"
        sleep 0.1
    done
}

if [ "$action" = status ]; then
    echo "$(basename "$processor") ($(cat "$processor/name")): $(state), firmware $(cat "$processor/firmware")"
    exit 0
fi
[ -w "$processor/state" ] || fail "$processor/state cannot be written: run it as root"
[ "$(state)" = offline ] || set_state stop offline "see dmesg"
if [ "$action" = start ]; then
    cp "$image" "$firmware/radar_zcu102.elf" || fail "$firmware cannot be written: is it on a read-only file system?"
    echo radar_zcu102.elf >"$processor/firmware"
    set_state start running "the kernel refused the image; dmesg | grep remoteproc says why"
fi
echo "$(basename "$processor"): $(state)"
