#include "media/sealed_segment.h"

#include "archive/found_files.h"
#include "base/error.h"
#include "crypto/hash.h"

namespace kiroku::media {
namespace {

constexpr std::size_t kReadBytes = 1U << 20;

void require_recorded_bytes(const crypto::ByteSource& file, const archive::FileReference& stated,
                            const ReadProgress& progress) {
  const auto refuse = [&](const std::string& what) {
    throw Error("the segment file " + stated.file + " is not what the ledger says (" + what +
                "); run kiroku verify to see what else does not hold");
  };
  if (file.size() != stated.bytes) {
    refuse("it has " + std::to_string(file.size()) + " bytes, not " + std::to_string(stated.bytes));
  }
  crypto::Sha256 hash;
  Bytes buffer(kReadBytes);
  for (std::uint64_t offset = 0; offset < stated.bytes;) {
    const std::size_t count = file.read_at(offset, buffer);
    if (count == 0) {
      refuse("it became shorter while it was read");
    }
    hash.update(ByteView(buffer).first(count));
    offset += count;
    if (progress) {
      progress(count);
    }
  }
  if (hash.finish() != stated.sha256) {
    refuse("its SHA-256 differs");
  }
}

crypto::Truncation truncation_for(bool complete) {
  return complete ? crypto::Truncation::kRefuse : crypto::Truncation::kTolerate;
}

}  // namespace

SealedSegment SealedSegment::open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities, const ReadProgress& progress) {
  return open_after(folder, entry, identities, [&](const archive::ReadableFile& file) {
    file.expect_sequential_reading();
    require_recorded_bytes(file, entry.file, progress);
  });
}

SealedSegment SealedSegment::open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities, CheckedFiles& checked) {
  return open_after(folder, entry, identities, [&](const archive::ReadableFile& file) {
    const archive::FileIdentity before = file.identity();
    if (before.size == entry.file.bytes && checked.contains(before, entry.file.sha256)) {
      return;
    }
    file.expect_sequential_reading();
    require_recorded_bytes(file, entry.file, {});
    if (file.identity() == before) {  // else somebody wrote while it was read
      checked.add(before, entry.file.sha256);
    }
  });
}

SealedSegment SealedSegment::open_after(
    const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
    const crypto::AgeIdentities& identities,
    const std::function<void(const archive::ReadableFile& file)>& compare) {
  archive::FileOpening opening = folder.open_file(entry.file.file);
  if (!opening.file) {
    throw Error("the segment file " + entry.file.file + " of " + folder.path().string() + " " +
                opening.explanation + "; run kiroku verify to see what else does not hold");
  }
  auto file = std::make_unique<archive::ReadableFile>(std::move(*opening.file));
  compare(*file);
  try {
    crypto::AgeFile plaintext = crypto::AgeFile::open(*file, identities, truncation_for(entry.complete));
    return {std::move(file), std::move(plaintext)};
  } catch (const crypto::AgeError& error) {
    if (archive::was_found_cut_off(entry) && error.failure() != crypto::AgeFailure::kNoMatch) {
      return {std::move(file), std::nullopt};
    }
    throw crypto::AgeError(error.failure(),
                           "cannot open the segment file " + entry.file.file + ": " + error.what());
  }
}

SealedSegment SealedSegment::open_unchecked(const std::filesystem::path& sealed_file, bool complete,
                                            const crypto::AgeIdentities& identities) {
  auto file = crypto::open_file_source(sealed_file);
  crypto::AgeFile plaintext = crypto::AgeFile::open(*file, identities, truncation_for(complete));
  return {std::move(file), std::move(plaintext)};
}

}  // namespace kiroku::media
