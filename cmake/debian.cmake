# What Debian wants to find in every package: licence and changelog.
set(TWOFOLD_CHANGELOG ${PROJECT_BINARY_DIR}/changelog.gz)
file(TIMESTAMP ${PROJECT_SOURCE_DIR}/CHANGELOG.md changed "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(CONFIGURE OUTPUT changelog CONTENT "twofold (@PROJECT_VERSION@) unstable; urgency=medium

  * What users notice: CHANGELOG.md in the sources.

 -- @CPACK_PACKAGE_CONTACT@  @changed@
" @ONLY)
execute_process(COMMAND gzip -9nc ${PROJECT_BINARY_DIR}/changelog OUTPUT_FILE ${TWOFOLD_CHANGELOG} COMMAND_ERROR_IS_FATAL ANY)

file(WRITE ${PROJECT_BINARY_DIR}/triggers "activate-noawait ldconfig\n")  # of the library

# twofold_debian_package(component name): the component is packed as this package.
macro(twofold_debian_package component name)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name})
  list(APPEND CPACK_COMPONENTS_ALL ${component})
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} RENAME copyright COMPONENT ${component})
  install(FILES ${TWOFOLD_CHANGELOG} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component})
endmacro()
