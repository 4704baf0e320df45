# What `cmake --install` lays down: the libraries and their headers, a CMake package, pkg-config files,
# the program and its man pages.
include(CMakePackageConfigHelpers)

install(TARGETS umbrage umbrage-bake EXPORT umbrage-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
        RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY include/umbrage DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")

set(UMB_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/umbrage)
install(EXPORT umbrage-targets NAMESPACE umbrage:: DESTINATION ${UMB_PACKAGE_DIR})
configure_package_config_file(cmake/umbrage-config.cmake.in ${CMAKE_BINARY_DIR}/umbrage-config.cmake
                              INSTALL_DESTINATION ${UMB_PACKAGE_DIR})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/umbrage-config-version.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/umbrage-config.cmake ${CMAKE_BINARY_DIR}/umbrage-config-version.cmake
        DESTINATION ${UMB_PACKAGE_DIR})

# They name the folder that is installed to, which is known only then (cmake --install --prefix).
foreach(library umbrage umbrage-bake)
  install(CODE "
    set(CMAKE_INSTALL_LIBDIR \"${CMAKE_INSTALL_LIBDIR}\")
    set(CMAKE_INSTALL_INCLUDEDIR \"${CMAKE_INSTALL_INCLUDEDIR}\")
    set(PROJECT_VERSION \"${PROJECT_VERSION}\")
    configure_file(\"${CMAKE_CURRENT_SOURCE_DIR}/cmake/${library}.pc.in\" \"${CMAKE_BINARY_DIR}/${library}.pc\" @ONLY)")
  install(FILES ${CMAKE_BINARY_DIR}/${library}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endforeach()

if(TARGET umbrage-program)
  install(TARGETS umbrage-program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  file(GLOB UMB_MAN_PAGES CONFIGURE_DEPENDS docs/*.1 docs/man/*.1)
  install(FILES ${UMB_MAN_PAGES} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
endif()
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
