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
export TRIFINGER_SESSION_DIR=$place  # other demos may run

fail() { echo "failed: $*" >&2; exit 1; }

# Fails if a command takes more than a limit [ms] of a processor, in the best of five runs. On a quiet machine this is also
# the time that passes; on a busy one it says what the command itself needs.
within() {
  local limit=$1 least=1000000 took TIMEFORMAT='%U %S'
  shift
  for _ in 1 2 3 4 5; do
    took=$({ time "$@" >/dev/null; } 2>&1 | awk 'END {printf "%.0f", ($1 + $2) * 1000}')
    ((took < least)) && least=$took
  done
  echo "$least ms, at most $limit: $*"
  ((least <= limit)) || fail "too slow"
}

begin=$(date +%s)
"$python" -m venv "$place/environment"
source "$place/environment/bin/activate"
tag=$(python -c 'import sys; print("cp311" if sys.version_info < (3, 12) else "cp312-abi3")')
pip install --quiet "$folder"/trifinger-*-"$tag"-*.whl  # the file: the name is not ours on PyPI
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
