// Pictures of a recorded stream with their times on the case clock, for showing and comparing: what is in the
// archive, decoded, nothing added. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "archive/case_reader.h"
#include "crypto/age_recipient.h"
#include "media/libav_handles.h"

namespace kiroku::media {

class FrameReader {
 public:
  /// Reads the segments of the stream that meet [from_ns, to_ns), whole ones: the first and last pictures may
  /// lie outside. Those that retention erased are passed over. The case and the identities must outlive the
  /// object. Throws kiroku::UsageError for a stream that is not there or has no pictures.
  FrameReader(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
              const std::string& stream, std::int64_t from_ns = INT64_MIN, std::int64_t to_ns = INT64_MAX);
  ~FrameReader();
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  /// The next picture in order of time; false after the last. Each segment's bytes are compared with the
  /// ledger's hash before any of them is decoded. A segment that was cut off ends at its first picture that
  /// is not whole. Throws kiroku::Error naming the segment: damaged, not what the ledger says, none of the
  /// identities fits.
  bool next();
  /// The picture that next() gave, as it is in the archive.
  [[nodiscard]] const AVFrame& frame() const;
  /// When it was taken, on the case clock.
  [[nodiscard]] std::int64_t time_ns() const { return time_ns_; }

 private:
  struct Segment;
  void open_next_segment();

  const archive::CaseReader& recording_;
  const crypto::AgeIdentities& identities_;
  std::string media_;
  std::vector<archive::SegmentEntry> segments_;
  std::size_t next_segment_ = 0;
  std::unique_ptr<Segment> segment_;
  std::int64_t time_ns_ = 0;
};

/// Pictures of changing formats as sRGB samples (height x width x 3), rows from the top. The same picture
/// gives the same bytes on every processor. Not thread-safe.
class RgbConverter {
 public:
  /// `width` and `height` of the result: bicubic where they are not the picture's own; 0: its own. Colours
  /// are taken as the picture says; where it does not, as BT.709 from 720 lines on, else BT.601. Throws
  /// kiroku::Error for formats that swscale does not know.
  std::vector<std::uint8_t> convert(const AVFrame& frame, int width = 0, int height = 0);

 private:
  Scaler scaler_;
};

}  // namespace kiroku::media
