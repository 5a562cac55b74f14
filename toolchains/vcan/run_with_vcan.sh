#!/usr/bin/env bash
# Runs a command where a real virtual CAN interface, vcan0, is up.
#
#   run_with_vcan.sh [--timeout SECONDS] [--out DIR] [--kernel own|emulated] COMMAND [ARGUMENT...]
#
# A machine whose kernel has PF_CAN runs COMMAND directly, in a network namespace of its own: interfaces of the same name
# outside are neither seen nor touched, and no privilege is needed where user namespaces are allowed. Where the kernel
# has no PF_CAN (most containers and build machines), a Debian kernel is started under qemu-system-x86_64 with this
# machine's files read-only below it, and COMMAND runs in that. --kernel asks for one of the two.
#
# COMMAND runs as root, from the current directory, with nothing on its standard input. Its output and exit code are
# those of this script. It may write to $TMPDIR, which is lost, and to $VCAN_OUT, which is DIR (default: a temporary
# folder). Exit code 124: not finished within SECONDS (default 120). Where neither kernel can be had, it prints a line
# that starts with SKIPPED: and returns 125; 126: the emulated kernel stopped before COMMAND ended.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
timeout_s=120
out=
kernel=any

fail() {
    echo "run_with_vcan.sh: $*" >&2
    exit 2
}
while [ $# -gt 0 ]; do
    case $1 in
        --timeout) timeout_s=${2:?--timeout needs seconds}; shift 2 ;;
        --out) out=${2:?--out needs a folder}; shift 2 ;;
        --kernel) kernel=${2:?--kernel needs own or emulated}; shift 2 ;;
        --) shift; break ;;
        -*) fail "unknown option $1" ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || fail "usage: run_with_vcan.sh [--timeout SECONDS] [--out DIR] [--kernel own|emulated] COMMAND..."
[[ $timeout_s =~ ^[1-9][0-9]*$ ]] || fail "--timeout $timeout_s: not a number of seconds"
[[ $kernel =~ ^(any|own|emulated)$ ]] || fail "--kernel $kernel: own or emulated"
command=$(type -P "$1") || fail "no such command: $1"
[[ $command == /* ]] || command=$PWD/$command
shift

scratch=$(mktemp -d)
children=()
clean_up() {
    for child in "${children[@]}"; do kill "$child" 2>/dev/null || true; done
    rm -rf "$scratch"
}
trap clean_up EXIT
trap 'exit 143' TERM INT HUP
if [ -z "$out" ]; then
    out=$scratch/out
fi
mkdir -p "$out"
out=$(cd "$out" && pwd)

# --- this machine's own kernel ------------------------------------------------------------------------------------
# The process namespace sees to it that nothing COMMAND has started outlives it.
namespace=(unshare --pid --fork --kill-child)
# The emulated kernel is nobody else's; interfaces that a line discipline makes (slcan) appear in its first network.
[ -n "${VCAN_GUEST:-}" ] || namespace+=(--net)
[ "$(id -u)" = 0 ] || namespace+=(--user --map-root-user)
set_up='ip link add dev vcan0 type vcan && ip link set vcan0 up mtu 72'

own_kernel_has_can() {
    timeout 20 unshare --net $([ "$(id -u)" = 0 ] || echo --user --map-root-user) sh -c "$set_up" >"$scratch/own" 2>&1
}
run_here() {
    mkdir -p "$scratch/tmp"
    TMPDIR=$scratch/tmp VCAN_OUT=$out timeout -k 5 "$timeout_s" "${namespace[@]}" \
        sh -c "$set_up"' && "$@"; exit $?' sh "$command" "$@" </dev/null &
    children=($!)
    local code=0
    wait $! || code=$?
    children=()
    return $code
}

# --- a Debian kernel under emulation ------------------------------------------------------------------------------
cache=$here/../../build/vcan_kernel
# In the order they have to be loaded.
modules=(can-dev can can-raw slcan vcan virtio_ring virtio virtio_pci_modern_dev virtio_pci_legacy_dev virtio_pci
         virtio_console netfs fscache 9pnet 9pnet_virtio 9p sch_tbf)

no_kernel() {
    echo "SKIPPED: no virtual CAN: this kernel has no PF_CAN ($(tail -n1 "$scratch/own" 2>/dev/null)), and $*"
    exit 125
}
# Leaves vmlinuz and initramfs.gz in the cache. Several may come at once.
fetch_kernel() {
    local tool
    for tool in qemu-system-x86_64 busybox cpio; do
        type -P $tool >/dev/null || no_kernel "$tool is missing: apt-get install qemu-system-x86 busybox-static cpio"
    done
    mkdir -p "$cache"
    exec 8>"$cache/lock"
    flock 8
    local made_from
    made_from=$(cat "${BASH_SOURCE[0]}" "$here/guest_init.sh" | sha256sum)
    if [ ! -s "$cache/vmlinuz" ]; then
        type -P apt-get >/dev/null || no_kernel "there is no apt-get to fetch a Debian kernel with"
        local package
        package=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/ *Depends: *\(linux-image-[^ ]*\)$/\1/p')
        [ -n "$package" ] || no_kernel "apt knows no linux-image-amd64: apt-get update"
        (cd "$scratch" && apt-get download -q "$package" >"$scratch/apt" 2>&1) ||
            no_kernel "$package could not be fetched ($(tail -n1 "$scratch/apt")): apt-get update"
        mkdir "$scratch/deb"
        dpkg -x "$scratch"/linux-image-*.deb "$scratch/deb"
        rm -rf "$cache/modules"
        mkdir "$cache/modules"
        local module
        for module in "${modules[@]}"; do
            find "$scratch/deb" -name "$module.ko" -exec cp {} "$cache/modules/" \;
        done
        cp "$scratch"/deb/boot/vmlinuz-* "$cache/vmlinuz.new"
        rm -rf "$scratch/deb" "$scratch"/linux-image-*.deb
        mv "$cache/vmlinuz.new" "$cache/vmlinuz"
        rm -f "$cache/made_from"
    fi
    if [ "$made_from" != "$(cat "$cache/made_from" 2>/dev/null)" ]; then
        local root=$scratch/initramfs
        mkdir -p "$root/bin" "$root/modules"
        cp "$(type -P busybox)" "$root/bin/busybox"
        cp "$here/guest_init.sh" "$root/init"
        chmod +x "$root/init"
        cp "$cache"/modules/*.ko "$root/modules/"
        printf '%s\n' "${modules[@]}" >"$root/modules/order"
        (cd "$root" && find . | cpio -o -H newc 2>/dev/null | gzip -1) >"$cache/initramfs.gz"
        echo "$made_from" >"$cache/made_from"
    fi
    flock -u 8
    exec 8>&-
}
run_emulated() {
    fetch_kernel
    # What the guest has to run, and what comes back but the output: the exit code.
    local share=$scratch/share
    mkdir -p "$share"
    {
        echo "cd $(printf %q "$PWD")"
        printf 'VCAN_GUEST=1 exec %q --kernel own --timeout %q --out /run/out --' "${BASH_SOURCE[0]}" "$timeout_s"
        printf ' %q' "$command" "$@"
        echo
    } >"$share/command"
    chmod +x "$share/command"

    mkfifo "$scratch/output"
    local boot_s=120
    timeout -k 5 $((timeout_s + boot_s)) qemu-system-x86_64 -M pc -accel tcg,thread=multi -cpu max -smp 2 -m 2048 \
        -kernel "$cache/vmlinuz" -initrd "$cache/initramfs.gz" -append "console=ttyS0 panic=-1 quiet" \
        -nodefaults -display none -no-reboot -serial "file:$scratch/boot.txt" \
        -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
        -virtfs "local,path=$share,mount_tag=share,security_model=none" \
        -virtfs "local,path=$out,mount_tag=out,security_model=none" \
        -device virtio-serial-pci -chardev "file,id=output,path=$scratch/output" -device virtserialport,chardev=output,name=output \
        </dev/null 2>"$scratch/qemu.txt" &
    children=($!)
    cat "$scratch/output" & # a pipe and not a file: lines appear as they are written
    children+=($!)
    local code=0
    wait "${children[0]}" || code=$?
    timeout 5 tail --pid="${children[1]}" -f /dev/null || true
    children=()
    if [ -s "$share/exit_code" ]; then
        return "$(cat "$share/exit_code")"
    fi
    {
        echo "run_with_vcan.sh: the emulated kernel stopped (emulator's exit code $code) before $command ended. It said:"
        cat "$scratch/qemu.txt"
        tail -n 20 "$scratch/boot.txt" 2>/dev/null || true
    } >&2
    return 126
}

code=0
if [ $kernel != emulated ] && own_kernel_has_can; then
    run_here "$@" || code=$?
elif [ $kernel = own ]; then
    echo "SKIPPED: no virtual CAN: this kernel has no PF_CAN, or namespaces are forbidden ($(tail -n1 "$scratch/own"))"
    code=125
else
    run_emulated "$@" || code=$?
fi
exit $code
