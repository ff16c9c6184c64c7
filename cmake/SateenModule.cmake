# What each of the slowest tests takes, in seconds: CTest starts the longest first, so that no core is
# left alone with one at the end. A fresh build tree has no times of its own yet.
file(STRINGS ${PROJECT_SOURCE_DIR}/tests/slowest.txt slowest REGEX "^[^#]")
foreach(line IN LISTS slowest)
  if(line MATCHES "^([^ ]+) +([0-9]+)$")
    set(SATEEN_COST_${CMAKE_MATCH_1} ${CMAKE_MATCH_2})
  else()
    message(FATAL_ERROR "tests/slowest.txt: '${line}': need a test and whole seconds")
  endif()
endforeach()

# sateen_add_module(<name> SOURCES ... [PUBLIC ...] [PRIVATE ...] [TESTS ...] [TEST_LIBS ...]
#                   [RELEASE_TESTS] [HOT] [HOT_TESTS])
#
# Declares the library sateen_<name> and its alias sateen::<name>. TESTS are files of the folder in
# tests/ that mirrors the module's own; together they are one program, sateen_<name>_test, and each
# is one test of CTest, "<folder>/<file>". RELEASE_TESTS: they depend on -O3, SIMD or exact bits, or
# run the programs, so that CI runs them in release too and not under the sanitizers alone.
# HOT: tests spend more time in the module than its compiling takes, so that it is optimised under
# the sanitizers too. HOT_TESTS: the same of the tests' own files.
function(sateen_add_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "RELEASE_TESTS;HOT;HOT_TESTS" "" "SOURCES;PUBLIC;PRIVATE;TESTS;TEST_LIBS")
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
  if(arg_HOT)
    target_compile_options(sateen_${name} PRIVATE $<$<CONFIG:RelWithDebInfo>:-O2>)
  endif()
  if(SATEEN_BUILD_TESTS AND arg_TESTS)
    file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
    list(TRANSFORM arg_TESTS PREPEND ${PROJECT_SOURCE_DIR}/tests/${folder}/ OUTPUT_VARIABLE sources)
    add_executable(sateen_${name}_test ${sources})
    target_link_libraries(sateen_${name}_test PRIVATE
      sateen::${name} ${arg_PRIVATE} ${arg_TEST_LIBS} sateen::testing GTest::gmock_main)
    sateen_set_warnings(sateen_${name}_test)
    set_target_properties(sateen_${name}_test PROPERTIES HOT_TESTS ${arg_HOT_TESTS})
    sateen_register_tests(sateen_${name}_test ${folder} ${sources})
    add_dependencies(sateen_tests sateen_${name}_test)
    if(arg_RELEASE_TESTS)
      add_dependencies(sateen_release_tests sateen_${name}_test)
      get_property(tests DIRECTORY PROPERTY TESTS)
      set_tests_properties(${tests} PROPERTIES LABELS release)
    endif()
  endif()
endfunction()

# sateen_register_tests(<target> <folder> <source>...): a test of CTest for each source, which runs
# what TEST, TEST_F and TEST_P define in it, and one that fails where the program has others.
function(sateen_register_tests target folder)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${ARGN})
  set(all "")
  foreach(source IN LISTS ARGN)
    file(READ ${source} text)
    string(REGEX MATCHALL "TEST(_F|_P)?\\([A-Za-z0-9_]+,[ \n]*[A-Za-z0-9_]+\\)" heads "${text}")
    list(TRANSFORM heads REPLACE
      "TEST(_F|_P)?\\(([A-Za-z0-9_]+),[ \n]*([A-Za-z0-9_]+)\\)" "\\2.\\3:*/\\2.\\3/*")
    list(JOIN heads ":" filter)
    get_filename_component(test ${source} NAME_WE)
    add_test(NAME ${folder}/${test} COMMAND ${target} --gtest_filter=${filter})
    if(DEFINED SATEEN_COST_${folder}/${test})
      set_tests_properties(${folder}/${test} PROPERTIES COST ${SATEEN_COST_${folder}/${test}})
    endif()
    list(APPEND all ${filter})
  endforeach()
  list(JOIN all ":" all)
  add_test(NAME ${folder}/all_are_registered COMMAND ${target} --gtest_list_tests --gtest_filter=-${all})
  set_tests_properties(${folder}/all_are_registered PROPERTIES FAIL_REGULAR_EXPRESSION "\n  [A-Z]")
endfunction()

# sateen_install_module(<name> HEADERS ...): the library, and those of its headers that other CMake
# projects may include.
function(sateen_install_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "HEADERS")
  file(RELATIVE_PATH module_folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  if(SATEEN_BUILD_TESTS)
    add_dependencies(sateen_release_tests sateen_${name})  # for install/consumer
  endif()
  install(TARGETS sateen_${name} EXPORT sateen-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  foreach(header IN LISTS arg_HEADERS)
    get_filename_component(room ${header} DIRECTORY)
    install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sateen/${module_folder}/${room})
  endforeach()
endfunction()

function(sateen_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wdouble-promotion
    # Options are given by name, and what is not named keeps its default.
    -Wno-missing-field-initializers
    # In a unity build every source is an included file, for which g++ says this of any private type.
    $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>)
  if(SATEEN_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
