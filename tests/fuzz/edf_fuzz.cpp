// EDF and EDF+ files from anywhere.
#include <cstdint>

#include "recorder/vitals/edf_reader.h"
#include "tests/fuzz/signal_files_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku;  // NOLINT(google-build-using-namespace)
  test::read_all([&] {
    return std::make_unique<recorder::EdfReader>(crypto::memory_source(std::as_bytes(std::span(data, size))),
                                                 "fuzz", std::chrono::minutes(0));
  });
  return 0;
}
