# `cpack -G DEB`: a package that `apt install ./twofold_*.deb` puts in place with what it needs (scripts/package).
include(GNUInstallDirs)
install(TARGETS twofold RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs)

set(CPACK_GENERATOR DEB)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "The Twofold project")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Real-time visual SLAM for stereo and RGB-D cameras")
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
include(CPack)
