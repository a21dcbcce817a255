// The recording's pictures, one after the other, as a film in step asks for them. Belongs to one thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/render/picture.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {

class RecordedPictures {
 public:
  /// Pictures of that size, from those of [from_ns, to_ns) on. What is given must outlive the object. As
  /// playback::PictureSpan throws.
  RecordedPictures(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                   const std::string& stream, std::int64_t from_ns, std::int64_t to_ns, int width,
                   int height);

  /// Moments must not go back. Black where nothing was recorded yet; where a recording stops for a while, its
  /// last picture stays.
  const sim::Picture& at(std::int64_t case_ns);
  /// When the picture that at() gave last was taken; nothing where that was black.
  [[nodiscard]] std::optional<std::int64_t> taken_ns() const { return taken_ns_; }

 private:
  playback::PictureSpan reader_;
  bool pending_;  // the reader holds a picture that is still to come
  sim::Picture picture_;
  std::optional<std::int64_t> taken_ns_;
};

}  // namespace kiroku::compare
