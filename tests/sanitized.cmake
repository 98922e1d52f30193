# What reads from outside (files, the store, the wire), compiled once more under the address and undefined behaviour sanitizers. All
# other objects are taken as they are, so that it takes minutes. `deploy/check asan` turns it on; `deploy/check --all asan` compiles
# everything so (preset `asan`).
set(sanitizers -fsanitize=address,undefined)
# -O1 -g1 come after the preset's; GCC 12 takes its own regular expressions for uninitialized.
set(options ${sanitizers} -O1 -g1 -fno-omit-frame-pointer -Wno-maybe-uninitialized)
# Eigen would allocate otherwise than in the objects that are not sanitized.
list(APPEND options -DEIGEN_MALLOC_ALREADY_ALIGNED=1)

add_library(trammel_pch_sanitized OBJECT ${PROJECT_SOURCE_DIR}/server/base/precompiled.cpp)
target_link_libraries(trammel_pch_sanitized PRIVATE trammel_options trammel_headers fmt::fmt)
target_compile_options(trammel_pch_sanitized PRIVATE ${options})
target_precompile_headers(trammel_pch_sanitized PRIVATE ${trammel_heavy_headers})

set(libraries)
foreach(room base robot measurement compensate store dds config idl_types idl idl_ros2)
  set(target trammel_${room}_sanitized)
  get_target_property(sources trammel_${room} SOURCES)
  get_target_property(folder trammel_${room} SOURCE_DIR)
  get_target_property(links trammel_${room} LINK_LIBRARIES)
  # Of these rooms what reads and writes files, not their numerics.
  if(room MATCHES "^(compensate|robot)$")
    list(FILTER sources INCLUDE REGEX "(_file|/gauge|compensate/file/[a-z_]+)[.]cpp$")
  elseif(room STREQUAL measurement)
    list(FILTER sources INCLUDE REGEX "(measurement/files/[a-z_]+|/checked_batch|_columns|/split|/gauges)[.]cpp$")
  endif()
  list(TRANSFORM sources PREPEND ${folder}/ REGEX "^[^/]")
  add_library(${target} STATIC ${sources})
  target_link_libraries(${target} PRIVATE trammel_headers ${links})
  if(room STREQUAL idl_types)
    set_source_files_properties(${sources} PROPERTIES GENERATED ON)
    add_dependencies(${target} trammel_idl_generated)
    get_target_property(generated trammel_${room} INTERFACE_INCLUDE_DIRECTORIES)
    target_include_directories(${target} SYSTEM PRIVATE ${generated})
  else()
    trammel_compiled_as_ours(${target} trammel_pch_sanitized)
    if(room MATCHES "^idl")
      set_target_properties(${target} PROPERTIES UNITY_BUILD OFF)  # the guard and the transport name bytes alike
    endif()
  endif()
  target_compile_options(${target} PRIVATE ${options})
  list(APPEND libraries ${target})
endforeach()

# NAME_sanitized: the objects of NAME, before all of whose libraries stand the sanitized ones.
function(trammel_sanitized name)
  get_target_property(links ${name} LINK_LIBRARIES)
  add_executable(${name}_sanitized $<TARGET_OBJECTS:${name}>)
  set_target_properties(${name}_sanitized PROPERTIES LINKER_LANGUAGE CXX)
  # A room whose files are sanitized in part is compiled together otherwise than as it is shipped: its sanitized functions come first.
  target_link_options(${name}_sanitized PRIVATE ${sanitizers} -Wl,--allow-multiple-definition)
  add_dependencies(trammel_sanitized_tests ${name}_sanitized)
  target_link_libraries(${name}_sanitized PRIVATE -Wl,--whole-archive ${libraries} -Wl,--no-whole-archive ${links})
endfunction()

add_custom_target(trammel_sanitized_tests)
set(trammel_test_prefix Sanitized.)
foreach(room base robot measurement store dds config)
  file(GLOB tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${room}/*_test.cpp)
  trammel_sanitized(${room}_test)
  trammel_each_test(${room}_test_sanitized sanitized ${tests})
endforeach()
foreach(name files service)
  trammel_sanitized(fuzz_${name})
  trammel_fuzz_tests(${name} fuzz_${name}_sanitized "sanitized")
endforeach()
