# mutants.cmake: programs with one line made wrong, which the gate on the error figures must each see. It is read twice:
# by tests/CMakeLists.txt, for which each mutant is a test, and by that test, which makes the mutant and shows it to the
# gate. Where the lesson no longer holds the line, there is nothing to change: the test is skipped.
if(CMAKE_SCRIPT_MODE_FILE)
  cmake_minimum_required(VERSION 3.20)

  # Only the file that changes is compiled; all else is linked from the build at hand.
  function(umbra_mutant name file old new)
    if(NOT name STREQUAL NAME)
      return()
    endif()
    file(READ ${SOURCE}/${file} source)
    string(FIND "${source}" "${old}" at)
    if(at EQUAL -1)
      message("skipped: the lesson was edited, ${name} has nothing to change: ${file} does not hold ${old}")
      return()
    endif()
    string(REPLACE "${old}" "${new}" source "${source}")
    file(WRITE ${FOLDER}/${name}/${file} "${source}")
    if(file STREQUAL "main.cpp")
      set(MAIN_OBJECT "")
    endif()
    list(TRANSFORM INCLUDES PREPEND -I)
    list(TRANSFORM DEFINITIONS PREPEND -D)
    execute_process(COMMAND ${COMPILER} -std=c++20 -O1 ${OPTIONS} -pthread ${INCLUDES} ${DEFINITIONS}
                            ${FOLDER}/${name}/${file} ${MAIN_OBJECT} ${LIBRARIES} -o ${FOLDER}/${name}/umbra
                    COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND ${GATE} ${FOLDER}/${name}/umbra OUTPUT_VARIABLE said RESULT_VARIABLE status)
    message("${said}")
    if(status STREQUAL 0 OR NOT said MATCHES "FAILED [^\n]*: [a-z_]+ [0-9]")
      message(FATAL_ERROR "no figure of ${name} is off: the gate does not see the fault")
    endif()
  endfunction()
else()
  function(umbra_mutant name)
    add_test(NAME ${name}
             COMMAND ${CMAKE_COMMAND} -DNAME=${name} -DSOURCE=${PROJECT_SOURCE_DIR} -DGATE=$<TARGET_FILE:error_gate>
                     -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/mutants -DCOMPILER=${CMAKE_CXX_COMPILER}
                     "-DINCLUDES=$<TARGET_PROPERTY:umbra,INCLUDE_DIRECTORIES>"
                     "-DOPTIONS=$<TARGET_PROPERTY:umbra,COMPILE_OPTIONS>"
                     "-DDEFINITIONS=$<TARGET_PROPERTY:umbra,COMPILE_DEFINITIONS>"
                     -DMAIN_OBJECT=$<TARGET_OBJECTS:umbra> -DLIBRARIES=$<TARGET_FILE:our_gl>
                     -P ${PROJECT_SOURCE_DIR}/tests/report/mutants.cmake)
    set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "skipped: the lesson was edited")
  endfunction()
endif()

umbra_mutant(mutant_half_texel main.cpp
  "const coord stored = shadow.shadowbuffer.at(sb_p)"
  "const coord stored = shadow.shadowbuffer.at(vec<3, coord>{sb_p.x - .5, sb_p.y - .5, sb_p.z})")
umbra_mutant(mutant_half_bias our_gl.cpp
  "receiver = dot(slope, to_centre)"
  "receiver = .5 * dot(slope, to_centre)")
umbra_mutant(mutant_no_caster_slope our_gl.cpp
  "max(receiver, caster)"
  "receiver")
umbra_mutant(mutant_loose_fit main.cpp
  "if (!classic) light = fitted(light, casters, size)"
  "")
