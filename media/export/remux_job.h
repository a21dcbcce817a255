// What libav does of an export, demuxing and muxing, is done in a box (box/boxed_jobs.h): whoever made a case
// may have made it to attack who exports it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "media/box/boxed_jobs.h"
#include "media/box/job_box.h"
#include "media/output_file.h"
#include "media/remuxer.h"

namespace kiroku::media {

struct RemuxTerms {
  struct Input {
    std::string name;  // in errors
    bool complete = true;
  };
  Container container = Container::kMatroska;
  std::string media;           // of the inputs, as StreamInfo::media
  std::string stream, output;  // names in errors
  /// By number as the door knows them. Where they are one run of bytes (SequentialReader), the door gives it
  /// as number 0, and it is read from its beginning to its end.
  std::vector<Input> inputs;
  bool is_run = false;
  /// Added to time stamps; nothing: what brings the first picture to `first_at`.
  std::optional<Ticks> shift;
  Ticks first_at = 0;
  /// More bytes, written anywhere, or more pictures than these are not believed.
  std::uint64_t most_bytes = 0, most_pictures = 0;
};

struct RemuxResult {
  std::uint64_t frames = 0;
  /// Where pictures change so that they cannot go on in one file: the input's number, and a sentence without
  /// an end.
  std::optional<std::size_t> changed_at;
  std::string change;
};

/// Writes the container into `output`. `on_picture` may be empty; both are called on this thread. Throws what
/// the door and the output throw, what Remuxer does, MediaError where the box was killed by what it read or
/// says what cannot be, kiroku::IoError where there is none.
RemuxResult remux_in_box(const RemuxTerms& terms, const SegmentDoor& door, OutputFile& output,
                         const std::function<void(Ticks time)>& on_picture);

/// The container's own time stamp of the first picture of `segment`; nothing where it states none. Throws
/// likewise.
std::optional<Ticks> first_stamp_in_box(const crypto::ByteSource& segment, const std::string& media,
                                        const std::string& name);

/// In the box: what it can be asked for.
Jobs remux_jobs();

}  // namespace kiroku::media
