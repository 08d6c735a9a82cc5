# What each is for, and why it and not another: docs/dependencies.md. Debian names: packages.txt.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt 9 REQUIRED)
find_package(Ceres 2.1 REQUIRED)
include(UnfurlOpenCV)
find_package(HDF5 1.10 REQUIRED COMPONENTS C)
find_package(nlohmann_json 3.11 REQUIRED)
find_package(CLI11 2.1 REQUIRED)
find_package(tomlplusplus 3.3 REQUIRED)
find_package(Boost 1.74 REQUIRED)  # Boost.Math, Boost.Random, headers only
find_package(muparser 2.3 REQUIRED)  # expressions of campaigns
find_package(PkgConfig REQUIRED)
pkg_check_modules(FFTW REQUIRED IMPORTED_TARGET fftw3)
pkg_check_modules(LIBDEFLATE REQUIRED IMPORTED_TARGET libdeflate)
pkg_check_modules(NETTLE REQUIRED IMPORTED_TARGET nettle)
pkg_check_modules(LIBPNG REQUIRED IMPORTED_TARGET libpng)
find_package(Threads REQUIRED)

find_path(UNFURL_DYGRAPHS_DIR dygraph.min.js
          PATHS /usr/share/javascript/dygraphs /usr/share/javascript/dygraphs/dist REQUIRED)
find_path(UNFURL_THREE_DIR build/three.min.js PATHS /usr/share/javascript/three REQUIRED)

if(UNFURL_TESTS)
  find_package(GTest REQUIRED)
endif()

# Debian's Ceres is built for baseline x86-64; a TU compiled for wider vectors would align
# Eigen's objects differently, so UNFURL_NATIVE applies only to files that name it.
# With UNFURL_LEVELS these files are compiled once more for each level (unfurl/CMakeLists.txt).
function(unfurl_native)
  if(UNFURL_NATIVE)
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "-march=native;-O3")
  else()
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "-O3")
  endif()
  # Loops here go some twenty turns: clang would take them eight or sixteen at a time and most of the rest one by one.
  set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS
    $<$<CXX_COMPILER_ID:Clang>:-mllvm> $<$<CXX_COMPILER_ID:Clang>:-force-vector-interleave=1>)
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR FILENAME room)
  set_property(GLOBAL APPEND PROPERTY UNFURL_HOT_${room} ${ARGN})
endfunction()
