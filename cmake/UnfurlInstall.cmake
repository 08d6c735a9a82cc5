get_property(modules GLOBAL PROPERTY UNFURL_MODULES)
install(TARGETS ${modules} EXPORT unfurlTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
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
install(DIRECTORY data/sets DESTINATION share/unfurl)
install(FILES LICENSE README.md DESTINATION share/doc/unfurl)
