#compdef trifinger
# SPDX-License-Identifier: BSD-3-Clause
_trifinger() {
  local -a found
  found=(${(f)"$(trifinger __complete "${(@)words[2,CURRENT]}" 2>/dev/null)"})
  compadd -a found || _files
}
if [[ $funcstack[1] == _trifinger ]]; then _trifinger "$@"; else compdef _trifinger trifinger; fi
