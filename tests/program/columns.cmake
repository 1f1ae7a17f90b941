# columns.cmake: no line of the sources, of CMake's files and of the texts is longer than 120 columns. Left out are the
# rows of the texts' tables, which cannot be broken. A line is measured in bytes.
#
#     cmake -DSOURCE=<this project> -P columns.cmake
cmake_minimum_required(VERSION 3.20)
string(REPEAT "." 120 more)  # CMake's regular expressions have no {120}
set(folders ${SOURCE} ${SOURCE}/obj ${SOURCE}/obj/* ${SOURCE}/tests ${SOURCE}/tests/*)
foreach(kind cpp h md cmake txt)
  list(TRANSFORM folders APPEND /*.${kind} OUTPUT_VARIABLE patterns)
  file(GLOB files RELATIVE ${SOURCE} ${patterns})
  foreach(file ${files})
    file(STRINGS ${SOURCE}/${file} lines ENCODING UTF-8 REGEX "^[^|]${more}")
    if(NOT lines STREQUAL "")
      message("${file}:\n${lines}")
      list(APPEND failed ${file})
    endif()
  endforeach()
endforeach()
if(failed)
  list(JOIN failed ", " failed)
  message(FATAL_ERROR "lines of more than 120 columns in ${failed}")
endif()
