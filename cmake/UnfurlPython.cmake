# The Python that the package is built for, and whether it is built at all.
#
# Python3_EXECUTABLE where that is given, else the system's: its packages are those of packages.txt, whatever
# another one that comes first on PATH may have. It needs headers and NumPy. UNFURL_PYTHON=AUTO builds the
# package where all of it is found, ON demands it.
if(UNFURL_PYTHON)  # AUTO counts as true
  if(NOT Python3_EXECUTABLE AND EXISTS /usr/bin/python3)
    set(Python3_EXECUTABLE /usr/bin/python3)
  endif()
  find_package(Python3 3.11 QUIET COMPONENTS Interpreter Development.Module NumPy)
  if(Python3_FOUND)  # else pybind11 would look for one itself
    find_package(pybind11 2.10 QUIET)
  endif()
  set(missing)
  if(NOT Python3_Interpreter_FOUND)
    list(APPEND missing "Python 3.11 or later")
  endif()
  if(NOT Python3_Development.Module_FOUND)
    list(APPEND missing "its headers (python3-dev)")
  endif()
  if(NOT Python3_NumPy_FOUND)
    list(APPEND missing "its NumPy (python3-numpy)")
  endif()
  if(Python3_FOUND AND NOT pybind11_FOUND)
    list(APPEND missing "pybind11 2.10 (pybind11-dev)")
  endif()
  list(JOIN missing ", " missing)
  if(NOT missing)
    message(STATUS "Python package: for ${Python3_EXECUTABLE}, Python ${Python3_VERSION}, NumPy ${Python3_NumPy_VERSION}")
  elseif(UNFURL_PYTHON STREQUAL "AUTO")
    message(STATUS "Python package: not built, for want of ${missing}")
    set(UNFURL_PYTHON OFF)
  else()
    message(FATAL_ERROR "the Python package (UNFURL_PYTHON) lacks ${missing}; Python is ${Python3_EXECUTABLE}, "
                        "and -DPython3_EXECUTABLE=PATH names another")
  endif()
endif()
