// The transfer functions that come with the program: the texts of the files of `transfer/`, put into
// transfer_presets.cpp when the project is configured. Immutable.
#pragma once

#include <span>

namespace kiroku::sim {

struct TransferPreset {
  const char* name;  // the file's, without ".json"
  const char* text;
};
/// By name.
std::span<const TransferPreset> transfer_presets();

}  // namespace kiroku::sim
