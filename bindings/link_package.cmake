# SPDX-License-Identifier: BSD-3-Clause
# Links everything in the folder SOURCE into the folder TARGET, and removes links to what is gone.
file(GLOB present LIST_DIRECTORIES true "${TARGET}/*")
foreach(path IN LISTS present)
  if(IS_SYMLINK "${path}" AND NOT EXISTS "${path}")
    file(REMOVE "${path}")
  endif()
endforeach()

file(GLOB sources LIST_DIRECTORIES true RELATIVE "${SOURCE}" "${SOURCE}/*")
list(REMOVE_ITEM sources __pycache__)
file(MAKE_DIRECTORY "${TARGET}")
foreach(name IN LISTS sources)
  if(NOT EXISTS "${TARGET}/${name}")
    file(CREATE_LINK "${SOURCE}/${name}" "${TARGET}/${name}" SYMBOLIC)
  endif()
endforeach()
