# kiroku_configure(TARGET): language level, warnings, sanitizers and the include root that every target shares.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "" FORCE)
endif()

# The same file compiled by two presets, or in two checkouts, is one entry of the cache.
find_program(KIROKU_CCACHE ccache)
if(KIROKU_CCACHE)
  set(launcher "${CMAKE_COMMAND}" -E env "CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}" CCACHE_NOHASHDIR=1
      CCACHE_SLOPPINESS=pch_defines,time_macros "${KIROKU_CCACHE}")
  set(CMAKE_C_COMPILER_LAUNCHER ${launcher})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${launcher})
endif()

# LLVM's linker is lax about the order of libraries; what GCC compiles is linked by GNU's.
find_program(KIROKU_LLD_PROGRAM ld.lld)
if(KIROKU_LLD AND NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  # GCC leaves frame descriptions of no length where the cold part of a function is empty. Of two descriptions of one address lld 14 keeps the first in its
  # search table: if that is the empty one, an exception that passes through the other function ends the program by abort().
  message(FATAL_ERROR "KIROKU_LLD needs Clang: lld loses frame descriptions of what GCC compiles. Configure without it.")
endif()
if(KIROKU_LLD AND KIROKU_LLD_PROGRAM)
  add_link_options(-fuse-ld=lld)
endif()

function(kiroku_configure target)
  target_include_directories(${target} PUBLIC "${PROJECT_SOURCE_DIR}")
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor
                                           -Woverloaded-virtual)
  if(KIROKU_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  # GCC 12 takes moved-from variants and optionals for uninitialised memory when it optimises (GCC bug 105562 and kin).
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized)
  endif()
  if(KIROKU_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${KIROKU_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all -O1)
    target_link_options(${target} PUBLIC -fsanitize=${KIROKU_SANITIZE})
    # Instrumented code makes compilers warn of what is not there; GCC's manual advises against errors of them. Other presets have them.
    target_compile_options(${target} PRIVATE -Wno-error)
  endif()
  if(KIROKU_FUZZ)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  # Eight files are one to the compiler, which reads their headers once. Names in unnamed namespaces must therefore differ within a target.
  if(KIROKU_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${target} PRIVATE -Wno-subobject-linkage)  # it takes every included file for a header
    endif()
  endif()
endfunction()

# kiroku_library(NAME SOURCES... ) with the house's options.
function(kiroku_library target)
  add_library(${target} STATIC ${ARGN})
  kiroku_configure(${target})
endfunction()

# kiroku_searched_first(TARGET LIBRARIES...): the dynamic linker seeks each of some ten thousand names in one library after the other, as they are named here,
# until it is found. Where most of them are comes first: two hundred libraries are then loaded in four fifths of the time. A sanitizer must be first itself.
function(kiroku_searched_first target)
  if(NOT KIROKU_SANITIZE)
    list(JOIN ARGN " " libraries)
    target_link_options(${target} PRIVATE "SHELL:-Wl,--push-state,--no-as-needed ${libraries} -Wl,--pop-state")
  endif()
endfunction()

# kiroku_precompile(TARGET HEADERS...): the headers that most files of a library read, and what most of them include of the standard library, compiled once.
# Only with GCC: the sanitizers' and fuzzers' builds (Clang) do without, so that a file that forgets an include is found there.
function(kiroku_precompile target)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    return()
  endif()
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <chrono> <cstdint> <filesystem> <functional> <map> <memory> <mutex> <optional> <span>
                                              <string> <string_view> <thread> <utility> <variant> <vector> ${ARGN})
  kiroku_use_precompiled(${target})
endfunction()

# kiroku_use_precompiled(TARGET): what GCC needs to be told where headers are compiled once.
function(kiroku_use_precompiled target)
  # ccache asks for the first. With it, GCC 12 sees strings overflow that it inlined itself (GCC bugs 105329, 105651).
  target_compile_options(${target} PRIVATE -fpch-preprocess -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread -Wno-restrict)
endfunction()

# kiroku_asio_coroutines(TARGET): for libraries that use Asio's coroutines, and what links them.
function(kiroku_asio_coroutines target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    # Boost 1.74 does not know that Clang has coroutines, and forgets a header for them.
    target_compile_definitions(${target} PUBLIC BOOST_ASIO_HAS_CO_AWAIT BOOST_ASIO_HAS_STD_COROUTINE)
    target_compile_options(${target} PUBLIC -include utility)
    if(KIROKU_SANITIZE MATCHES undefined)
      target_compile_options(${target} PUBLIC -fno-sanitize=function)  # Clang 14 cannot assemble coroutines with it
    endif()
  endif()
endfunction()

# kiroku_test_in_shards(NAME PROGRAM COUNT [LABEL label] [TIMEOUT seconds] [FILTER filter] [COST cost]): a GoogleTest program in COUNT processes, each with its
# share of the cases, named NAME_0 and on. What takes minutes (COST) begins first, so that no core stands idle at the end. What fails is told at once, and
# nothing of what passes: in the report of a shard it would be hard to find.
function(kiroku_test_in_shards name program count)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT;FILTER;COST" "" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL ${name})
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 600)
  endif()
  if(NOT ARG_FILTER)
    set(ARG_FILTER "*")
  endif()
  if(NOT ARG_COST)
    set(ARG_COST 100)
  endif()
  math(EXPR last "${count} - 1")
  foreach(shard RANGE ${last})
    add_test(NAME ${name}_${shard} COMMAND ${program} --gtest_filter=${ARG_FILTER} --gtest_brief=1)
    set_tests_properties(${name}_${shard} PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} COST ${ARG_COST}
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${count};GTEST_SHARD_INDEX=${shard}")
  endforeach()
endfunction()

# kiroku_use_support(TARGET NAMES...): links parts of tests/support.
function(kiroku_use_support target)
  foreach(name ${ARGN})
    target_link_libraries(${target} PRIVATE kiroku_support_${name})
  endforeach()
endfunction()

# The tests that the nightly run alone has, by their names in GoogleTest, joined for a filter.
file(STRINGS ${PROJECT_SOURCE_DIR}/tests/nightly/long_tests.txt KIROKU_LONG_TESTS REGEX "^[A-Z]")
list(TRANSFORM KIROKU_LONG_TESTS REPLACE " .*" "")
list(JOIN KIROKU_LONG_TESTS ":" KIROKU_LONG_TESTS)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/nightly/long_tests.txt)

# The headers that most tests read: half of the time a test's compilation takes goes into them. GCC compiles them once (tests/support).
set(KIROKU_TEST_HEADERS gmock/gmock.h gtest/gtest.h algorithm chrono filesystem fstream functional map memory optional string thread vector)

# kiroku_test_program(NAME SOURCES... [SUPPORT names...] LIBRARIES... [OPTIMISED]): a GoogleTest program that CTest is not told of. SUPPORT names parts of
# tests/support.
# What is tested is optimised as its preset says; the tests' own code only where it computes much itself (OPTIMISED): it compiles in half of the time without.
function(kiroku_test_program target)
  cmake_parse_arguments(ARG "OPTIMISED" "" "SOURCES;SUPPORT;LIBRARIES" ${ARGN})
  add_executable(${target} ${ARG_SOURCES})
  kiroku_configure(${target})
  kiroku_use_support(${target} ${ARG_SUPPORT})
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES} kiroku_build_paths GTest::gmock GTest::gtest_main)
  # A process a case: libraries that its files do not need would be loaded thousands of times.
  target_link_options(${target} PRIVATE -Wl,--as-needed)
  # Who opens sources or shows cases starts the decoder in its box.
  if(ARG_LIBRARIES MATCHES "kiroku_(media|recorder|procedure|daemon|playback|viewer|compare|live|commands)")
    add_dependencies(${target} kiroku-decoder)
  endif()
  # GoogleTest's macros hold the file's path. Without the checkout's own part, one checkout's objects serve another's build through the cache.
  target_compile_options(${target} PRIVATE "-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=")
  set(headers kiroku_test_headers_optimised)
  if(NOT ARG_OPTIMISED)
    set(headers kiroku_test_headers_plain)
    target_compile_options(${target} PRIVATE -O0)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_precompile_headers(${target} REUSE_FROM ${headers})
    kiroku_use_precompiled(${target})
  else()
    # What Clang precompiles holds the folder and the time of its headers: no checkout's objects would be found in the cache by another.
    list(TRANSFORM KIROKU_TEST_HEADERS PREPEND "SHELL:-include " OUTPUT_VARIABLE included)
    target_compile_options(${target} PRIVATE ${included})
  endif()
endfunction()

# Thousands of processes that each run one case of some milliseconds take minutes to begin.
set(KIROKU_TEST_PROCESSES "" CACHE STRING "Processes in which a test program runs its cases; empty: one for each case, by whose name CTest then knows it")

# kiroku_test(NAME LABEL label SOURCES... [SUPPORT names...] LIBRARIES... [TIMEOUT seconds] [OPTIMISED] [SHARDS count]): a GoogleTest program whose cases
# are found by CTest, or run in SHARDS processes where they share what is dear to make. KIROKU_TEST_PROCESSES does the same with all programs but those that
# start whole programs. The rest is as of kiroku_test_program(). Labels:
# - hostile: continuous integration runs it under the address sanitizer, too: it parses what strangers send;
# - threads: continuous integration runs it under the thread sanitizer, too: it records or serves;
# - unit, heavy: under the address sanitizer in the nightly run; unit-threads, heavy-threads: under the thread sanitizer there, too; heavy stands on
#   simulation or codecs, which take long under both;
# - attack, system;
# - optimised: not run under sanitizers, as what stands on codecs, OpenCV, Cairo or Beast has not been tried there.
function(kiroku_test target)
  cmake_parse_arguments(ARG "OPTIMISED" "LABEL;TIMEOUT;SHARDS" "SOURCES;SUPPORT;LIBRARIES" ${ARGN})
  set(optimised "")
  if(ARG_OPTIMISED)
    set(optimised OPTIMISED)
  endif()
  kiroku_test_program(${target} ${optimised} SOURCES ${ARG_SOURCES} SUPPORT ${ARG_SUPPORT} LIBRARIES ${ARG_LIBRARIES})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  if(KIROKU_SANITIZE)
    # Instrumented programs take three to ten times as long; what hangs is found a little later.
    math(EXPR ARG_TIMEOUT "4 * ${ARG_TIMEOUT}")
  endif()
  set_property(GLOBAL APPEND PROPERTY KIROKU_TESTS_${ARG_LABEL} ${target})
  # What measures real time runs alone, and what takes long in the nightly run (tests/README.md). A list as a property does not survive the discovery, so
  # the label holds both words.
  set(usual "-*RealTime*:*Nightly*:${KIROKU_LONG_TESTS}:${KIROKU_TESTS_LEFT_OUT}")
  string(REGEX REPLACE "_test$" "" name ${target})
  if(ARG_SHARDS)
    kiroku_test_in_shards(${name} ${target} ${ARG_SHARDS} LABEL ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} FILTER ${usual})
  elseif(KIROKU_TEST_PROCESSES AND NOT ARG_LABEL STREQUAL "system")
    math(EXPR ARG_TIMEOUT "4 * ${ARG_TIMEOUT}")
    kiroku_test_in_shards(${name} ${target} ${KIROKU_TEST_PROCESSES} LABEL ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} FILTER ${usual} COST 20)
  else()
    # A fresh clone knows no test's time. What takes seconds begins before what takes none, so that no core stands idle at the end. CTest learns the times of
    # tests that have no cost.
    set(cost "")
    if(ARG_LABEL MATCHES "^(system|heavy)")
      set(cost COST 10)
    endif()
    gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST TEST_FILTER ${usual} TEST_LIST ${target}_TESTS
                         PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT} ${cost})
  endif()
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST TEST_FILTER "*Nightly*:${KIROKU_LONG_TESTS}" TEST_LIST ${target}_NIGHTLY_TESTS
                       PROPERTIES LABELS "${ARG_LABEL}-nightly" TIMEOUT ${ARG_TIMEOUT})
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST TEST_FILTER "*RealTime*" TEST_LIST ${target}_REAL_TIME_TESTS
                       PROPERTIES LABELS "${ARG_LABEL}-real-time" TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ON)
endfunction()
