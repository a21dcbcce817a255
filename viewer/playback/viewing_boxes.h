// One stream of a case, shown without a byte of it being demuxed or decoded in this process: boxes
// (media/box/boxed_jobs.h) make what is shown, from plaintext that this end compares and decrypts. Boxes are
// of one stream and one reader each, and end with the object. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>

#include "media/box/boxed_jobs.h"
#include "media/box/job_box.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/sound_reader.h"
#include "viewer/playback/still_pictures.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

class ViewingBoxes {
 public:
  /// Both must outlive the object.
  ViewingBoxes(const CaseMedia& media, const VideoIndex& index);

  // All throw what they do when called here: PictureReader, SoundReader; media::MediaError where a decoder
  // was killed by what it decodes or says what cannot be, kiroku::IoError where there is none.

  ViewingFormat find_format();
  Bytes make_piece(const ViewingFormat& format, std::uint64_t number);
  std::optional<SoundForm> find_sound();
  Bytes make_sound_piece(const SoundForm& form, std::uint64_t number);
  /// Of piece `number`.
  Bytes make_thumbnail(std::uint64_t number);
  /// As PictureStepper and png_of_archived().
  std::optional<ArchivedStill> archived_picture(std::int64_t at_ns, Step step);

 private:
  /// Where what a job makes is put, and how much that may be.
  struct Result {
    Bytes* bytes = nullptr;
    std::size_t most = 0;
  };
  nlohmann::json ask(media::BoxedJobs& box, const char* what, const nlohmann::json& with,
                     const Result& result);
  nlohmann::json ask(const char* what, const nlohmann::json& with, const Result& result);
  void tell_index(media::BoxedJobs& box);

  const CaseMedia& media_;
  const VideoIndex& index_;
  media::BoxPool boxes_;
  std::mutex stepping_;                        // guards what follows
  std::unique_ptr<media::BoxedJobs> stepper_;  // keeps pictures that it decoded
};

/// In the box: what it can be asked for.
media::Jobs viewing_jobs();

}  // namespace kiroku::playback
