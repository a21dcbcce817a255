// The archived pictures of a stream during a part of its case, in order: for who looks at them once. An
// object belongs to one thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/picture_reader.h"

namespace kiroku::playback {

class PictureSpan {
 public:
  /// Pictures from the last key frame before `from_ns` on, to the end of the segment that `to_ns` is in: the
  /// first and last may lie outside. None where no segment meets the two. Throws as CaseMedia, and
  /// kiroku::UsageError for a stream that is not there or has no pictures.
  PictureSpan(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
              const std::string& stream, std::int64_t from_ns = INT64_MIN, std::int64_t to_ns = INT64_MAX);

  /// The next picture; false after the last. Throws as PictureReader::next().
  bool next();
  /// The picture that next() gave, as it is in the archive.
  [[nodiscard]] const AVFrame& frame() const { return *picture_->frame; }
  /// When it was taken, on the case clock.
  [[nodiscard]] std::int64_t time_ns() const { return ns_of_ticks(picture_->time); }

 private:
  CaseMedia media_;
  PictureReader reader_;
  bool ended_;
  std::optional<Ticks> from_;  // until the first picture is sought
  std::optional<ArchivedPicture> picture_;
};

}  // namespace kiroku::playback
