# What `cmake --install` lays down: the two programs and what they read; and for other projects the libraries, their headers and
# find_package(trammel COMPONENTS session offline).
include(CMakePackageConfigHelpers)

install(TARGETS trammeld trammel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY config models DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel)
install(DIRECTORY ${PROJECT_BINARY_DIR}/shell/man1/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES ${PROJECT_BINARY_DIR}/shell/trammel DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${PROJECT_BINARY_DIR}/shell/_trammel DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)
install(FILES ${PROJECT_BINARY_DIR}/shell/trammel.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
install(PROGRAMS deploy/supervise DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/trammel)
install(FILES deploy/trammeld.service DESTINATION lib/systemd/system)

# The rooms of each component; `common` comes with both. Rooms above the trainer are the daemon's own.
set(common_rooms headers base)
set(session_rooms idl_types idl clients_session)
set(offline_rooms numerics robot error_sources measurement calibrate bias plan simulate compensate diagnose health fleet store registry report
  trainer offline)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/trammel)
set_target_properties(trammel_clients_session PROPERTIES EXPORT_NAME session)
foreach(component common session offline)
  foreach(room ${${component}_rooms})
    get_target_property(exported trammel_${room} EXPORT_NAME)
    if(NOT exported)
      set_target_properties(trammel_${room} PROPERTIES EXPORT_NAME ${room})
    endif()
    install(TARGETS trammel_${room} EXPORT trammel_${component} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/trammel)
  endforeach()
  install(EXPORT trammel_${component} NAMESPACE trammel:: FILE ${component}.cmake DESTINATION ${package_dir})
endforeach()

# Headers keep their paths: #include "clients/session/session.h" in a build tree and after installation.
install(DIRECTORY server DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/trammel FILES_MATCHING PATTERN "*.h"
  PATTERN "dds" EXCLUDE PATTERN "config" EXCLUDE)
install(FILES clients/session/session.h clients/session/session_types.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/trammel/clients/session)

configure_package_config_file(deploy/trammel-config.cmake.in ${PROJECT_BINARY_DIR}/trammel-config.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/trammel-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/trammel-config.cmake ${PROJECT_BINARY_DIR}/trammel-config-version.cmake
  DESTINATION ${package_dir})
