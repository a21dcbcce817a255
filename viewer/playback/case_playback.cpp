#include "viewer/playback/case_playback.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <thread>
#include <utility>
#include <vector>

extern "C" {
#include <libavutil/frame.h>
}

#include "base/error.h"
#include "crypto/encoding.h"
#include "viewer/playback/viewing_pictures.h"
#include "viewer/playback/viewing_sound.h"

namespace kiroku::playback {
namespace {

/// Where a stream's pictures may have changed is looked at so often at most: the first picture must not wait
/// for all interruptions of a long day.
constexpr std::size_t kMostRunsLookedAt = 24;
constexpr std::uint64_t kPiecesAhead = 2;
/// A picture lasts until the next one, unless that is so far away that nobody knows what was to be seen.
constexpr Ticks kLongestPicture = 2 * kTicksPerSecond;
constexpr Ticks kUnknownDuration = kTicksPerSecond / 25;
constexpr std::uint64_t kLastPiece =
    static_cast<std::uint64_t>(std::numeric_limits<Ticks>::max() / kPieceTicks) - 1;

Ticks begin_of(std::uint64_t piece) { return static_cast<Ticks>(piece) * kPieceTicks; }

bool may_hold(const VideoIndex& index, std::uint64_t piece) {
  return piece <= kLastPiece && index.may_hold(begin_of(piece), begin_of(piece) + kPieceTicks);
}

int decoding_threads(const VideoIndex& index) {
  // FFV1 takes several times as long as the others.
  return index.stream.profile == "lossless"
             ? std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4)
             : 1;
}

/// The form that all of the stream's pictures go into: that of the largest.
ViewingFormat find_format(const CaseMedia& media, const VideoIndex& index) {
  std::optional<ViewingFormat> largest;
  std::exception_ptr failure;
  std::size_t looked_at = 0;
  for (const IndexedSegment& segment : index.segments) {
    if (!segment.begins_run) continue;
    if (looked_at++ == kMostRunsLookedAt) break;
    try {
      PictureReader reader(media, index);
      reader.seek(segment.start);
      const std::optional<ArchivedPicture> picture = reader.next();
      if (!picture) continue;
      const ViewingFormat format = viewing_format_of(*picture->frame, picture->usual_duration);
      if (!largest || format.width * format.height > largest->width * largest->height) largest = format;
    } catch (const Error&) {
      if (!failure) failure = std::current_exception();
    }
  }
  if (largest) return *largest;
  if (failure) std::rethrow_exception(failure);
  throw UsageError("stream '" + index.stream.name + "' has no picture in it");
}

}  // namespace

struct CasePlayback::Stream {
  explicit Stream(const CaseMedia& case_media, const VideoIndex& video)
      : media(case_media), index(video), stepper(case_media, video) {}

  /// Finds out the form of the copies, once; and so that the identities open this stream.
  void prepare() {
    const std::lock_guard guard(preparing);
    if (!init.bytes.empty()) return;
    format = find_format(media, index);
    init = make_init_segment(format);
  }

  /// Finds out the form of the sound, once. Apart from prepare(): one does not wait for the other.
  void prepare_sound() {
    const std::lock_guard guard(preparing_sound);
    if (sound_is_known) return;
    if ((sound = find_sound(media, index))) sound_init = make_sound_init_segment(*sound);
    sound_is_known = true;
  }

  const CaseMedia& media;
  const VideoIndex& index;
  std::mutex preparing;  // guards the two below until they are set
  ViewingFormat format;
  InitSegment init;
  std::mutex preparing_sound;  // guards the three below until the first is set
  bool sound_is_known = false;
  std::optional<SoundForm> sound;
  InitSegment sound_init;
  std::mutex stepping;  // guards stepper
  PictureStepper stepper;
};

CasePlayback::CasePlayback(archive::CaseReader recording, crypto::AgeIdentities identities,
                           std::shared_ptr<EncryptedCache> cache)
    : media_(std::move(recording), std::move(identities)),
      cache_(std::move(cache)),
      folder_(std::filesystem::weakly_canonical(media_.recording().folder()).string()) {}

CasePlayback::~CasePlayback() = default;

CasePlayback::Stream& CasePlayback::stream_of(const std::string& stream) {
  const std::lock_guard guard(mutex_);
  std::unique_ptr<Stream>& slot = streams_[media_.video(stream).stream.name];
  if (!slot) slot = std::make_unique<Stream>(media_, media_.video(stream));
  return *slot;
}

CasePlayback::Stream& CasePlayback::prepared(const std::string& stream) {
  Stream& found = stream_of(stream);
  found.prepare();
  return found;
}

InitSegment CasePlayback::init_segment(const std::string& stream) { return prepared(stream).init; }

Bytes CasePlayback::piece(const std::string& stream, std::uint64_t number) {
  Stream& from = prepared(stream);
  Bytes piece = cached_piece(from, number);
  for (std::uint64_t next = number + kPiecesAhead; next > number; --next) {
    ahead_.add([this, &from, next] { (void)cached_piece(from, next); });
  }
  return piece;
}

Bytes CasePlayback::cached(const std::string& name, const std::function<Bytes()>& make) {
  return making_.get(name, [&] {
    if (std::optional<Bytes> known = cache_->get(name)) return std::move(*known);
    Bytes made = make();
    cache_->put(name, made);
    return made;
  });
}

Bytes CasePlayback::cached_piece(const Stream& stream, std::uint64_t number) {
  if (!may_hold(stream.index, number)) return {};
  return cached(name_of("piece", stream.index, number), [&] { return make_piece(stream, number); });
}

Bytes CasePlayback::make_piece(const Stream& stream, std::uint64_t number) const {
  const Ticks from = begin_of(number);
  const Ticks to = from + kPieceTicks;
  const VideoIndex& index = stream.index;
  PictureReader reader(media_, index, Decoding::kEveryPicture, decoding_threads(index));
  reader.stop_before(to);
  reader.seek(from);
  ViewingPictures viewing(stream.format);
  PieceEncoder encoder(stream.format);
  Ticks last = 0, usual = 0;
  std::optional<Ticks> following;
  while (std::optional<ArchivedPicture> picture = reader.next()) {
    if (picture->time >= to) {
      following = picture->time;
      break;
    }
    if (picture->time >= from) {
      last = picture->time;
      usual = picture->usual_duration;
    }
    for (const ArchivedPicture& ready : viewing.add(std::move(*picture))) {
      if (ready.time >= from) encoder.add(ready);
    }
  }
  for (const ArchivedPicture& ready : viewing.finish()) {
    if (ready.time >= from) encoder.add(ready);
  }
  if (!following) {
    const auto next = std::find_if(index.segments.begin(), index.segments.end(),
                                   [&](const IndexedSegment& segment) { return segment.start >= to; });
    if (next != index.segments.end()) following = next->start;
  }
  const bool known = following && *following - last <= kLongestPicture;
  return encoder.finish(known ? *following : last + (usual > 0 ? usual : kUnknownDuration),
                        static_cast<std::uint32_t>(number + 1));
}

std::optional<InitSegment> CasePlayback::sound_init_segment(const std::string& stream) {
  Stream& from = stream_of(stream);
  from.prepare_sound();
  if (!from.sound) return std::nullopt;
  return from.sound_init;
}

Bytes CasePlayback::sound_piece(const std::string& stream, std::uint64_t number) {
  Stream& from = stream_of(stream);
  from.prepare_sound();
  if (!from.sound || !may_hold(from.index, number)) return {};
  return cached(name_of("sound", from.index, number, kSoundReach),
                [&] { return make_sound_piece(media_, from.index, *from.sound, number); });
}

Bytes CasePlayback::thumbnail(const std::string& stream, std::uint64_t number) {
  const VideoIndex& index = prepared(stream).index;
  if (!may_hold(index, number)) return {};
  return cached(name_of("thumbnail", index, number), [&] {
    const Ticks from = begin_of(number);
    return make_thumbnail(media_, index, from, from + kPieceTicks);
  });
}

std::optional<ArchivedStill> CasePlayback::archived_picture(const std::string& stream, std::int64_t at_ns,
                                                            Step step) {
  Stream& from = prepared(stream);
  media::Frame picture;
  Ticks time = 0;
  {
    const std::lock_guard guard(from.stepping);
    const ArchivedPicture* const found = from.stepper.find(ticks_of_ns(at_ns), step);
    if (found == nullptr) return std::nullopt;
    picture = media::reference(*found->frame);
    time = found->time;
  }
  return ArchivedStill{png_of_archived(*picture), ns_of_ticks(time)};
}

/// What an identity may not see is refused before the cache is asked.
void CasePlayback::require_readable(const std::vector<archive::SegmentEntry>& segments) const {
  std::exception_ptr failure;
  for (const archive::SegmentEntry& segment : segments) {
    if (media_.recording().is_erased(segment)) continue;
    try {
      (void)media_.open(segment);
      return;
    } catch (const crypto::AgeError&) {
      throw;
    } catch (const Error&) {
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

CaseVitals& CasePlayback::vitals(const std::string& stream) {
  const std::lock_guard guard(mutex_);
  std::unique_ptr<CaseVitals>& slot = vitals_[media_.recording().stream(stream).name];
  if (!slot) {
    auto segments = media_.recording().segments(stream, INT64_MIN, INT64_MAX);
    // What was erased since may not come back out of the cache.
    std::erase_if(segments, [&](const auto& segment) { return media_.recording().is_erased(segment); });
    require_readable(segments);
    slot = std::make_unique<CaseVitals>(media_, *cache_, stream, name_of("vitals", stream, segments));
  }
  return *slot;
}

std::string CasePlayback::name_of(const std::string& what, const std::string& stream,
                                  const std::vector<archive::SegmentEntry>& segments) const {
  crypto::Sha256 sources;
  for (const archive::SegmentEntry& segment : segments) sources.update(segment.file.sha256);
  return what + " " + stream + " " + crypto::to_hex(sources.finish()) + " " + folder_;
}

std::string CasePlayback::name_of(const std::string& what, const VideoIndex& index, std::uint64_t number,
                                  Ticks reach) const {
  const Ticks from = begin_of(number) - reach;
  const Ticks to = begin_of(number) + kPieceTicks + reach;
  std::vector<archive::SegmentEntry> segments;
  for (std::size_t i = index.first_reaching(from); i < index.segments.size() && index.segments[i].start < to;
       ++i) {
    segments.push_back(index.segments[i].entry);
  }
  return name_of(what + " " + std::to_string(number), index.stream.name, segments);
}

}  // namespace kiroku::playback
