# cmake -D build_dir=... -D config=... -D work_dir=... -D generator=... -D compiler=...
#   -D samples=... -P this
set(prefix ${work_dir}/prefix)
set(consumer ${work_dir}/consumer)
set(sample ${work_dir}/solve_session)
# From nothing, so that a file which is no longer installed is missed.
file(REMOVE_RECURSE ${prefix} ${consumer} ${sample})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

run(${CMAKE_COMMAND} --install ${build_dir} --config ${config} --prefix ${prefix})
# build(<source> <binary>): configures and builds a project that finds the installed package.
function(build source binary)
  run(${CMAKE_COMMAND} -S ${source} -B ${binary} -G ${generator} -D CMAKE_CXX_COMPILER=${compiler}
      -D CMAKE_BUILD_TYPE=${config} -D CMAKE_PREFIX_PATH=${prefix})
  run(${CMAKE_COMMAND} --build ${binary} --config ${config})
endfunction()

build(${CMAKE_CURRENT_LIST_DIR}/consumer ${consumer})
run(${CMAKE_CTEST_COMMAND} --test-dir ${consumer} --build-config ${config} --output-on-failure
    --no-tests=error)

build(${samples}/solve_session ${sample})
find_program(solve_session solve_session PATHS ${sample} ${sample}/${config} NO_DEFAULT_PATH REQUIRED)
run(${solve_session} ${samples}/sessions/twill-small ${sample}/maps)
file(READ ${sample}/maps/solve.json report)
string(JSON solved GET ${report} solved)
string(JSON pixels GET ${report} pixels)
if(NOT solved EQUAL pixels OR NOT EXISTS ${sample}/maps/normal.exr)
  message(FATAL_ERROR "solve_session solved ${solved} of ${pixels} pixels")
endif()
