# SPDX-License-Identifier: BSD-3-Clause
function __trifinger_complete
  set -l words (commandline -opc)
  set -e words[1]
  set -l last (commandline -ct)
  trifinger __complete $words "$last" 2>/dev/null
end
complete -c trifinger -a '(__trifinger_complete)'
