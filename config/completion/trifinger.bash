# SPDX-License-Identifier: BSD-3-Clause
_trifinger() {
  local IFS=$'\n'
  COMPREPLY=($(compgen -W "$(trifinger __complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)" \
    -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -o default -F _trifinger trifinger
