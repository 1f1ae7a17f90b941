# same_bytes.cmake: the same pictures, byte for byte, from every compiler, optimised or not, on another processor too.
# It builds the program anew with what it finds, and says what it left out. Whether the pictures are right is not asked here.
#
#     cmake -DSOURCE=<this project> -DFOLDER=<for the builds> -DGENERATOR=<CMake's> -P same_bytes.cmake
cmake_minimum_required(VERSION 3.20)
cmake_host_system_information(RESULT processors QUERY NUMBER_OF_LOGICAL_CORES)
set(builds "")  # the names; the program of a build is FOLDER/NAME/umbra
set(pictures depth.tga framebuffer.tga)

# The project's own CMakeLists.txt builds the program, so that its flags are the ones that are tested. The level of
# optimisation is the only one that the build type would have added.
function(build name compiler level)
  file(REMOVE ${FOLDER}/${name}/umbra)  # never compare yesterday's program
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${FOLDER}/${name} -G "${GENERATOR}" -DCMAKE_CXX_COMPILER=${compiler}
                          -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=${level} -DBUILD_TESTING=OFF ${ARGN}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
  execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER}/${name} --target umbra --parallel ${processors}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
  message(STATUS "built: ${name}")
  list(APPEND builds ${name})
  set(builds ${builds} PARENT_SCOPE)
endfunction()

foreach(compiler g++ clang++)
  find_program(path_of_${compiler} ${compiler})
  if(NOT path_of_${compiler})
    message(STATUS "skipped: ${compiler} -O0 and -O3: there is no ${compiler}")
    continue()
  endif()
  foreach(level -O0 -O3)
    build(${compiler}${level} ${path_of_${compiler}} ${level})
  endforeach()
endforeach()

# Static, so that the emulator needs no library of that system.
find_program(aarch64_compiler aarch64-linux-gnu-g++)
find_program(aarch64_emulator NAMES qemu-aarch64 qemu-aarch64-static)
set(name aarch64-O3)
if(aarch64_compiler AND aarch64_emulator)
  build(${name} ${aarch64_compiler} "-O3 -Wno-psabi" -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64
        -DCMAKE_EXE_LINKER_FLAGS=-static)
  set(emulator_of_${name} ${aarch64_emulator})
else()
  message(STATUS "skipped: ${name}: it needs aarch64-linux-gnu-g++ and qemu-aarch64")
endif()

list(LENGTH builds n)
if(n LESS 2)
  message(FATAL_ERROR "there are not two builds to compare")
endif()

# What a build makes of a scene: the pictures' hashes and the report.
function(draw result build)
  foreach(picture ${pictures})
    file(REMOVE ${FOLDER}/${picture})
  endforeach()
  execute_process(COMMAND ${emulator_of_${build}} ${FOLDER}/${build}/umbra --quiet -o ${FOLDER} ${ARGN}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE drawn)
  foreach(picture ${pictures})
    if(EXISTS ${FOLDER}/${picture})
      file(MD5 ${FOLDER}/${picture} hash)
      string(PREPEND drawn "${picture} ${hash} ")
    endif()
  endforeach()
  set(${result} "${drawn}" PARENT_SCOPE)
endfunction()

# Every build draws the scene: on one thread where it is not optimised, on seven where it is.
function(compare scene)
  unset(expected)
  foreach(build ${builds})
    set(threads 1)
    if(build MATCHES "-O3$")
      set(threads 7)
    endif()
    draw(drawn ${build} --threads ${threads} ${ARGN})
    if(NOT DEFINED expected)
      set(expected "${drawn}")
      set(first ${build})
      if(NOT expected MATCHES "framebuffer.tga [0-9a-f]+")
        message(FATAL_ERROR "${scene}: ${first} drew no picture")
      endif()
    elseif(NOT drawn STREQUAL expected)
      message(SEND_ERROR "${scene}: ${build} differs from ${first}:\n${drawn}\nis not\n${expected}")
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
compare("report" --size 60x60 --shadow-size 100 --report ${idol})
