// The video streams of a case on its clock, and their segments as plaintext. Immutable after construction but
// for what it remembers of hashed files; thread-safe.
//
// Where a picture stands on the case clock: media/stream_clock.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "media/sealed_segment.h"
#include "viewer/playback/case_ticks.h"

namespace kiroku::playback {

struct IndexedSegment {
  archive::SegmentEntry entry;
  /// Time of the first picture; of a segment that recovery found, where the stream was accounted for.
  Ticks start = 0;
  /// Every picture's time is before it.
  Ticks end = 0;
  /// Its pictures may differ in size and form from those before: it is the first, follows a gap, or has
  /// another profile.
  bool begins_run = false;
  /// Time stamp minus case-clock time of what it holds, in ticks; nothing where no entry of the stream with
  /// such media states a time stamp.
  std::optional<Ticks> offset = {};
};

/// The segments of one video stream that are there, in order; erased ones are left out.
struct VideoIndex {
  archive::StreamInfo stream;
  std::vector<IndexedSegment> segments;

  /// The first segment that may hold a picture at or after `time`; segments.size() if none.
  [[nodiscard]] std::size_t first_reaching(Ticks time) const;
  /// Whether a segment may hold a picture in [from, to).
  [[nodiscard]] bool may_hold(Ticks from, Ticks to) const;
};

/// Segments as plaintext: of a case that is open here, or in a box, where whoever has the case is asked.
class SegmentOpener {
 public:
  virtual ~SegmentOpener() = default;
  /// Throws as media::SealedSegment::open.
  [[nodiscard]] virtual std::unique_ptr<crypto::ByteSource> open_plaintext(
      const archive::SegmentEntry& segment) const = 0;
};

class CaseMedia : public SegmentOpener {
 public:
  /// `segments`: where they are instead of in the recording's folder; null: there. Throws kiroku::UsageError,
  /// kiroku::IoError as archive::CaseFolder::open.
  CaseMedia(archive::CaseReader recording, crypto::AgeIdentities identities,
            std::shared_ptr<const archive::SealedSource> segments = nullptr);

  [[nodiscard]] const archive::CaseReader& recording() const { return recording_; }
  [[nodiscard]] const crypto::AgeIdentities& identities() const { return identities_; }
  /// Throws kiroku::UsageError if there is no such stream, or it is none of pictures.
  [[nodiscard]] const VideoIndex& video(const std::string& stream) const;
  /// The whole file is compared with the ledger's hash when it is opened first, and each block again when it
  /// is decrypted. Throws as media::SealedSegment::open.
  [[nodiscard]] media::SealedSegment open(const archive::SegmentEntry& segment) const;
  /// Segments `index` has from `first` on, which begin before `before`, will be opened soon.
  void expect(const VideoIndex& index, std::size_t first, Ticks before) const;
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open_plaintext(
      const archive::SegmentEntry& segment) const override {
    return std::make_unique<media::SealedSegment>(open(segment));
  }

 private:
  archive::CaseReader recording_;
  crypto::AgeIdentities identities_;
  archive::CaseFolder folder_;
  std::shared_ptr<const archive::SealedSource> segments_;
  std::vector<VideoIndex> videos_;
  mutable crypto::HashTrails checked_;
};

}  // namespace kiroku::playback
