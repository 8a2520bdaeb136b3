# What is installed, in components that are Debian's packages: the program; the library; what one builds with; Python.
include(CMakePackageConfigHelpers)
set(CPACK_PACKAGE_CONTACT "The Twofold project <twofold@localhost>")
include(cmake/debian.cmake)
install(TARGETS twofold COMPONENT program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(FILES README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs COMPONENT program)
install(FILES apps/twofold/completion.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME twofold
  COMPONENT program)
install(FILES ${PROJECT_BINARY_DIR}/twofold.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program OPTIONAL)
twofold_debian_package(program twofold)

if(TWOFOLD_SHARED)
  set(folder ${CMAKE_INSTALL_LIBDIR}/cmake/Twofold)
  install(TARGETS twofold_shared EXPORT TwofoldTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
  if(TARGET twofold_viewer_shared)
    install(TARGETS twofold_viewer_shared EXPORT TwofoldTargets
      LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
  endif()
  install(DIRECTORY include/twofold DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
  install(DIRECTORY examples/ DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libtwofold-dev/examples COMPONENT development
    PATTERN "*.py" EXCLUDE)
  install(EXPORT TwofoldTargets NAMESPACE Twofold:: DESTINATION ${folder} COMPONENT development)
  configure_package_config_file(cmake/TwofoldConfig.cmake.in ${PROJECT_BINARY_DIR}/TwofoldConfig.cmake
    INSTALL_DESTINATION ${folder})
  # Before 1.0 a minor version may change the interface.
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/TwofoldConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/TwofoldConfig.cmake ${PROJECT_BINARY_DIR}/TwofoldConfigVersion.cmake
    DESTINATION ${folder} COMPONENT development)
  file(RELATIVE_PATH prefix_of_pkgconfig ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
  configure_file(cmake/twofold.pc.in twofold.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/twofold.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
  twofold_debian_package(library libtwofold${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  twofold_debian_package(development libtwofold-dev)
endif()
if(TARGET twofold_python)
  install(FILES examples/offline.py examples/surface.py examples/webcam.py DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-twofold/examples
    COMPONENT python)
  twofold_debian_package(python python3-twofold)
endif()

# `cpack -G DEB` packs them (scripts/package): `apt install ./FILE...` puts them in place with what they need.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
# One package needs another's libraries, which no package database knows yet.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/slam ${PROJECT_BINARY_DIR}/viewer)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)

set(own "(= ${PROJECT_VERSION})")
set(library libtwofold${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "The command twofold tracks a camera, keeps a map of what it saw, calibrates,
records and evaluates, and tells other programs poses while it runs.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_DESCRIPTION "The library: frames in, poses and a map out. What programs need that were
built with libtwofold-dev.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${PROJECT_BINARY_DIR}/triggers)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${library} ${own}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "libeigen3-dev, libopencv-dev")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Headers, a package for CMake, a file for pkg-config, and examples.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "${library} ${own}, ${TWOFOLD_PYTHON_NEEDS}")
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "Package twofold for Python: frames from NumPy arrays, poses, maps as views,
evaluation.")
include(CPack)
