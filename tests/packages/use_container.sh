#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes the image of Containerfile from the wheels in a folder, and runs a demo and a robot: `./run release --check`.
#
#   use_container.sh FOLDER
#
# The base of the image is a bare Debian of this machine (tools/on_bare_debian keeps it), so that no registry is asked.
set -euo pipefail
root=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
folder=$(realpath "$1")
base=${XDG_CACHE_HOME:-$HOME/.cache}/trifinger/bookworm-with-git.tar
place=$(mktemp -d)
engine() { podman --root "$place/images" --runroot "$place/run" "$@"; }
cleanup() {
  engine rm --all --force >/dev/null 2>&1 || true
  engine rmi --all --force >/dev/null 2>&1 || true
  umount --recursive "$place" 2>/dev/null || true
  rm -rf --one-file-system "$place"
}
trap cleanup EXIT

fail() { echo "failed: $*" >&2; exit 1; }

# The container's apt and pip are set up as this machine's.
settings=()
for file in /etc/pip.conf ~/.config/pip/pip.conf /etc/apt/apt.conf.d/99* /etc/ssl/certs/ca-certificates.crt; do
  [[ -e $file ]] && settings+=(--volume "$file:$file:ro")
done
for folder_of_packages in $(grep -rhoE '(file://|[= ])/[^ ]+' /etc/pip.conf ~/.config/pip/pip.conf 2>/dev/null | sed -E 's#^(file://|[= ])##; s#/simple/?$##' | sort -u); do
  [[ -d $folder_of_packages ]] && settings+=(--volume "$folder_of_packages:$folder_of_packages:ro")
done
while read -r setting; do settings+=(--env "$setting"); done < <(env | grep ^PIP_ || true)

engine import "$base" docker.io/library/debian:12-slim >/dev/null
engine build --isolation=chroot --network=host "${settings[@]}" --pull=never --tag trifinger --file "$root/Containerfile" "$folder"

if engine run --rm --network=host trifinger --version >"$place/version" 2>&1; then
  demo=(engine run --rm --network=host trifinger demo)
  start=(engine run --rm --network=host --name robot --shm-size=256m --ulimit rtprio=99 --ulimit memlock=-1 trifinger run sim)
  inside=(engine exec robot trifinger)
else
  # Not even root may start a container on some machines. Then its commands run in its files.
  echo "no container can be started here: $(tail -n 1 "$place/version")"
  build() { buildah --root "$place/images" --runroot "$place/run" "$@"; }
  container=$(build from --pull-never trifinger)
  chrooted=(build run --isolation=chroot --network=host "$container" trifinger)
  demo=("${chrooted[@]}" demo) start=("${chrooted[@]}" run sim) inside=("${chrooted[@]}")
fi

"${demo[@]}" | tee "$place/lift"
grep -qE "cube lifted by +\+?20\.[0-9] cm" "$place/lift" || fail "the cube is not lifted"

"${start[@]}" >"$place/robot" 2>&1 &
robot=$!
for _ in $(seq 100); do
  "${inside[@]}" status sim --once >/dev/null 2>&1 && break
  sleep 0.1
done
"${inside[@]}" status sim --once
"${inside[@]}" stop sim
wait "$robot" || fail "the robot ended with $?: $(cat "$place/robot")"
echo "a demo, and a running robot"
