// The archived pictures of a stream during a part of its case, in order: for who looks at them once. They are
// demuxed and decoded in a box (media/box/boxed_jobs.h), and come back as samples. An object belongs to one
// thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "media/box/boxed_jobs.h"
#include "viewer/playback/case_media.h"

namespace kiroku::playback {

class PictureSpan {
 public:
  /// Pictures from the last key frame before `from_ns` on, to the end of the segment that `to_ns` is in: the
  /// first and last may lie outside. None where no segment meets the two. Throws as CaseMedia, and
  /// kiroku::UsageError for a stream that is not there or has no pictures.
  PictureSpan(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
              const std::string& stream, std::int64_t from_ns = INT64_MIN, std::int64_t to_ns = INT64_MAX);

  /// The next picture; false after the last. Times ascend. Throws as PictureReader::next(), media::MediaError
  /// where a decoder was killed by what it decodes or says what cannot be, kiroku::IoError where there is
  /// none or somebody killed it.
  bool next();

  /// The picture that next() gave: when it was taken, on the case clock, and its size in pixels.
  [[nodiscard]] std::int64_t time_ns() const { return ns_of_ticks(*time_); }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Its samples, as media::RgbConverter makes them; 0: of its own size. Throws as next().
  [[nodiscard]] std::vector<std::uint8_t> rgb(int width = 0, int height = 0);
  /// Those of the picture before it, also where next() came to the end. It must have been given.
  [[nodiscard]] std::vector<std::uint8_t> rgb_of_one_before(int width, int height);

 private:
  nlohmann::json ask(const char* what, const nlohmann::json& with, const media::BoxedJobs::Taker& take = {});
  /// A box that is about to read on from where the last one was.
  void open_box();
  std::vector<std::uint8_t> pixels(bool of_before, int width, int height);
  [[noreturn]] void refuse() const;

  CaseMedia media_;
  const VideoIndex& index_;
  bool ended_;
  std::optional<Ticks> from_, stop_;
  std::uint64_t most_pictures_;
  std::unique_ptr<media::BoxedJobs> box_;  // none before the first picture
  std::optional<Ticks> time_;
  int width_ = 0, height_ = 0;
};

}  // namespace kiroku::playback
