# `cmake --build build/release --target package` makes kiroku_<version>_<architecture>.deb.
include(GNUInstallDirs)
install(FILES deploy/systemd/kirokud.service deploy/systemd/kiroku-retention.service deploy/systemd/kiroku-retention.timer deploy/systemd/kiroku-evidence.service deploy/systemd/kiroku-evidence.timer deploy/systemd/kiroku-witness.service deploy/systemd/kiroku-witness.timer deploy/systemd/kiroku-ship.service deploy/systemd/kiroku-fleet-index.service deploy/systemd/kiroku-fleet-index.timer deploy/systemd/kiroku-fleet-verify.service deploy/systemd/kiroku-fleet-renew.service deploy/systemd/kiroku-fleet-renew.timer deploy/systemd/kiroku-fleet-serve.service deploy/systemd/kiroku-report.service deploy/systemd/kiroku-planning.service
        deploy/systemd/kiroku-training.service deploy/systemd/kiroku-awake.service DESTINATION lib/systemd/system)
install(PROGRAMS deploy/systemd/await-home DESTINATION libexec/kiroku)
install(FILES README.md deploy/kiroku.toml DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(FILES deploy/package/needrestart.conf DESTINATION /etc/needrestart/conf.d RENAME kiroku.conf)
install(FILES sim/haptics/haptic_plugin.h DESTINATION include/kiroku)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME kiroku)
set(CPACK_PACKAGE_CONTACT "Kiroku developers <kiroku@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "forensic recorder for operating rooms")
set(CPACK_PACKAGE_DESCRIPTION
    "Captures endoscope video, room video and vital signs on one clock, seals and hash-chains them, and has them time-stamped (RFC 3161) while the
 operation goes on. Anyone can verify a record without a key; only recipients can watch it.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# No program is linked to these: recorder/source/v4l2_format.cpp and media/libav_filter_library.cpp load the versions that they were compiled for.
find_package(PkgConfig REQUIRED)
set(loaded_libraries "")
foreach(library libavdevice libavfilter)
  pkg_check_modules(LOADED_${library} REQUIRED ${library})
  string(REGEX REPLACE "[.].*" "" major ${LOADED_${library}_VERSION})
  string(APPEND loaded_libraries ", ${library}${major}")
endforeach()
set(CPACK_DEBIAN_PACKAGE_DEPENDS "adduser, debconf (>= 0.5) | debconf-2.0${loaded_libraries}")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "fonts-dejavu-core, fonts-ipafont-gothic, ca-certificates, libosmesa6, libtss2-tcti-device0t64 | libtss2-tcti-device0")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
    "${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/postinst;${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/prerm;${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/postrm;${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/config;${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/templates;${CMAKE_CURRENT_SOURCE_DIR}/deploy/package/conffiles")
include(CPack)
