// Recordings of Vital Recorder from anywhere: what begins with VITA is compressed first, so that damage
// reaches the packets and not only the compression.
#include <cstdint>
#include <zlib.h>

#include "recorder/vitals/vital_file_reader.h"
#include "tests/fuzz/signal_files_fuzz.h"

namespace {

kiroku::Bytes compressed(kiroku::ByteView bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_NO_COMPRESSION, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    std::abort();
  kiroku::Bytes packed(deflateBound(&stream, bytes.size()));
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  if (deflate(&stream, Z_FINISH) != Z_STREAM_END) std::abort();
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku;  // NOLINT(google-build-using-namespace)
  const ByteView bytes = std::as_bytes(std::span(data, size));
  const Bytes file = text_of(bytes).starts_with("VITA") ? compressed(bytes) : to_bytes(bytes);
  test::read_all(
      [&] { return std::make_unique<recorder::VitalFileReader>(*crypto::memory_source(file), "fuzz"); });
  return 0;
}
