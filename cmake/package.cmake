# What is installed, in two components: the program, and the library for find_package(Twofold) and pkg-config.
include(CMakePackageConfigHelpers)
install(TARGETS twofold COMPONENT program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs COMPONENT program)

if(TWOFOLD_SHARED)
  set(folder ${CMAKE_INSTALL_LIBDIR}/cmake/Twofold)
  install(TARGETS twofold_shared EXPORT TwofoldTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
  if(TARGET twofold_viewer_shared)
    install(TARGETS twofold_viewer_shared EXPORT TwofoldTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
  endif()
  install(DIRECTORY include/twofold DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library)
  install(DIRECTORY examples/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT library)
  install(EXPORT TwofoldTargets NAMESPACE Twofold:: DESTINATION ${folder} COMPONENT library)
  configure_package_config_file(cmake/TwofoldConfig.cmake.in ${PROJECT_BINARY_DIR}/TwofoldConfig.cmake
    INSTALL_DESTINATION ${folder})
  # Before 1.0 a minor version may change the interface.
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/TwofoldConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/TwofoldConfig.cmake ${PROJECT_BINARY_DIR}/TwofoldConfigVersion.cmake
    DESTINATION ${folder} COMPONENT library)
  file(RELATIVE_PATH prefix_of_pkgconfig ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
  configure_file(cmake/twofold.pc.in twofold.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/twofold.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT library)
endif()

# `cpack -G DEB`: packages that `apt install ./twofold_*.deb` puts in place with what they need (scripts/package).
set(CPACK_GENERATOR DEB)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "The Twofold project")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME twofold)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libtwofold-dev)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
include(CPack)
