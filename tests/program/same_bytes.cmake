# same_bytes.cmake: the same pictures, byte for byte, from every compiler, optimised or not, on another processor and on
# another system too. It builds the program anew with what it finds, and says what it left out. Whether the pictures are
# right is not asked here.
#
#     cmake -DSOURCE=<this project> -DFOLDER=<for the builds> -DGENERATOR=<CMake's>
#           -DUMBRA=<the program at hand> -DUMBRA_BY=<CMake's name of its compiler> -P same_bytes.cmake
cmake_minimum_required(VERSION 3.20)
cmake_host_system_information(RESULT processors QUERY NUMBER_OF_LOGICAL_CORES)
set(ENV{WINEDEBUG} -all)
set(ENV{WINEPREFIX} ${FOLDER}/wine)
file(MAKE_DIRECTORY ${FOLDER}/wine)

# Adds to builds a program that the project's own CMakeLists.txt makes, so that its flags are the ones that are tested.
# The level of optimisation is the only one that the build type would have added. The emulator runs the program of
# another machine (one of its names; "" for this machine); linked statically, it needs no library of that machine.
function(build name compiler level emulator)
  find_program(path_of_${compiler} ${compiler})
  find_program(emulator_of_${name} NAMES ${emulator} PATHS /usr/lib/wine)
  if(NOT path_of_${compiler} OR (emulator AND NOT emulator_of_${name}))
    list(JOIN emulator " or " emulator)
    message(STATUS "skipped: ${name}: it needs ${compiler} ${emulator}")
    return()
  endif()
  file(REMOVE ${FOLDER}/${name}/umbra ${FOLDER}/${name}/umbra.exe)  # never compare yesterday's program
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${FOLDER}/${name} -G ${GENERATOR} -DBUILD_TESTING=OFF
                          -DCMAKE_CXX_COMPILER=${compiler} -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=${level} ${ARGN}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
  execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER}/${name} --target umbra --parallel ${processors}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
  message(STATUS "built: ${name}")
  file(GLOB program ${FOLDER}/${name}/umbra ${FOLDER}/${name}/umbra.exe)
  set(run_${name} ${program} PARENT_SCOPE)
  if(emulator)
    set(run_${name} ${emulator_of_${name}} ${program} PARENT_SCOPE)
  endif()
  set(builds ${builds} ${name} PARENT_SCOPE)
endfunction()

# Both compilers optimised, one not at all; the program at hand is the first of them. It is built for this processor,
# with as many lanes as that has; the other compiler builds for any, with four, as on aarch64; and one is made to
# have a single lane, as other compilers have.
set(builds umbra)
set(run_umbra ${UMBRA})
if(NOT UMBRA_BY STREQUAL GNU)
  build(gcc g++ -O3 "" -DUMBRA_NATIVE=OFF)
endif()
if(NOT UMBRA_BY STREQUAL Clang)
  build(clang clang++ -O3 "" -DUMBRA_NATIVE=OFF)
endif()
set(static -DCMAKE_EXE_LINKER_FLAGS=-static)
build(aarch64 aarch64-linux-gnu-g++ -O1 "qemu-aarch64;qemu-aarch64-static" -DCMAKE_SYSTEM_NAME=Linux ${static})
build(windows x86_64-w64-mingw32-g++-posix "-O0 -DUMBRA_ONE_LANE" "wine;wine64" -DCMAKE_SYSTEM_NAME=Windows ${static})

# Every build draws the scene; the first one on a single thread. What it says goes to a file, not to a pipe: the
# services that wine starts would hold that open for seconds.
function(compare scene)
  foreach(build ${builds})
    file(REMOVE ${FOLDER}/depth.tga ${FOLDER}/framebuffer.tga)
    set(threads 7)
    if(build STREQUAL umbra)
      set(threads 1)
    endif()
    execute_process(COMMAND ${run_${build}} --quiet -o . --threads ${threads} ${ARGN} WORKING_DIRECTORY ${FOLDER}
                    RESULT_VARIABLE status OUTPUT_FILE said.txt ERROR_FILE said.txt TIMEOUT 30)
    file(GLOB pictures ${FOLDER}/*.tga)
    set(drawn "")
    foreach(picture ${pictures})
      file(SHA256 ${picture} hash)
      string(APPEND drawn " ${hash}")
    endforeach()
    if(NOT status STREQUAL 0 OR NOT drawn)
      file(READ ${FOLDER}/said.txt said)
      message(SEND_ERROR "${scene}: ${build} drew no picture: ${status}\n${said}")
    elseif(build STREQUAL umbra)
      set(expected "${drawn}")
    elseif(NOT drawn STREQUAL expected)
      message(SEND_ERROR "${scene}: ${build} does not draw the bytes of ${UMBRA}")
    endif()
  endforeach()
  message(STATUS "compared: ${scene}")
endfunction()

set(idol ${SOURCE}/obj/idol/idol.obj)
set(floor ${SOURCE}/obj/floor/floor.obj)
set(knot ${SOURCE}/obj/knot/knot.obj)
file(READ ${knot} text)
string(REGEX REPLACE "(\n|^)(v [^ ]+)( [^ ]+)( [^\n]+)" "\\1\\2e2\\3e2\\4e2" text "${text}")  # a hundred times as large
file(WRITE ${FOLDER}/large_knot.obj "${text}")

compare("shadow map" --size 160x160 --shadow-size 200 ${idol} ${floor})
compare("exact shadows" --size 160x160 --shadow exact ${idol} ${floor})
compare("constant bias" --size 160x160 --shadow-size 300 --bias 43.34 ${idol})
compare("tangent-space normals" --size 160x160 --shadow off --tangent ${idol} ${floor})
compare("eye within the model" --size 120x90 --shadow-size 150 --eye .1,.2,.1 --center .7,-.3,-1 ${idol} ${floor})
compare("odd sizes, computed normals" --size 97x61 --shadow-size 53 --eye 3,1,.5 --light 1,2,.3 ${knot})
compare("fitted model" --size 131x77 --shadow exact ${FOLDER}/large_knot.obj)

find_program(wineserver wineserver)
if(wineserver)
  execute_process(COMMAND ${wineserver} -k ERROR_QUIET)  # nothing stays behind: neither processes nor 700 MB of files
  file(REMOVE_RECURSE ${FOLDER}/wine)
endif()
list(LENGTH builds n)
if(n EQUAL 1)
  message(FATAL_ERROR "there is no second build to compare with")
endif()
