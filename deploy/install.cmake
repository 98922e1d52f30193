include(GNUInstallDirs)
install(TARGETS trammeld trammel RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY config models DESTINATION ${CMAKE_INSTALL_DATADIR}/trammel)
