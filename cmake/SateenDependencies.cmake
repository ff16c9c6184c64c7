# Every package that Sateen's libraries use, in one place. Read by the build, where a missing package
# stops the configuration, and by sateen-config.cmake, where it makes find_package(sateen) fail.
include(CMakeFindDependencyMacro)

# A macro, because find_dependency() returns from this file when the package is missing.
macro(sateen_find_package)
  if("${CMAKE_FIND_PACKAGE_NAME}" STREQUAL "sateen")
    find_dependency(${ARGV})
  else()
    find_package(${ARGV} REQUIRED)
  endif()
endmacro()

# sateen_find_pkg_config(<prefix> <module>): the target PkgConfig::<prefix>.
macro(sateen_find_pkg_config prefix module)
  if("${CMAKE_FIND_PACKAGE_NAME}" STREQUAL "sateen")
    pkg_check_modules(${prefix} QUIET IMPORTED_TARGET "${module}")
    if(NOT ${prefix}_FOUND)
      set(sateen_FOUND FALSE)
      set(sateen_NOT_FOUND_MESSAGE "sateen needs '${module}', which pkg-config does not find.")
      return()
    endif()
  else()
    pkg_check_modules(${prefix} REQUIRED IMPORTED_TARGET "${module}")
  endif()
endmacro()

sateen_find_package(Boost 1.74)
sateen_find_package(Eigen3 3.4 NO_MODULE)
sateen_find_package(fmt 9)
sateen_find_package(tl-expected 1.0)
sateen_find_package(TBB 2021)
sateen_find_package(hwy 1.0.3)
sateen_find_package(OpenSSL 3 COMPONENTS Crypto)
sateen_find_package(nlohmann_json 3.11)
sateen_find_package(Ceres 2.1)
sateen_find_package(OpenCV 4.6 COMPONENTS core imgproc calib3d aruco)
sateen_find_package(PkgConfig)
sateen_find_pkg_config(LibRaw libraw_r)
sateen_find_pkg_config(LibTiff libtiff-4>=4.5)
sateen_find_pkg_config(matio matio)
sateen_find_pkg_config(Cairo cairo-pdf>=1.16)
sateen_find_pkg_config(libserialport libserialport>=0.1.1)
# Not by its CMake package: Debian's stops unless the image viewer, and with it Qt, is installed.
sateen_find_pkg_config(OpenImageIO OpenImageIO>=2.4)
if(NOT TARGET OpenImageIO::OpenImageIO)
  add_library(OpenImageIO::OpenImageIO ALIAS PkgConfig::OpenImageIO)
endif()

# What the programs use and the libraries do not.
if(NOT "${CMAKE_FIND_PACKAGE_NAME}" STREQUAL "sateen")
  find_package(Boost 1.74 REQUIRED)  # headers alone
  find_package(CLI11 2.1 REQUIRED)
  sateen_find_pkg_config(libgphoto2 libgphoto2>=2.5.28)
endif()

# For the virtual rig alone, because it is GPL-3. Not by pkg-config: Debian's file wants libelf-dev.
if(SATEEN_BUILD_VIRTUAL_RIG AND NOT "${CMAKE_FIND_PACKAGE_NAME}" STREQUAL "sateen")
  find_path(SATEEN_SIMAVR_INCLUDE_DIR simavr/sim_avr.h REQUIRED)
  find_library(SATEEN_SIMAVR_LIBRARY simavr REQUIRED)
  add_library(simavr::simavr UNKNOWN IMPORTED)
  set_target_properties(simavr::simavr PROPERTIES
    IMPORTED_LOCATION ${SATEEN_SIMAVR_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${SATEEN_SIMAVR_INCLUDE_DIR})
endif()
