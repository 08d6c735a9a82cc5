# What is installed: the library with its public headers, the program, the shipped sets.

# A header is public when unfurl/unfurl.h leads to it; all others stay inside.
function(unfurl_public_headers header found)
  if("${header}" IN_LIST ${found} OR NOT EXISTS ${PROJECT_SOURCE_DIR}/${header})
    return()
  endif()
  list(APPEND ${found} ${header})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
  file(STRINGS ${PROJECT_SOURCE_DIR}/${header} includes REGEX "^#include \"")
  foreach(include ${includes})
    string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" include "${include}")
    unfurl_public_headers(${include} ${found})
  endforeach()
  set(${found} ${${found}} PARENT_SCOPE)
endfunction()
unfurl_public_headers(unfurl/unfurl.h public_headers)
foreach(header ${public_headers})
  cmake_path(GET header PARENT_PATH folder)
  if(folder STREQUAL unfurl)
    install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/unfurl COMPONENT dev)
  else()
    install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/unfurl/${folder} COMPONENT dev)
  endif()
endforeach()

install(TARGETS unfurl_library EXPORT unfurlTargets
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT program NAMELINK_COMPONENT dev)
foreach(level ${UNFURL_LEVELS})
  install(TARGETS unfurl_library_${level} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/glibc-hwcaps/${level}
          COMPONENT program NAMELINK_SKIP)
endforeach()
install(EXPORT unfurlTargets NAMESPACE unfurl:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unfurl
        COMPONENT dev)
include(CMakePackageConfigHelpers)
configure_package_config_file(cmake/unfurlConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/unfurlConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unfurl)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/unfurlConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/unfurlConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/unfurlConfigVersion.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unfurl COMPONENT dev)
install(DIRECTORY data/sets DESTINATION share/unfurl COMPONENT program USE_SOURCE_PERMISSIONS)
install(FILES LICENSE README.md DESTINATION share/doc/unfurl COMPONENT doc)
