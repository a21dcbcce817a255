#include "media/sealed_segment.h"

#include <utility>

#include "archive/format/sealed_file.h"
#include "archive/verify/found_files.h"
#include "base/error.h"

namespace kiroku::media {
namespace {

[[noreturn]] void refuse(const archive::FileReference& stated, const std::string& what) {
  throw Error("the segment file " + stated.file + " is not what the ledger says (" + what +
              "); run kiroku verify to see what else does not hold");
}

void require_sealed(const archive::ReadableFile& file, const archive::SegmentEntry& entry) {
  if (const auto why = archive::why_not_sealed(file, entry)) {
    refuse(entry.file, "it " + *why);
  }
}

std::shared_ptr<const crypto::HashTrail> recorded_trail(const crypto::ByteSource& sealed,
                                                        const archive::FileReference& stated,
                                                        const ReadProgress& progress) {
  if (const auto* const file = dynamic_cast<const archive::ReadableFile*>(&sealed)) {
    file->expect_sequential_reading();
  }
  auto trail =
      std::make_shared<const crypto::HashTrail>(crypto::HashTrail::of(sealed, crypto::HashBegin(), progress));
  if (trail->end() != stated.bytes) {
    refuse(stated, "it became shorter while it was read");
  }
  if (trail->digest() != stated.sha256) {
    refuse(stated, "its SHA-256 differs");
  }
  return trail;
}

crypto::Truncation truncation_for(bool complete) {
  return complete ? crypto::Truncation::kRefuse : crypto::Truncation::kTolerate;
}

}  // namespace

SealedSegment SealedSegment::open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities, const ReadProgress& progress) {
  auto sealed = open_file(folder, entry);
  auto trail = recorded_trail(*sealed->bytes, entry.file, progress);
  return decrypt_hashed(std::move(sealed), std::move(trail), entry, identities);
}

SealedSegment SealedSegment::open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities, crypto::HashTrails& checked) {
  return open_checked(open_file(folder, entry), entry, identities, checked);
}

SealedSegment SealedSegment::open(const archive::SealedSource& source, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities, crypto::HashTrails& checked) {
  auto sealed = std::make_unique<Sealed>();
  sealed->bytes = source.open(entry);
  sealed->name = "the stored segment " + entry.file.file;
  return open_checked(std::move(sealed), entry, identities, checked);
}

SealedSegment SealedSegment::open_checked(std::unique_ptr<Sealed> sealed, const archive::SegmentEntry& entry,
                                          const crypto::AgeIdentities& identities,
                                          crypto::HashTrails& checked) {
  auto trail = checked.find(entry.file.sha256);
  if (!trail) {
    trail = recorded_trail(*sealed->bytes, entry.file, {});
    checked.add(trail);
  }
  return decrypt_hashed(std::move(sealed), std::move(trail), entry, identities);
}

std::unique_ptr<SealedSegment::Sealed> SealedSegment::open_file(const archive::CaseFolder& folder,
                                                                const archive::SegmentEntry& entry) {
  archive::FileOpening opening = folder.open_file(entry.file.file);
  if (!opening.file) {
    throw Error("the segment file " + entry.file.file + " of " + folder.path().string() + " " +
                opening.explanation + "; run kiroku verify to see what else does not hold");
  }
  require_sealed(*opening.file, entry);
  auto sealed = std::make_unique<Sealed>();
  sealed->bytes = std::make_unique<archive::ReadableFile>(std::move(*opening.file));
  sealed->name = "the segment file " + entry.file.file + " of " + folder.path().string();
  return sealed;
}

SealedSegment SealedSegment::decrypt_hashed(std::unique_ptr<Sealed> sealed,
                                            std::shared_ptr<const crypto::HashTrail> trail,
                                            const archive::SegmentEntry& entry,
                                            const crypto::AgeIdentities& identities) {
  sealed->hashed.emplace(*sealed->bytes, std::move(trail), sealed->name);
  try {
    crypto::AgeFile plaintext =
        crypto::AgeFile::open(*sealed->hashed, identities, truncation_for(entry.complete));
    return {std::move(sealed), std::move(plaintext)};
  } catch (const crypto::AgeError& error) {
    if (archive::was_found_cut_off(entry) && error.failure() != crypto::AgeFailure::kNoMatch) {
      return {std::move(sealed), std::nullopt};
    }
    throw crypto::AgeError(error.failure(),
                           "cannot open the segment file " + entry.file.file + ": " + error.what());
  }
}

SealedSegment SealedSegment::decrypt(const crypto::ByteSource& sealed, bool complete,
                                     const crypto::AgeIdentities& identities) {
  return {nullptr, crypto::AgeFile::open(sealed, identities, truncation_for(complete))};
}

}  // namespace kiroku::media
