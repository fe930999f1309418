#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# What a new user does with the wheels in a folder: installs, imports, lifts a cube.
#
#   use_wheel.sh FOLDER [PYTHON]
set -euo pipefail
folder=$1
python=${2:-python3}
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

fail() { echo "failed: $*" >&2; exit 1; }

# Fails if none of 30 runs ends within a limit [ms]: other programs may be busy, too.
within() {
  local limit=$1 begin took
  shift
  for _ in $(seq 30); do
    begin=$(date +%s%N)
    "$@" >/dev/null
    took=$((($(date +%s%N) - begin) / 1000000))
    if ((took <= limit)); then
      echo "$took ms, at most $limit: $*"
      return
    fi
  done
  fail "$* takes $took ms, more than $limit"
}

begin=$(date +%s)
"$python" -m venv "$place/environment"
source "$place/environment/bin/activate"
pip install --quiet --find-links "$folder" trifinger
cd "$place"
lift=$(trifinger demo) || fail "the demo"
took=$(($(date +%s) - begin))
grep -E "cube lifted by +20\.[0-9] cm" <<<"$lift" || fail "the cube is not lifted: $lift"
echo "$took s from the wheel to a lifted cube, at most 60"
((took <= 60)) || fail "too slow"

packages=$(pip list --format=freeze | grep -vE '^(pip|setuptools)=' | sed 's/==.*//' | sort | tr '\n' ' ')
[[ $packages == "mujoco-core numpy trifinger " ]] || fail "these packages came along: $packages"
imported=$(python -c '
import sys
before = set(sys.modules)
import trifinger
new = {name.partition(".")[0] for name in set(sys.modules) - before}
print(*sorted(new - set(sys.stdlib_module_names)))')
[[ $imported == "numpy trifinger" ]] || fail "import trifinger imports $imported"
within 100 trifinger --help
within 300 python -c "import trifinger"
