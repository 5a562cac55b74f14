#!/bin/busybox sh
# First process of the emulated kernel that run_with_vcan.sh starts: loads the CAN and 9p modules, puts the host's root
# (read-only) under a few writable places, runs the command in it and powers the machine off.
export PATH=/bin
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /host /run
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
while read -r module; do
    insmod "/modules/$module.ko" || echo "guest_init: $module not loaded"
done </modules/order

share_options=trans=virtio,version=9p2000.L,msize=262144
mount -t 9p -o $share_options,cache=loose,ro host /host || poweroff -f
mount -t proc proc /host/proc
mount -t sysfs sys /host/sys
mount -t devtmpfs dev /host/dev
mkdir -p /host/dev/pts /host/dev/shm
mount -t devpts -o mode=620,ptmxmode=666 devpts /host/dev/pts
mount -t tmpfs tmpfs /host/dev/shm
mount -t tmpfs tmpfs /host/run
mkdir -p /host/run/share /host/run/out /host/run/tmp /host/run/lock
mount -t 9p -o $share_options,cache=none share /host/run/share || poweroff -f
mount -t 9p -o $share_options,cache=none out /host/run/out || poweroff -f
[ -e /dev/fd ] || ln -s /proc/self/fd /dev/fd
hostname vcan-guest
# An emulated board inside this one asks for 2 GiB and uses little of it.
echo 1 >/proc/sys/vm/overcommit_memory
ip link set lo up

# Through a pipe, because the port can be opened only once and programs open /dev/stdout again.
{
    env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/run TMPDIR=/run/tmp LANG=C.UTF-8 \
        chroot /host /bin/bash /run/share/command </dev/null 2>&1
    echo $? >/run/exit_code
} | cat >"$(echo /dev/vport*p1)"
cp /run/exit_code /host/run/share/exit_code
sync
poweroff -f
