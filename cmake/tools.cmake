# What only tools need, only tools link.
find_package(PkgConfig REQUIRED)
pkg_check_modules(ASSIMP REQUIRED IMPORTED_TARGET assimp)
pkg_check_modules(JANSSON REQUIRED IMPORTED_TARGET jansson)
pkg_check_modules(MINIZIP REQUIRED IMPORTED_TARGET minizip)
pkg_check_modules(PNG REQUIRED IMPORTED_TARGET libpng)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(CMOCKA REQUIRED IMPORTED_TARGET cmocka)
find_library(EMBREE_LIBRARY embree3 REQUIRED)

file(GLOB UMB_IO_SOURCES CONFIGURE_DEPENDS tools/io/*.c)
if(UMB_IO_SOURCES)
  add_library(umb_io STATIC ${UMB_IO_SOURCES})
  target_include_directories(umb_io PUBLIC tools)
  target_link_libraries(umb_io PUBLIC umbrage_inside PRIVATE PkgConfig::ASSIMP PkgConfig::JANSSON
                        PkgConfig::MINIZIP PkgConfig::PNG PkgConfig::XXHASH m)
endif()

file(GLOB UMB_TRUTH_SOURCES CONFIGURE_DEPENDS tools/truth/*.c)
if(UMB_TRUTH_SOURCES)
  add_library(umb_truth STATIC ${UMB_TRUTH_SOURCES})
  target_include_directories(umb_truth PUBLIC tools)
  target_link_libraries(umb_truth PUBLIC umb_io PRIVATE ${EMBREE_LIBRARY} m)
endif()

file(GLOB UMB_PROGRAM_SOURCES CONFIGURE_DEPENDS tools/umbrage/*.c)
if(UMB_PROGRAM_SOURCES)
  add_executable(umbrage-program ${UMB_PROGRAM_SOURCES})
  set_target_properties(umbrage-program PROPERTIES OUTPUT_NAME umbrage
                        RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
  target_link_libraries(umbrage-program PRIVATE umbrage_bake_inside umb_truth umb_io PkgConfig::JANSSON
                        PkgConfig::XXHASH m)
endif()

# The libraries that tests, fuzz targets and benchmarks look inside of, as far as they exist.
set(UMB_INSIDE)
foreach(library umb_truth umb_io)
  if(TARGET ${library})
    list(APPEND UMB_INSIDE ${library})
  endif()
endforeach()
list(APPEND UMB_INSIDE umbrage_bake_inside umbrage_inside)

# bench/compare: the library beside its rivals, in a library that is tested, and one program. The rivals get
# what makes them fast, loose floats included; bench/yardstick_ISA.c has its instruction set's flags, as the
# core's kernels have.
file(GLOB UMB_COMPARE_SOURCES CONFIGURE_DEPENDS bench/compare/*.c)
list(FILTER UMB_COMPARE_SOURCES EXCLUDE REGEX "/compare\\.c$")
add_library(umb_compare STATIC EXCLUDE_FROM_ALL ${UMB_COMPARE_SOURCES} bench/yardstick.c bench/yardstick_avx2.c)
target_include_directories(umb_compare PUBLIC bench PRIVATE src tools)
target_link_libraries(umb_compare PUBLIC ${UMB_INSIDE} PRIVATE PkgConfig::JANSSON PkgConfig::XXHASH
                      ${EMBREE_LIBRARY} ${CMAKE_DL_LIBS} m)
set(UMB_RIVAL_FLAGS -O3 -fno-trapping-math -fno-signed-zeros -ffinite-math-only)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  list(APPEND UMB_RIVAL_FLAGS -mavx2 -mfma)
  set_source_files_properties(bench/yardstick_avx2.c PROPERTIES COMPILE_OPTIONS "-O3;-mavx2")
endif()
foreach(rival screen_boxes zbuffer zbuffer_tree ray_buffer)
  set_source_files_properties(bench/compare/${rival}.c PROPERTIES COMPILE_OPTIONS "${UMB_RIVAL_FLAGS}")
endforeach()

include(cmake/tests.cmake)
target_link_libraries(test_compare PRIVATE umb_compare)

# bench/bench_NAME.c is one program.
if(UMB_BENCH)
  file(GLOB UMB_BENCH_SOURCES CONFIGURE_DEPENDS bench/bench_*.c bench/compare/compare.c)
  foreach(source ${UMB_BENCH_SOURCES})
    get_filename_component(name ${source} NAME_WE)
    add_executable(${name} ${source})
    target_include_directories(${name} PRIVATE src tools)
    target_link_libraries(${name} PRIVATE umb_compare ${UMB_INSIDE} m)
    set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bench)
  endforeach()
endif()
