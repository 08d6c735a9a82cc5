# Read by CTest: an entry for each suite of a test program, without the tests that its filter `left_out` names.
# `program`, `left_out`, `timeout` [s]: of the program, from unfurl_test.
if(NOT EXISTS "${program}")
  get_filename_component(name "${program}" NAME)
  add_test("${name}_NOT_BUILT" "${name}_NOT_BUILT")
  return()
endif()

# The list is kept until the program changes; one that was cut off is none.
set(list "${program}_list.cmake")
if(NOT EXISTS "${list}" OR "${program}" IS_NEWER_THAN "${list}"
   OR "${CMAKE_CURRENT_LIST_FILE}" IS_NEWER_THAN "${list}"
   OR "${CMAKE_PARENT_LIST_FILE}" IS_NEWER_THAN "${list}")
  set(filter)
  if(left_out)
    set(filter "-${left_out}")
  endif()
  execute_process(COMMAND "${program}" --gtest_list_tests "--gtest_filter=*${filter}"
    OUTPUT_VARIABLE listed RESULT_VARIABLE status TIMEOUT 60)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${program} does not list its tests: ${status}")
  endif()
  get_filename_component(folder "${program}" DIRECTORY)
  # A name begins its line, its tests are set in; what follows a # are their parameters.
  string(REGEX REPLACE "#[^\n]*" "" listed "${listed}")
  string(REGEX REPLACE "[^\n]*DISABLED_[^\n]*\n" "" listed "${listed}")
  string(REPLACE "\n" ";" listed "${listed}")
  set(entries)
  set(suite)
  set(count 0)
  macro(close_suite)
    if(suite AND count)
      math(EXPR limit "${timeout} + 10 * ${count}")
      # Longest first: the more tests, the longer, on the whole.
      string(APPEND entries "add_test([==[${suite}]==] \"${program}\" [==[--gtest_filter=${suite}.*${filter}]==] "
        "--gtest_brief=1)\nset_tests_properties([==[${suite}]==] PROPERTIES TIMEOUT ${limit} COST ${count} "
        "WORKING_DIRECTORY \"${folder}\")\n")
    endif()
  endmacro()
  foreach(line IN LISTS listed)
    if(line MATCHES "^([A-Za-z0-9_/]+)\\.")
      close_suite()
      set(suite "${CMAKE_MATCH_1}")
      set(count 0)
    elseif(line MATCHES "^  ")
      math(EXPR count "${count} + 1")
    endif()
  endforeach()
  close_suite()
  file(WRITE "${list}.part" "${entries}")
  file(RENAME "${list}.part" "${list}")
endif()
include("${list}")
