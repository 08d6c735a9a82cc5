# Two modules of OpenCV, and a third for tests. Its own CMake files are in libopencv-dev, which brings all modules and
# with them 288 packages, of video, of maps, of databases: half of what scripts/demo would install.
find_path(UNFURL_OPENCV_DIR opencv2/core/version.hpp PATH_SUFFIXES opencv4)
find_library(UNFURL_OPENCV_core opencv_core)
find_library(UNFURL_OPENCV_imgproc opencv_imgproc)
find_library(UNFURL_OPENCV_imgcodecs opencv_imgcodecs)
if(NOT UNFURL_OPENCV_DIR OR NOT UNFURL_OPENCV_core OR NOT UNFURL_OPENCV_imgproc)
  message(FATAL_ERROR "OpenCV's core and imgproc are not found (Debian: libopencv-core-dev, libopencv-imgproc-dev): "
                      "scripts/setup installs them; elsewhere, name their prefix with -DCMAKE_PREFIX_PATH=DIR")
endif()
file(STRINGS ${UNFURL_OPENCV_DIR}/opencv2/core/version.hpp version REGEX "define CV_VERSION_(MAJOR|MINOR) ")
string(REGEX REPLACE ".*MAJOR +([0-9]+).*MINOR +([0-9]+).*" "\\1.\\2" version "${version}")
if(version VERSION_LESS 4.6)
  message(FATAL_ERROR "OpenCV ${version} in ${UNFURL_OPENCV_DIR} is too old: 4.6 or later")
endif()
foreach(module core imgproc imgcodecs)
  if(UNFURL_OPENCV_${module} AND NOT TARGET opencv_${module})
    add_library(opencv_${module} UNKNOWN IMPORTED)
    set_target_properties(opencv_${module} PROPERTIES IMPORTED_LOCATION ${UNFURL_OPENCV_${module}}
                          INTERFACE_INCLUDE_DIRECTORIES ${UNFURL_OPENCV_DIR})
  endif()
endforeach()
