#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs the packages in a folder on a bare Debian, uses them and removes them: tools/on_bare_debian runs this as root.
#
#   use_debian_packages.sh FOLDER
set -euo pipefail
folder=$1
consumers=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../consumer")
place=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT  # a robot that still runs

fail() { echo "failed: $*" >&2; exit 1; }
quietly() { "$@" >"$place/log" 2>&1 || { cat "$place/log" >&2; fail "$*"; }; }

quietly apt-get update
find / -xdev -not -path "$place*" | sort >"$place/before"

# The programs.
begin=$(date +%s)
quietly apt-get install --yes --no-install-recommends "$folder"/libtrifinger_*.deb "$folder"/trifinger_*.deb
trifinger --version
trifinger run sim >"$place/robot" 2>&1 &
robot=$!
for _ in $(seq 100); do
  trifinger status sim --once >/dev/null 2>&1 && break
  sleep 0.1
done
trifinger status sim --once
trifinger list | grep -q sim || fail "the robot is not listed"
echo "$(($(date +%s) - begin)) s from the package to a running robot"
trifinger stop sim
wait "$robot" || fail "the robot ended with $?: $(cat "$place/robot")"
trifinger run sim --set fingers.height=0.3 >"$place/robot" 2>&1 &
robot=$!
for _ in $(seq 100); do
  trifinger status sim --once >/dev/null 2>&1 && break
  sleep 0.1
done
(cd "$place" && trifinger manipulate lift) | tee "$place/lift"
grep -qE "height +0\.(199[0-9]*|2|20[0-9]*) m" "$place/lift" || fail "the cube is not lifted"
trifinger stop sim
wait "$robot"

# Services, rights, documents.
for file in /usr/lib/systemd/system/trifinger{,-endurance}@.service /usr/lib/udev/rules.d/99-trifinger.rules \
  /etc/security/limits.d/99-trifinger.conf /usr/share/man/man1/trifinger-job.1.gz \
  /usr/share/doc/trifinger/trifinger.spdx.json /usr/share/doc/libtrifinger/libtrifinger.spdx.json \
  /usr/share/bash-completion/completions/trifinger; do
  [[ -s $file ]] || fail "$file is missing"
done
id trifinger | grep -q realtime || fail "the user of the services may not use real-time priorities"

# Programs of others.
quietly apt-get install --yes --no-install-recommends "$folder"/libtrifinger-dev_*.deb g++ cmake make
for project in core control sim; do
  quietly cmake -S "$consumers/$project" -B "$place/$project"
  quietly cmake --build "$place/$project"
  "$place/$project/consumer"
done

# Nothing is left but the user and what an administrator may have changed.
quietly apt-get remove --yes trifinger libtrifinger libtrifinger-dev
[[ -e /etc/security/limits.d/99-trifinger.conf ]] || fail "removing took the settings away, too"
[[ ! -e /usr/bin/trifinger ]] || fail "the program is still there"
quietly apt-get purge --yes trifinger
quietly apt-get autoremove --yes --purge
find / -xdev -not -path "$place*" | sort >"$place/after"
left=$(comm -13 "$place/before" "$place/after" | grep -i trifinger | grep -v "^/root/\|^/var/lib/dpkg/" || true)
[[ -z $left ]] || fail "left behind: $left"
id trifinger >/dev/null
echo "nothing is left behind"
