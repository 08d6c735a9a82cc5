cmake_minimum_required(VERSION 3.25)
# Makes the reference and fails on every warning of Doxygen, undocumented classes and functions
# included. Two kinds pass: constructors and destructors (their class is documented), and members
# whose name and type say all (what a real number is measured in, tests/structure asks).

if(NOT DOXYGEN)
  message(FATAL_ERROR "doxygen is not installed: scripts/setup --tests installs it")
endif()

file(MAKE_DIRECTORY ${FOLDER}/reference)
execute_process(COMMAND ${DOXYGEN} ${FOLDER}/Doxyfile WORKING_DIRECTORY ${SOURCE}
                RESULT_VARIABLE result OUTPUT_QUIET)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "doxygen ended with ${result}")
endif()
file(STRINGS ${FOLDER}/reference/warnings.txt warnings)
set(failed 0)
foreach(warning IN LISTS warnings)
  string(REPLACE "${SOURCE}/" "" warning "${warning}")
  if(warning MATCHES "is not documented")
    if(warning MATCHES "\\(variable\\)")
      continue()
    elseif(warning MATCHES "Member ~?([A-Za-z0-9_]+)\\(.* of (class|struct) [A-Za-z0-9_:]*::([A-Za-z0-9_]+) is" AND
           CMAKE_MATCH_1 STREQUAL CMAKE_MATCH_3)
      continue()
    endif()
  endif()
  message("${warning}")
  math(EXPR failed "${failed} + 1")
endforeach()
if(failed GREATER 0)
  message(FATAL_ERROR "${failed} warnings")
endif()
