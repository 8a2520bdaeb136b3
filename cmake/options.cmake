# twofold::options carries what every target is compiled with. Levels and sanitizers come from the presets.
set(TWOFOLD_ARCH "x86-64-v3" CACHE STRING "Value of -march= ; the program checks it at start")
set(TWOFOLD_SANITIZE "" CACHE STRING "Comma separated list for -fsanitize=")
option(TWOFOLD_WERROR "Treat warnings as errors" OFF)

add_library(twofold_options INTERFACE)
add_library(twofold::options ALIAS twofold_options)
target_compile_features(twofold_options INTERFACE cxx_std_20)
target_include_directories(twofold_options INTERFACE ${PROJECT_SOURCE_DIR})
# Everywhere, so that all files agree on the macros that precompiled headers were read with.
target_link_libraries(twofold_options INTERFACE fmt::fmt)

target_compile_options(twofold_options INTERFACE
  -march=${TWOFOLD_ARCH} -Wall -Wextra -Wno-array-bounds $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> -Wshadow -Wnon-virtual-dtor)
# Eigen's alignment decides the layout of public types: fixed here, so that it does not follow -march.
target_compile_definitions(twofold_options INTERFACE EIGEN_MAX_ALIGN_BYTES=32 TWOFOLD_ARCH="${TWOFOLD_ARCH}")
if(TWOFOLD_SHARED)
  # For all files, as libtwofold.so takes in the libraries; hidden, so that functions are still inlined and called as in
  # a program.
  target_compile_options(twofold_options INTERFACE -fPIC -fvisibility=hidden -fvisibility-inlines-hidden)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # By itself the compiler searches its memory for garbage every hundred megabytes, and finds next to none in what Eigen's
  # templates become: a tenth of its time. Its largest process grows from 1.4 to 1.7 GB; what it writes stays as it is.
  target_compile_options(twofold_options INTERFACE "SHELL:--param ggc-min-expand=1000" "SHELL:--param ggc-min-heapsize=2000000")
endif()
if(TWOFOLD_WERROR)
  target_compile_options(twofold_options INTERFACE -Werror)
endif()
if(TWOFOLD_SANITIZE)
  target_compile_options(twofold_options INTERFACE -fsanitize=${TWOFOLD_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(twofold_options INTERFACE -fsanitize=${TWOFOLD_SANITIZE})
endif()

# Most of a compiler's time goes into reading the same few headers. Two sets of them are read once each: what libraries
# and programs use, and what tests add. A file still includes what it uses: the preset dev builds without. CLI11 is left
# out: its objects and virtual functions are compiled in every file that sees it, five seconds each.
option(TWOFOLD_PCH "Precompile the headers that most files include" ON)
set(twofold_core_headers
  <algorithm> <array> <atomic> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <optional> <span> <string>
  <utility> <vector> <Eigen/Core> <Eigen/Cholesky> <Eigen/Geometry> <Eigen/LU> <fmt/format.h>
  <opencv2/core.hpp>)
# twofold_headers(name HEADERS ... LIBS ... OPTIONS ...): those above and more; twofold_use_headers(target name) then takes
# them.
function(twofold_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBS;OPTIONS" ${ARGN})
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled/${name}.cpp CONTENT "// carries precompiled headers\n")
  add_library(twofold_headers_${name} OBJECT ${CMAKE_BINARY_DIR}/precompiled/${name}.cpp)
  target_link_libraries(twofold_headers_${name} PRIVATE twofold::options Eigen3::Eigen opencv_core ${ARG_LIBS})
  target_precompile_headers(twofold_headers_${name} PRIVATE ${twofold_core_headers} ${ARG_HEADERS})
  target_compile_options(twofold_headers_${name} PRIVATE ${ARG_OPTIONS})
endfunction()
function(twofold_use_headers target name)
  if(TWOFOLD_PCH)
    target_precompile_headers(${target} REUSE_FROM twofold_headers_${name})
  endif()
endfunction()

# Who builds everything compiles the files of a room or a test in batches: less than half of the processor time. Who changes one
# file at a time turns it off; the preset dev does.
option(TWOFOLD_UNITY "Compile the files of a library or test in batches" ON)

# twofold_library(name SOURCES ... PUBLIC ... PRIVATE ...): one static library a folder, alias twofold::name.
function(twofold_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(twofold_${name} STATIC ${ARG_SOURCES})
  add_library(twofold::${name} ALIAS twofold_${name})
  target_link_libraries(twofold_${name} PUBLIC twofold::options ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  twofold_use_headers(twofold_${name} core)
  set_target_properties(twofold_${name} PROPERTIES UNITY_BUILD ${TWOFOLD_UNITY} UNITY_BUILD_BATCH_SIZE 12)
endfunction()

# twofold_program(name SOURCES ... LIBS ...): a command, benchmark or experiment.
function(twofold_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE twofold::options ${ARG_LIBS})
  twofold_use_headers(${name} core)
endfunction()

# twofold_check_cpu(target shown): the program or shared library looks at the processor before all else, and says what it
# lacks instead of dying of an instruction. The check itself is for every x86-64 processor.
function(twofold_check_cpu target shown)
  if(TWOFOLD_ARCH MATCHES "^x86-64-v[234]$" AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    add_library(${target}_cpu_level OBJECT ${PROJECT_SOURCE_DIR}/cmake/cpu_level.cpp)
    target_compile_options(${target}_cpu_level PRIVATE -march=x86-64 -fPIC)
    target_compile_definitions(${target}_cpu_level PRIVATE TWOFOLD_ARCH="${TWOFOLD_ARCH}" TWOFOLD_BINARY="${shown}")
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${target}_cpu_level>)
  endif()
endfunction()

# What a registered test needs around it under a sanitizer; nothing without one.
function(twofold_sanitizer_environment name)
  if(TWOFOLD_SANITIZE)
    # ThreadSanitizer does not see how the libraries of the system wait for the threads of their own: they stay on one.
    set_tests_properties(${name} PROPERTIES
      ENVIRONMENT "OMP_THREAD_LIMIT=1;OPENBLAS_NUM_THREADS=1;TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/tests/tsan.supp")
  endif()
endfunction()

# twofold_emulated(name file variable): the program, or where programs are emulated a script that has the emulator run it. It
# calls itself what the script is called: a program that starts itself again starts the script.
function(twofold_emulated name file variable)
  if(CMAKE_CROSSCOMPILING_EMULATOR)
    list(JOIN CMAKE_CROSSCOMPILING_EMULATOR " " emulator)
    set(script ${CMAKE_BINARY_DIR}/emulated/${name})
    file(GENERATE OUTPUT ${script} CONTENT "#!/bin/sh\nexec ${emulator} -0 ${script} ${file} \"$@\"\n"
      FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
    set(file ${script})
  endif()
  set(${variable} ${file} PARENT_SCOPE)
endfunction()

# twofold_command(target variable): likewise of a program that is built here.
function(twofold_command target variable)
  twofold_emulated(${target} $<TARGET_FILE:${target}> command)
  set(${variable} ${command} PARENT_SCOPE)
endfunction()

# What a test adds to the libraries runs once: -O3 keeps its compiler busy for half as long again. Libraries, fixtures and programs
# are what they are for users; only of a template's function that a library does not inline the linker may take the test's copy.
set(twofold_test_options $<$<CONFIG:Release>:-O1>)

# twofold_test(name [ALONE] [COST seconds] SOURCES ... LIBS ...): one GoogleTest program, registered as one ctest case. ALONE:
# cameras play in real time in it; no other test runs beside it. COST: about how long it takes, for tests that take longest: they
# begin first, so that none is left at the end to run beside nothing.
function(twofold_test name)
  cmake_parse_arguments(ARG "ALONE" "TIMEOUT;COST" "SOURCES;LIBS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  # Who looks at the fixture's scene has its headers by what it tests.
  target_link_libraries(${name} PRIVATE twofold::options ${ARG_LIBS} $<LINK_ONLY:twofold::fixture_scene> GTest::gtest GTest::gtest_main)
  target_compile_options(${name} PRIVATE ${twofold_test_options})
  twofold_use_headers(${name} tests)
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${TWOFOLD_UNITY})
  # It replaces operator new of the whole program, and stays by itself.
  set_source_files_properties(../allocation_counter.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  add_test(NAME ${name} COMMAND ${name})
  if(CMAKE_CROSSCOMPILING)
    math(EXPR ARG_TIMEOUT "40 * ${ARG_TIMEOUT}")  # emulated
  elseif(TWOFOLD_SANITIZE)
    math(EXPR ARG_TIMEOUT "5 * ${ARG_TIMEOUT}")
  endif()
  twofold_sanitizer_environment(${name})
  set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ${ARG_ALONE})
  if(ARG_COST)
    set_tests_properties(${name} PROPERTIES COST ${ARG_COST})
  endif()
  add_dependencies(tests ${name})
  if(ARG_ALONE)
    set_tests_properties(${name} PROPERTIES LABELS real_time)
  endif()
endfunction()
