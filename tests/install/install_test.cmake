# cmake -D build_dir=... -D config=... -D work_dir=... -D generator=... -D compiler=... -P this
set(prefix ${work_dir}/prefix)
set(consumer ${work_dir}/consumer)
# From nothing, so that a file which is no longer installed is missed.
file(REMOVE_RECURSE ${prefix} ${consumer})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

run(${CMAKE_COMMAND} --install ${build_dir} --config ${config} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/consumer -B ${consumer} -G ${generator}
    -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_BUILD_TYPE=${config}
    -D CMAKE_PREFIX_PATH=${prefix})
run(${CMAKE_COMMAND} --build ${consumer} --config ${config})
run(${CMAKE_CTEST_COMMAND} --test-dir ${consumer} --build-config ${config} --output-on-failure
    --no-tests=error)
