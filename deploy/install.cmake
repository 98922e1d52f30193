# What `cmake --install` lays down, by component: the two programs and what they read (trammel, trammeld), libtrammel for other
# programs (library, dev), the Python package (python), and the rooms of the project as static libraries with all their headers
# (rooms). deploy/package makes a Debian package of each but the last.
include(CMakePackageConfigHelpers)

install(TARGETS trammeld RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT trammeld)
install(TARGETS trammel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT trammel)
install(DIRECTORY config models DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel COMPONENT trammel)
# The pages and files to which those of config and models lead, where their links find them.
foreach(page
  clients/cam/README.md clients/library/README.md clients/python/README.md deploy/patroni/README.md deploy/security/README.md
  idl/README.md idl/repairs/README.md idl/repairs/guard/README.md server/bias/flange/README.md
  server/calibrate/causes/README.md server/calibrate/gauges/README.md server/calibrate/instruments/README.md
  server/calibrate/maps/README.md server/gateway/README.md
  server/compensate/MODEL_FILE.md server/compensate/budget/README.md server/dds/records/README.md server/diagnose/README.md
  server/diagnose/TOUR.md server/error_sources/README.md server/health/README.md server/http/README.md
  server/measurement/files/README.md server/report/README.md server/robot/README.md server/store/README.md
  server/tasks/README.md server/trainer/README.md tests/benchmarks/README.md deploy/discovery-server.xml deploy/patroni/etcd
  deploy/patroni/patroni.yml)
  get_filename_component(folder ${page} DIRECTORY)
  install(FILES ${page} DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel/${folder} COMPONENT trammel)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/shell/man1/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT trammel)
install(FILES ${PROJECT_BINARY_DIR}/shell/trammel DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT trammel)
install(FILES ${PROJECT_BINARY_DIR}/shell/_trammel DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT trammel)
install(FILES ${PROJECT_BINARY_DIR}/shell/trammel.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT trammel)
install(PROGRAMS deploy/supervise DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/trammel COMPONENT trammeld)
install(PROGRAMS deploy/security/keys DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/trammel COMPONENT trammeld)
install(PROGRAMS deploy/http/token DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/trammel/http COMPONENT trammeld)
install(PROGRAMS deploy/http/correct.sh deploy/http/correct.py DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/trammeld/examples/http COMPONENT trammeld)
install(FILES deploy/security/README.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/trammeld RENAME security.md COMPONENT trammeld)
install(FILES deploy/watching/alerts.yml deploy/watching/dashboard.json deploy/watching/prometheus.yml deploy/watching/README.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel/watching COMPONENT trammeld)
install(FILES deploy/discovery-server.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel COMPONENT trammeld)
install(FILES deploy/trammeld.service deploy/trammel-discovery@.service DESTINATION lib/systemd/system COMPONENT trammeld)

# libtrammel: find_package(Trammel), Trammel::trammel.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/trammel)
if(TARGET trammel_shared)
  install(TARGETS trammel_shared EXPORT Trammel
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT dev)
  install(DIRECTORY clients/library/trammel DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev FILES_MATCHING PATTERN "*.h"
    PATTERN "values.h" EXCLUDE)
  install(FILES server/exchange/values.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/trammel COMPONENT dev)
  install(DIRECTORY clients/library/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libtrammel-dev COMPONENT dev)
  install(EXPORT Trammel NAMESPACE Trammel:: FILE TrammelTargets.cmake DESTINATION ${package_dir} COMPONENT dev)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/TrammelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES deploy/TrammelConfig.cmake ${PROJECT_BINARY_DIR}/TrammelConfigVersion.cmake
    DESTINATION ${package_dir} COMPONENT dev)
endif()

if(TARGET trammel_python)
  set(python_dir lib/python3/dist-packages/trammel)
  install(TARGETS trammel_python LIBRARY DESTINATION ${python_dir} COMPONENT python)
  install(DIRECTORY clients/python/trammel/ DESTINATION ${python_dir} COMPONENT python
    FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed")
  install(FILES clients/python/examples/tour.py clients/python/examples/notebook.py DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-trammel COMPONENT python)
endif()

# The rooms: find_package(trammel COMPONENTS session offline). `common` comes with both. Rooms above the trainer are the daemon's own.
set(common_rooms headers base)
set(session_rooms idl_types idl clients_session)
set(offline_rooms dense_algebra numerics robot exchange error_sources measurement calibrate bias plan simulate compensate diagnose health fleet store registry report
  tasks trainer offline)

set_target_properties(trammel_clients_session PROPERTIES EXPORT_NAME session)
foreach(component common session offline)
  foreach(room ${${component}_rooms})
    get_target_property(exported trammel_${room} EXPORT_NAME)
    if(NOT exported)
      set_target_properties(trammel_${room} PROPERTIES EXPORT_NAME ${room})
    endif()
    install(TARGETS trammel_${room} EXPORT trammel_${component}
      ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/trammel COMPONENT rooms)
  endforeach()
  install(EXPORT trammel_${component} NAMESPACE trammel:: FILE ${component}.cmake DESTINATION ${package_dir} COMPONENT rooms)
endforeach()

# Headers keep their paths: #include "clients/session/session.h" in a build tree and after installation.
install(DIRECTORY server DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/trammel COMPONENT rooms FILES_MATCHING PATTERN "*.h"
  PATTERN "dds" EXCLUDE PATTERN "config" EXCLUDE PATTERN "http" EXCLUDE PATTERN "host" EXCLUDE)
install(FILES clients/session/session.h clients/session/session_types.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/trammel/clients/session COMPONENT rooms)

configure_package_config_file(deploy/trammel-config.cmake.in ${PROJECT_BINARY_DIR}/trammel-config.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/trammel-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/trammel-config.cmake ${PROJECT_BINARY_DIR}/trammel-config-version.cmake
  DESTINATION ${package_dir} COMPONENT rooms)

# Debian packages of what is built: cmake --build --preset release --target packages
add_custom_target(packages COMMAND ${PROJECT_SOURCE_DIR}/deploy/package ${PROJECT_BINARY_DIR} USES_TERMINAL VERBATIM)
foreach(target trammel trammeld trammel_shared trammel_python)
  if(TARGET ${target})
    add_dependencies(packages ${target})
  endif()
endforeach()
