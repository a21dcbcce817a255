// WFDB records from anywhere: the header up to the first NUL, behind it the bytes of every signal file.
#include <algorithm>
#include <cstdint>

#include "recorder/vitals/wfdb_reader.h"
#include "tests/fuzz/signal_files_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku;  // NOLINT(google-build-using-namespace)
  const ByteView bytes = std::as_bytes(std::span(data, size));
  const auto header_size = static_cast<std::size_t>(std::ranges::find(bytes, std::byte{0}) - bytes.begin());
  const ByteView signals = bytes.subspan(std::min(header_size + 1, size));
  test::read_all([&] {
    return std::make_unique<recorder::WfdbReader>(
        *crypto::memory_source(bytes.first(header_size)), "fuzz", std::chrono::minutes(0),
        [&](const std::string&) { return crypto::memory_source(signals); });
  });
  return 0;
}
