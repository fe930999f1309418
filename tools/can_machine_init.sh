#!/bin/busybox sh
# SPDX-License-Identifier: BSD-3-Clause
# The first process of the virtual machine of tools/can_machine.py. It makes six CAN interfaces,
# mounts control groups, runs the tests, sends their results through the second serial port, and
# switches the machine off.

/bin/busybox mkdir -p /proc /sys /dev /tmp /root /sbin /usr/bin /usr/sbin
/bin/busybox --install -s
export PATH=/bin:/sbin:/usr/bin:/usr/sbin HOME=/root TRIFINGER_CONFIG_DIR=/config
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs dev /dev
mkdir -p /dev/shm /results
mount -t cgroup2 groups /sys/fs/cgroup
mount -t tmpfs shm /dev/shm
uname -a

for module in /modules/*; do insmod "$module"; done
for i in 0 1 2 3 4 5; do
    ip link add dev "vcan$i" type vcan
    ip link set "vcan$i" up
done

# NAME PROGRAM ARGUMENTS: runs tests. A hang ends after 10 minutes of the machine's own time.
run() {
    name=$1
    shift
    echo "== $name after $(cut -d ' ' -f 1 /proc/uptime) s"
    timeout 600 "$@" --gtest_output="xml:/results/$name.xml"
    echo "$name $?" >>/results/exit_codes
}
export GTEST_COLOR=no TRIFINGER_TEST_CAN=vcan0 TRIFINGER_TEST_MACHINE=1
run can can_test --gtest_filter='*SocketCan*:VirtualInterface.*:InterfaceState.*'
run machine machine_test
echo "== end after $(cut -d ' ' -f 1 /proc/uptime) s"

stty -F /dev/ttyS1 raw
tar -c -C /results . >/dev/ttyS1
poweroff -f
