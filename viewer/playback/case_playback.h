// Watching a case with an identity: viewing copies of its videos in pieces, thumbnails, the archived pictures
// themselves, vital signs at any zoom, and marks. Thread-safe.
//
// A viewing copy is what it is called: the archived MPEG-2 or uncompressed pictures coded anew as H.264,
// because browsers play nothing else; coded with loss, woven from fields where they were recorded so, and
// fitted into one size where a stream changed its own. Its times are the archive's, to 1/90000 s, and it has
// one picture for each archived one: none is added, left out or moved. Where nothing was recorded there is
// nothing. Sound is the archived one, sample for sample. It is no evidence: that is the archive, which
// archived_picture() shows and an export hands out.
//
// Segments are demuxed and decoded in boxes (viewing_boxes.h), which see one stream's plaintext and no key.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "base/bytes.h"
#include "crypto/age_recipient.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/case_pointing.h"
#include "viewer/playback/case_timeline.h"
#include "viewer/playback/case_vitals.h"
#include "viewer/playback/encrypted_cache.h"
#include "viewer/playback/piece_encoder.h"
#include "viewer/playback/read_ahead.h"
#include "viewer/playback/single_flight.h"
#include "viewer/playback/still_pictures.h"

namespace kiroku::playback {

class CasePlayback {
 public:
  /// Looks at the case as `recording` knows it: of one that is still being recorded, what was entered by
  /// then. `cache` may be shared with others; it keeps nothing apart for them: what an identity may not see
  /// is refused before the cache is asked. `segments` as of CaseMedia. Throws kiroku::Error if the folder
  /// cannot be opened.
  CasePlayback(archive::CaseReader recording, crypto::AgeIdentities identities,
               std::shared_ptr<EncryptedCache> cache,
               std::shared_ptr<const archive::SealedSource> segments = nullptr);
  ~CasePlayback();
  CasePlayback(const CasePlayback&) = delete;
  CasePlayback& operator=(const CasePlayback&) = delete;

  // All of these throw kiroku::UsageError for a stream that is not there or has no pictures, and
  // kiroku::Error in a sentence where what lies there is not what the ledger says, does not open with these
  // identities, or cannot be decoded. A segment's bytes are compared with the ledger before the first of them
  // is used.

  /// Goes before any piece of the stream. Throws kiroku::UsageError where no picture was recorded.
  InitSegment init_segment(const std::string& stream);
  /// Piece `number`, which covers [number * 2 s, (number + 1) * 2 s) of the case clock; empty where nothing
  /// was recorded. The next ones are made ready meanwhile.
  Bytes piece(const std::string& stream, std::uint64_t number);
  /// The sound beside the pictures of a stream (viewer/playback/viewing_sound.h): what goes before its
  /// pieces, or nothing for a stream without sound.
  std::optional<InitSegment> sound_init_segment(const std::string& stream);
  /// Its piece `number`, which covers what piece() may; empty where nothing was recorded, and for a stream
  /// without sound.
  Bytes sound_piece(const std::string& stream, std::uint64_t number);
  /// A JPEG file of the piece, 160 pixels wide, from a key frame; empty where nothing was recorded.
  Bytes thumbnail(const std::string& stream, std::uint64_t number);
  /// An archived picture, unchanged but for its colour space; nothing where there is none.
  std::optional<ArchivedStill> archived_picture(const std::string& stream, std::int64_t at_ns, Step step);

  /// Of a stream of vital signs, made at the first call: then the case's vital signs begin to be read.
  CaseVitals& vitals(const std::string& stream);
  /// What the operator marked.
  [[nodiscard]] TimelineMarks marks() const { return marks_of(media_); }
  /// Where people pointed (viewer/playback/case_pointing.h).
  [[nodiscard]] std::vector<PointingStroke> pointing_strokes() const {
    return playback::pointing_strokes(media_);
  }
  [[nodiscard]] std::vector<media::PointingLine> pointing(std::int64_t from_ns, std::int64_t to_ns) const {
    return pointing_of(media_, from_ns, to_ns);
  }
  [[nodiscard]] const archive::CaseReader& recording() const { return media_.recording(); }
  /// Forgets what the cache holds of the case in `folder`, whoever put it there. An object that lives may put
  /// more there afterwards.
  static void forget_copies(EncryptedCache& cache, const std::filesystem::path& folder);

 private:
  struct Stream;

  Stream& stream_of(const std::string& stream);
  Stream& prepared(const std::string& stream);
  /// The segments of the piece will be opened soon.
  void expect(const VideoIndex& index, std::uint64_t piece) const;
  void require_readable(const std::vector<archive::SegmentEntry>& segments) const;
  /// What the cache knows by the name; made, once for all who ask meanwhile, where it does not.
  [[nodiscard]] Bytes cached(const std::string& name, const std::function<Bytes()>& make);
  [[nodiscard]] Bytes cached_piece(Stream& stream, std::uint64_t number);
  /// Changes with everything that the result depends on.
  [[nodiscard]] std::string name_of(const std::string& what, const std::string& stream,
                                    const std::vector<archive::SegmentEntry>& segments) const;
  /// `reach`: so far before and after the piece it looks.
  [[nodiscard]] std::string name_of(const std::string& what, const VideoIndex& index, std::uint64_t number,
                                    Ticks reach = 0) const;

  const CaseMedia media_;
  const std::shared_ptr<EncryptedCache> cache_;
  const std::string ending_;  // of the names of its copies
  std::mutex mutex_;          // guards the two below, not what they refer to
  std::map<std::string, std::unique_ptr<Stream>> streams_;
  std::map<std::string, std::unique_ptr<CaseVitals>> vitals_;
  SingleFlight<Bytes> making_;
  ReadAhead ahead_;  // last: its thread uses the rest
};

}  // namespace kiroku::playback
