# sateen_add_module(<name> SOURCES ... [PUBLIC ...] [PRIVATE ...] [TESTS ...] [TEST_LIBS ...])
#
# Declares the library sateen_<name>, its alias sateen::<name>, and one test executable for each
# file in TESTS, found in tests/<name>/ and registered with CTest as "<name>/<test>".
function(sateen_add_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;PUBLIC;PRIVATE;TESTS;TEST_LIBS")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "sateen_add_module(${name}): unknown arguments ${arg_UNPARSED_ARGUMENTS}")
  endif()
  add_library(sateen_${name} STATIC ${arg_SOURCES})
  add_library(sateen::${name} ALIAS sateen_${name})
  set_target_properties(sateen_${name} PROPERTIES EXPORT_NAME ${name})
  target_compile_features(sateen_${name} PUBLIC cxx_std_20)
  target_include_directories(sateen_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/sateen>)
  target_link_libraries(sateen_${name} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  sateen_set_warnings(sateen_${name})
  if(SATEEN_BUILD_TESTS)
    foreach(source IN LISTS arg_TESTS)
      get_filename_component(test ${source} NAME_WE)
      add_executable(sateen_${name}_${test} ${PROJECT_SOURCE_DIR}/tests/${name}/${source})
      target_link_libraries(sateen_${name}_${test} PRIVATE
        sateen::${name} ${arg_PRIVATE} ${arg_TEST_LIBS} sateen::testing GTest::gmock_main)
      sateen_set_warnings(sateen_${name}_${test})
      add_test(NAME ${name}/${test} COMMAND sateen_${name}_${test})
    endforeach()
  endif()
endfunction()

# sateen_install_module(<name> HEADERS ...): the library, and those of its headers that other CMake
# projects may include.
function(sateen_install_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "HEADERS")
  install(TARGETS sateen_${name} EXPORT sateen-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(FILES ${arg_HEADERS} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sateen/${name})
endfunction()

function(sateen_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wdouble-promotion
    # Options are given by name, and what is not named keeps its default.
    -Wno-missing-field-initializers)
  if(SATEEN_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
