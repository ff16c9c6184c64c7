# The CMake package: find_package(sateen), then link sateen::solver. The modules and their headers
# are installed by sateen_install_module(); this adds what find_package reads.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/sateen)

install(EXPORT sateen-targets NAMESPACE sateen:: DESTINATION ${package_dir})
configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/sateen-config.cmake.in ${PROJECT_BINARY_DIR}/sateen-config.cmake
  INSTALL_DESTINATION ${package_dir})
# Before 1.0 a minor version may break its users.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sateen-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sateen-config.cmake
              ${PROJECT_BINARY_DIR}/sateen-config-version.cmake
              ${CMAKE_CURRENT_LIST_DIR}/SateenDependencies.cmake
        DESTINATION ${package_dir})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
