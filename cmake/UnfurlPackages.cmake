# Debian packages: `cmake --preset packages`, build, `cpack --config build/packages/CPackConfig.cmake`.
# unfurl (program, library, shipped sets), libunfurl-dev, python3-unfurl, unfurl-doc.
# docs/decisions/152-four-debian-packages.md.

set(share ${CMAKE_INSTALL_DATAROOTDIR})
set(packaging ${CMAKE_CURRENT_BINARY_DIR}/packaging)

# Links of installed documents live: they stand to each other, to the examples, the public headers
# and the sets as in the tree.
set(documents ${share}/doc/unfurl-doc)
install(DIRECTORY docs DESTINATION ${documents} COMPONENT doc
        PATTERN CMakeLists.txt EXCLUDE)
install(DIRECTORY examples DESTINATION ${documents} COMPONENT doc USE_SOURCE_PERMISSIONS)
install(FILES README.md CONTRIBUTING.md CHANGELOG.md SECURITY.md LICENSE DESTINATION ${documents} COMPONENT doc)
# Headers: the public ones, and what pages name beside them.
set(named_headers ${public_headers})
file(GLOB_RECURSE pages CONFIGURE_DEPENDS docs/*.md)
foreach(page ${pages})
  file(READ ${page} text)
  string(REGEX MATCHALL "\\([./]+[a-z_/0-9]+[.]h\\)" found "${text}")
  foreach(header ${found})
    string(REGEX REPLACE "[()]|[.][.]/" "" header "${header}")
    if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${header})
      list(APPEND named_headers ${header})
    endif()
  endforeach()
endforeach()
list(REMOVE_DUPLICATES named_headers)
foreach(header ${named_headers})
  cmake_path(GET header PARENT_PATH folder)
  install(FILES ${header} DESTINATION ${documents}/${folder} COMPONENT doc)
endforeach()
install(DIRECTORY data/sets DESTINATION ${documents}/data COMPONENT doc
        FILES_MATCHING PATTERN "*.toml" PATTERN "*.md" PATTERN "*.csv")

set(UNFURL_MAINTAINER "Unfurl developers <unfurl@unfurl.invalid>" CACHE STRING "Who answers for the Debian packages")

# Debian's own papers of each package.
find_program(UNFURL_GZIP gzip)
if(UNFURL_GZIP)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/changelog.in ${packaging}/changelog @ONLY)
  execute_process(COMMAND ${UNFURL_GZIP} -9nf ${packaging}/changelog COMMAND_ERROR_IS_FATAL ANY)
  foreach(package_component "unfurl;program" "libunfurl-dev;dev" "python3-unfurl;python" "unfurl-doc;doc")
    list(POP_FRONT package_component package component)
    install(FILES ${packaging}/changelog.gz ${CMAKE_CURRENT_LIST_DIR}/debian/copyright
            DESTINATION ${share}/doc/${package} COMPONENT ${component})
  endforeach()
endif()

# Manual pages are compressed, as Debian's are.
install(CODE [[
  file(GLOB pages "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/share/man/man1/unfurl*.1")
  if(pages AND CMAKE_INSTALL_PREFIX STREQUAL "/usr")
    execute_process(COMMAND gzip -9nf ${pages} COMMAND_ERROR_IS_FATAL ANY)
  endif()]] COMPONENT program)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME unfurl)
set(CPACK_PACKAGE_VENDOR "the Unfurl developers")
set(CPACK_PACKAGE_CONTACT "${UNFURL_MAINTAINER}")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL program dev doc)
if(UNFURL_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_CURRENT_BINARY_DIR}/unfurl)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME unfurl)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
file(WRITE ${packaging}/triggers "activate-noawait ldconfig\n")
# CPack itself would name the library once for each level. Before 1.0 nothing holds from one version to the next.
file(WRITE ${packaging}/shlibs
     "libunfurl ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} unfurl (= ${PROJECT_VERSION})\n")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA ${packaging}/triggers ${packaging}/shlibs)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "chromium, unfurl-doc")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "Calibrates a rig of line cameras, reconstructs the light marks of a recorded
trial with their uncertainty, simulates the deployment as a flexible multibody
system, and fits the one to the other. This package has the program, the
library and the shipped sets.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libunfurl-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "unfurl (= ${PROJECT_VERSION}), libeigen3-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Headers and the CMake package of unfurl's library: find_package(unfurl),
unfurl::unfurl.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-unfurl)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "unfurl (= ${PROJECT_VERSION}), python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA  # compile, and take away what was compiled
  ${CMAKE_CURRENT_LIST_DIR}/debian/python/postinst ${CMAKE_CURRENT_LIST_DIR}/debian/python/prerm)
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The Python package: the steps of unfurl as functions, its records as NumPy
arrays.")

set(CPACK_DEBIAN_DOC_PACKAGE_NAME unfurl-doc)
set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DOC_PACKAGE_SHLIBDEPS OFF)
set(CPACK_COMPONENT_DOC_DESCRIPTION "Documents of unfurl: tutorials, formats, physics, decisions, examples.")
include(CPack)
