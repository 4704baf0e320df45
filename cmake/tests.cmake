# Tests. tests/README.md says how they are run and sized.
enable_testing()

# Common to all tests: suppressions for what is not ours, and where the program is.
set(UMB_TEST_ENVIRONMENT
    "LSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/lsan.supp:print_suppressions=0"
    "TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/tsan.supp:second_deadlock_stack=1"
    "UBSAN_OPTIONS=print_stacktrace=1"
    "UMBRAGE_SOURCE=${CMAKE_SOURCE_DIR}")
if(TARGET umbrage-program)
  list(APPEND UMB_TEST_ENVIRONMENT "UMBRAGE_PROGRAM=$<TARGET_FILE:umbrage-program>")
endif()

function(umb_add_test name label)
  add_test(NAME ${name} COMMAND ${ARGN})
  set_tests_properties(${name} PROPERTIES LABELS ${label}
                       ENVIRONMENT "${UMB_TEST_ENVIRONMENT}")
endfunction()

# tests/support: what several tests share, and the soak run too.
file(GLOB UMB_SUPPORT_SOURCES CONFIGURE_DEPENDS tests/support/*.c)
add_library(umb_test_support STATIC ${UMB_SUPPORT_SOURCES})
target_include_directories(umb_test_support PUBLIC tests PRIVATE src)
target_link_libraries(umb_test_support PUBLIC ${UMB_INSIDE} PRIVATE PkgConfig::CMOCKA PkgConfig::JANSSON m)

# Tests of which one program is run in several parts, side by side.
set(UMB_TEST_PARTS_test_scenes 2)
set(UMB_TEST_PARTS_test_scenes_by_index 2)

# tests/test_NAME.c is one program. They may look inside src/ and tools/.
file(GLOB UMB_TEST_SOURCES CONFIGURE_DEPENDS tests/test_*.c)
foreach(source ${UMB_TEST_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_include_directories(${name} PRIVATE src tools tests)
  target_link_libraries(${name} PRIVATE umb_test_support ${UMB_INSIDE} PkgConfig::CMOCKA
                        PkgConfig::JANSSON m)
  if(UMB_TEST_PARTS_${name})
    math(EXPR last "${UMB_TEST_PARTS_${name}} - 1")
    foreach(part RANGE ${last})
      umb_add_test(${name}_${part} unit ${name} ${part} ${UMB_TEST_PARTS_${name}})
    endforeach()
  else()
    umb_add_test(${name} unit ${name})
  endif()
endforeach()

# tests/soak: the long run, one program; `make soak` runs all of it, the tests its short plan.
file(GLOB UMB_SOAK_SOURCES CONFIGURE_DEPENDS tests/soak/*.c)
add_executable(soak ${UMB_SOAK_SOURCES})
target_link_libraries(soak PRIVATE umb_test_support ${UMB_INSIDE} PkgConfig::XXHASH Threads::Threads m)
umb_add_test(soak soak bash ${CMAKE_SOURCE_DIR}/tests/soak/soak.sh $<TARGET_FILE:soak>)

# tests/cli/NAME.sh is run with UMBRAGE_PROGRAM set; beside it NAME.expected is what it must print.
if(TARGET umbrage-program)
  file(GLOB UMB_CLI_TESTS CONFIGURE_DEPENDS tests/cli/*.sh)
  foreach(script ${UMB_CLI_TESTS})
    get_filename_component(name ${script} NAME_WE)
    umb_add_test(cli_${name} cli ${CMAKE_SOURCE_DIR}/scripts/expect
                 ${CMAKE_SOURCE_DIR}/tests/cli/${name}.expected bash ${script})
  endforeach()
endif()

# examples/NAME.c is one program that needs nothing but the public headers; NAME.expected is what it
# must print.
file(GLOB UMB_EXAMPLES CONFIGURE_DEPENDS examples/*.c)
foreach(source ${UMB_EXAMPLES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(example_${name} ${source})
  target_link_libraries(example_${name} PRIVATE umbrage)
  umb_add_test(example_${name} example ${CMAKE_SOURCE_DIR}/scripts/expect
               ${CMAKE_SOURCE_DIR}/examples/${name}.expected $<TARGET_FILE:example_${name}>)
endforeach()

# tests/fuzz/fuzz_NAME.c holds LLVMFuzzerTestOneInput. With UMB_FUZZ it becomes a fuzzer; without, a
# test that feeds it tests/fuzz/corpus/NAME/* and mutations of them.
file(GLOB UMB_FUZZ_SOURCES CONFIGURE_DEPENDS tests/fuzz/fuzz_*.c)
foreach(source ${UMB_FUZZ_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  string(REPLACE "fuzz_" "" reader ${name})
  if(UMB_FUZZ)
    add_executable(${name} ${source})
    target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  else()
    add_executable(${name} ${source} tests/fuzz/mutate.c)
    umb_add_test(${name} fuzz ${name} ${CMAKE_SOURCE_DIR}/tests/fuzz/corpus/${reader})
  endif()
  target_include_directories(${name} PRIVATE src tools)
  target_link_libraries(${name} PRIVATE ${UMB_INSIDE} m)
endforeach()
