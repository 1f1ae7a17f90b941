# models.cmake: the program in obj/generator makes the very files that are committed in obj/.
#
#     cmake -DSOURCE=<this project> -DBINARY=<its build> -DFOLDER=<for the files> -DMAKE_MODELS=<the program>
#           -P models.cmake
cmake_minimum_required(VERSION 3.20)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BINARY} --target make_models --parallel 2
                COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
execute_process(COMMAND ${MAKE_MODELS} ${FOLDER} COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
file(GLOB made RELATIVE ${FOLDER} ${FOLDER}/*/*)
file(GLOB committed RELATIVE ${SOURCE}/obj ${SOURCE}/obj/*/*.obj ${SOURCE}/obj/*/*.tga)
if(NOT made STREQUAL committed)
  message(FATAL_ERROR "made:      ${made}\ncommitted: ${committed}")
endif()
foreach(file ${made})
  file(SHA256 ${FOLDER}/${file} is)
  file(SHA256 ${SOURCE}/obj/${file} should_be)
  if(NOT is STREQUAL should_be)
    message(SEND_ERROR "obj/${file} is not what obj/generator makes")
  endif()
endforeach()
