// Counts what the C++ heap of this program holds, by replacing operator new: a program that is linked with
// heap_count.cpp counts from its start. Thread-safe.
#pragma once

#include <cstddef>

namespace kiroku::test {

/// Bytes that are held now.
std::size_t heap_bytes();
/// The most since start_heap_peak(), in addition to what was held then.
std::size_t heap_peak();
void start_heap_peak();

}  // namespace kiroku::test
