# Mutants of the lesson: main.cpp with one line made wrong. The gate on the error figures must see each of them.
function(umbra_mutant name old new)
  file(READ ${PROJECT_SOURCE_DIR}/main.cpp source)
  string(FIND "${source}" "${old}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "main.cpp no longer holds the line that mutant ${name} changes: ${old}")
  endif()
  string(REPLACE "${old}" "${new}" source "${source}")
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp CONTENT "${source}" @ONLY)
  add_executable(${name} ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  target_link_libraries(${name} PRIVATE truth)
  target_compile_definitions(${name} PRIVATE UMBRA_OBJ_DIR="${PROJECT_SOURCE_DIR}/obj" UMBRA_VERSION="${PROJECT_VERSION}")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/main.cpp)
  add_test(NAME ${name} COMMAND error_gate $<TARGET_FILE:${name}>)
  set_tests_properties(${name} PROPERTIES PASS_REGULAR_EXPRESSION "FAILED [^\n]*: [a-z_]+ [0-9]")
endfunction()

umbra_mutant(mutant_half_texel
  "shadowbuffer->at(p.x + dx, p.y + dy)"
  "shadowbuffer->at(p.x + dx - .5, p.y + dy - .5)")
umbra_mutant(mutant_half_bias
  "p.z + dot(g, to_centre) + rounding"
  "p.z + .5 * dot(g, to_centre) + rounding")
umbra_mutant(mutant_no_caster_slope
  "/ (a < stored && b < stored ? 2 : 1)"
  "* 0")
umbra_mutant(mutant_loose_fit
  "Camera light = fitted_camera(scene.models, opt.light, opt.up, size)"
  "Camera light{lookat(opt.light, {}, opt.up), projection(0), middle_viewport(size, size)}")
