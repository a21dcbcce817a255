// Where the tests find the source tree, the build folder and what was built. Only one object file of a build
// holds these paths, so that a compiler cache shares every other one between checkouts. Functions;
// thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace kiroku::test {

std::filesystem::path source_folder();
std::filesystem::path binary_folder();

/// The file of a program or module by the name of its CMake target, such as "kiroku". Throws
/// std::out_of_range for a target that tests/CMakeLists.txt does not list.
std::string built_file(std::string_view target);

}  // namespace kiroku::test
