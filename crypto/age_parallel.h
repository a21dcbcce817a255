// A whole age payload decrypted by several threads. Runs of chunks are handed out in order; memory is a few
// runs a thread, whatever the file's size.
#pragma once

#include <filesystem>

#include "crypto/age_chunk_reader.h"

namespace kiroku::crypto {

/// See AgeFile::read_all.
void read_payload_in_order(const AgePayload& payload, const ByteSink& sink, unsigned threads);
/// See AgeFile::write_to.
void write_payload_to_file(const AgePayload& payload, int file_descriptor, const std::filesystem::path& name,
                           const ByteProgress& progress, unsigned threads);

}  // namespace kiroku::crypto
