# One static library per room, with its links declared:
#   unfurl_module(calib SOURCES bundle.cc ... LINKS unfurl::measure PRIVATE_LINKS Ceres::ceres)
# and one test program per folder of tests:
#   unfurl_test(calib_test SOURCES bundle_test.cc ... LINKS unfurl::calib LABELS slow)

function(unfurl_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
    -Wno-missing-field-initializers  # designated initialisers leave the rest to its defaults
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)  # false alarms on std::string, GCC bug 105651
  if(UNFURL_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(UNFURL_SANITIZE)
    # The pattern makes what is not initialised large numbers and bad pointers.
    target_compile_options(${target} PUBLIC -fsanitize=address,undefined -fno-sanitize-recover=all
                           -fno-omit-frame-pointer -ftrivial-auto-var-init=pattern)
    target_link_options(${target} PUBLIC -fsanitize=address,undefined)
  endif()
  if(UNFURL_TSAN)
    target_compile_options(${target} PUBLIC -fsanitize=thread -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=thread)
  endif()
  if(UNFURL_FUZZ)  # what guides the fuzzer by what it reached
    target_compile_options(${target} PUBLIC -fsanitize=fuzzer-no-link)
  endif()
endfunction()

# What keeps an error in memory from becoming control of the program. For the rooms and the programs made of them, and
# not for the tests, which nobody hands a file; tests/cli/hardening_test.cc looks at what was built.
include(CheckPIESupported)
check_pie_supported(LANGUAGES CXX)
include(CheckCXXSourceCompiles)
set(CMAKE_REQUIRED_FLAGS "-O2 -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3")
check_cxx_source_compiles("#include <cstdio>
#if !defined(__USE_FORTIFY_LEVEL) || __USE_FORTIFY_LEVEL < 3
#error older
#endif
int main() {}" UNFURL_HAS_FORTIFY_3)
unset(CMAKE_REQUIRED_FLAGS)
function(unfurl_harden target)
  if(UNFURL_SANITIZE OR UNFURL_TSAN)  # sanitizers see more, and intercept what these would
    return()
  endif()
  set(level 2)
  if(UNFURL_HAS_FORTIFY_3)
    set(level 3)
  endif()
  target_compile_options(${target} PRIVATE -fstack-protector-strong -fstack-clash-protection
    $<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE>  # needs optimisation
    $<$<NOT:$<CONFIG:Debug>>:-D_FORTIFY_SOURCE=${level}>)
  get_target_property(type ${target} TYPE)
  if(NOT type STREQUAL STATIC_LIBRARY)
    target_link_options(${target} PRIVATE LINKER:-z,relro LINKER:-z,now LINKER:-z,noexecstack)
  endif()
endfunction()

# With UNFURL_UNITY the sources of a room are compiled some together, so that headers are read and templates made once
# for all of them: `largest` at most to a group, more or less, by g++; by clang, which then takes a fifth less, a room or
# a program in one (decision 304). Which go together hangs on their names alone: a new file does not shift the others.
# Hot files have options of their own and stay alone. A third argument: so many groups at least.
function(unfurl_unity target largest)
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    math(EXPR largest "8 * ${largest}")  # more than any of them has
  endif()
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  list(LENGTH sources count)
  set(groups 1)  # seldom another number of them
  if(ARGC GREATER 2)
    set(groups ${ARGV2})
    math(EXPR count "(${count} + ${groups} - 1) / ${groups}")
  endif()
  while(count GREATER largest)
    math(EXPR groups "2 * ${groups}")
    math(EXPR count "(${count} + 1) / 2")
  endwhile()
  foreach(source ${sources})
    if(IS_ABSOLUTE ${source})  # made by the build
      continue()
    endif()
    string(MD5 hash ${source})
    string(SUBSTRING ${hash} 0 6 hash)
    math(EXPR group "0x${hash} % ${groups}")
    set_property(SOURCE ${folder}/${source} TARGET_DIRECTORY ${target} PROPERTY UNITY_GROUP ${group})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  target_compile_options(${target} PRIVATE -Wno-shadow  # a local of one file and a constant of another
    # GCC looks for garbage from 2 GB on, which most never reach, and not from 128 MB on: a tenth of the time.
    $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=2000000>)
endfunction()

function(unfurl_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(unfurl_${name} STATIC ${ARG_SOURCES})
  add_library(unfurl::${name} ALIAS unfurl_${name})
  target_include_directories(unfurl_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(unfurl_${name} PUBLIC ${ARG_LINKS} PRIVATE ${ARG_PRIVATE_LINKS})
  target_compile_features(unfurl_${name} PUBLIC cxx_std_20)
  unfurl_compile_options(unfurl_${name})
  unfurl_harden(unfurl_${name})
  set_property(GLOBAL APPEND PROPERTY UNFURL_ROOMS ${name})
endfunction()

# What tests test is -O3; they themselves are compiled quickly, but for what computes much beside it, by -O1.
function(unfurl_test_options name level)
  target_compile_options(${name} PRIVATE ${level}
    # False alarms on std::string, GCC bug 105651, which come up where its header is precompiled.
    $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overread>
    $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)  # or ccache keeps nothing of them
endfunction()

# Files of tests that compute much themselves: reference integrations, tracers, a thousand regular expressions.
function(unfurl_computing_tests)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -O2 SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# The rooms that a program is linked from come whole and before its own objects: of a template that both have the linker
# takes the first, and would have the rooms' compute with the tests' -O0.
function(unfurl_rooms_first program)
  get_property(rooms GLOBAL PROPERTY UNFURL_ROOMS)
  set(seen)
  set(waiting ${program})
  while(waiting)
    list(POP_FRONT waiting target)
    string(REPLACE "unfurl::" "unfurl_" target "${target}")
    if(NOT TARGET ${target} OR target IN_LIST seen)
      continue()
    endif()
    list(APPEND seen ${target})
    get_target_property(links ${target} LINK_LIBRARIES)
    if(links)
      list(APPEND waiting ${links})
    endif()
  endwhile()
  set(whole)
  foreach(room ${rooms})
    if(unfurl_${room} IN_LIST seen)
      list(APPEND whole $<TARGET_FILE:unfurl_${room}>)
    endif()
  endforeach()
  target_link_options(${program} PRIVATE LINKER:--whole-archive ${whole} LINKER:--no-whole-archive)
endfunction()

# Each suite of tests becomes one CTest entry (tests/suites.cmake): a start of a program costs as much as a small test,
# and what a suite's tests share is made once. Of programs with LABELS slow, which keeps them out of the default set, each
# TEST does. Those that the filters SLOW name are kept out of it by themselves, and those of THOROUGH become a slow one
# besides; slow ones make all of the repeats that tests/repeats.h leaves out of the quick ones.
function(unfurl_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINKS;LABELS;SLOW;THOROUGH" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} GTest::gtest GTest::gmock GTest::gtest_main)
  target_include_directories(${name} PRIVATE ${PROJECT_BINARY_DIR}/generated)  # tests/source_dir.h
  unfurl_compile_options(${name})
  if("${ARG_LABELS}" MATCHES "slow")
    unfurl_test_options(${name} -O1)
  else()
    target_precompile_headers(${name} REUSE_FROM unfurl_test_headers)
    unfurl_test_options(${name} -O0)
  endif()
  unfurl_rooms_first(${name})
  set_property(GLOBAL APPEND PROPERTY UNFURL_TEST_PROGRAMS ${name})
  include(GoogleTest)
  if("${ARG_LABELS}" MATCHES "slow" AND NOT UNFURL_SLOW)  # built where asked for by name
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  list(JOIN ARG_SLOW ":" slow)
  list(JOIN ARG_THOROUGH ":" thorough)
  set(discovery DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60)
  if(ARG_LABELS)
    gtest_discover_tests(${name} ${discovery} TEST_FILTER "-${slow}"
      PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
  else()
    file(GENERATE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}_suites.cmake CONTENT
"set(program \"$<TARGET_FILE:${name}>\")
set(left_out \"${slow}\")
set(timeout ${ARG_TIMEOUT})
include(\"${PROJECT_SOURCE_DIR}/tests/suites.cmake\")
")
    set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${CMAKE_CURRENT_BINARY_DIR}/${name}_suites.cmake)
  endif()
  if(slow)
    gtest_discover_tests(${name} ${discovery} TEST_FILTER "${slow}"
      PROPERTIES TIMEOUT 3600 LABELS slow ENVIRONMENT UNFURL_THOROUGH=1)
  endif()
  if(thorough)
    gtest_discover_tests(${name} ${discovery} TEST_FILTER "${thorough}" TEST_SUFFIX .Thorough
      PROPERTIES TIMEOUT 3600 LABELS slow ENVIRONMENT UNFURL_THOROUGH=1)
  endif()
endfunction()
