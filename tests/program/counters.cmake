# counters.cmake: how much work the program does, counted, since a time says nothing on a shared machine. What it says
# of itself must be what reference/counters.expected has, to the last digit. Valgrind, where it is there, counts
# instructions and allocations: twice as many is a failure (another compiler makes a few more or less).
#
#     cmake -DSOURCE=<this project> -DFOLDER=<for a build> -DGENERATOR=<CMake's> -DUMBRA=<the program> -P counters.cmake
cmake_minimum_required(VERSION 3.20)
file(MAKE_DIRECTORY ${FOLDER})
file(STRINGS ${SOURCE}/tests/reference/counters.expected expected)

foreach(line ${expected})
  string(REGEX REPLACE "^umbra (.*): (.*)$" "\\1;\\2" parts "${line}")
  list(POP_FRONT parts options counters)
  if(line MATCHES "^umbra ")
    separate_arguments(arguments UNIX_COMMAND "${options}")
    execute_process(COMMAND ${UMBRA} ${arguments} -o ${FOLDER} WORKING_DIRECTORY ${SOURCE}/obj
                    OUTPUT_VARIABLE said COMMAND_ERROR_IS_FATAL ANY OUTPUT_STRIP_TRAILING_WHITESPACE)
    string(REGEX REPLACE "^.*\n| [a-z]+_ms [0-9.]+" "" said "${said}")  # of its last line
    if(NOT said STREQUAL counters)
      message(SEND_ERROR "umbra ${options}\n  says     ${said}\n  expected ${counters}")
    endif()
  elseif(line MATCHES "^([a-z]+) ([0-9]+)$")
    set(expected_${CMAKE_MATCH_1} ${CMAKE_MATCH_2})
  endif()
endforeach()

find_program(valgrind valgrind)
if(NOT valgrind)
  message(STATUS "skipped: instructions and allocations: they need valgrind")
  return()
endif()
# Valgrind does not know the newest processors: a build for any.
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${FOLDER} -G ${GENERATOR} -DBUILD_TESTING=OFF
                        -DCMAKE_BUILD_TYPE=Release -DUMBRA_NATIVE=OFF COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER} --target umbra --parallel 2
                COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
function(count tool name pattern)
  execute_process(COMMAND ${valgrind} --tool=${tool} --${tool}-out-file=${FOLDER}/${tool}.out
                          ${FOLDER}/umbra --quiet --threads 1 -o ${FOLDER}
                  ERROR_VARIABLE said COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCH "${pattern}" found "${said}")
  string(REPLACE "," "" number "${CMAKE_MATCH_1}")
  math(EXPR most "2 * ${expected_${name}}")
  if(NOT number OR number GREATER most)
    message(SEND_ERROR "${name}: ${number}, expected ${expected_${name}}")
  endif()
  message(STATUS "${name} ${number}")
endfunction()
count(callgrind instructions "Collected *: *([0-9]+)")
count(dhat allocations "Total: *[0-9,]+ bytes in ([0-9,]+) blocks")
count(dhat bytes "Total: *([0-9,]+) bytes in")
