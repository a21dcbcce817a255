#include "viewer/playback/case_playback.h"

#include <exception>
#include <limits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "crypto/encoding.h"
#include "viewer/playback/viewing_boxes.h"
#include "viewer/playback/viewing_sound.h"

namespace kiroku::playback {
namespace {

constexpr std::uint64_t kPiecesAhead = 2;
constexpr std::uint64_t kLastPiece =
    static_cast<std::uint64_t>(std::numeric_limits<Ticks>::max() / kPieceTicks) - 1;

Ticks begin_of(std::uint64_t piece) { return static_cast<Ticks>(piece) * kPieceTicks; }

bool may_hold(const VideoIndex& index, std::uint64_t piece) {
  return piece <= kLastPiece && index.may_hold(begin_of(piece), begin_of(piece) + kPieceTicks);
}

/// How everything ends that the cache holds of the case.
std::string ending_of(const std::filesystem::path& folder) {
  return " " + std::filesystem::weakly_canonical(folder).string();
}

}  // namespace

struct CasePlayback::Stream {
  explicit Stream(const CaseMedia& case_media, const VideoIndex& video)
      : index(video), boxes(case_media, video) {}

  /// Finds out the form of the copies, once; and so that the identities open this stream.
  void prepare() {
    const std::lock_guard guard(preparing);
    if (!init.bytes.empty()) return;
    format = boxes.find_format();
    init = make_init_segment(format);
  }

  /// Finds out the form of the sound, once. Apart from prepare(): one does not wait for the other.
  void prepare_sound() {
    const std::lock_guard guard(preparing_sound);
    if (sound_is_known) return;
    if ((sound = boxes.find_sound())) sound_init = make_sound_init_segment(*sound);
    sound_is_known = true;
  }

  const VideoIndex& index;
  ViewingBoxes boxes;
  std::mutex preparing;  // guards the two below until they are set
  ViewingFormat format;
  InitSegment init;
  std::mutex preparing_sound;  // guards the three below until the first is set
  bool sound_is_known = false;
  std::optional<SoundForm> sound;
  InitSegment sound_init;
};

CasePlayback::CasePlayback(archive::CaseReader recording, crypto::AgeIdentities identities,
                           std::shared_ptr<EncryptedCache> cache,
                           std::shared_ptr<const archive::SealedSource> segments)
    : media_(std::move(recording), std::move(identities), std::move(segments)),
      cache_(std::move(cache)),
      ending_(ending_of(media_.recording().folder())) {}

CasePlayback::~CasePlayback() = default;

void CasePlayback::forget_copies(EncryptedCache& cache, const std::filesystem::path& folder) {
  cache.forget_ending(ending_of(folder));
}

CasePlayback::Stream& CasePlayback::stream_of(const std::string& stream) {
  const std::lock_guard guard(mutex_);
  std::unique_ptr<Stream>& slot = streams_[media_.video(stream).stream.name];
  if (!slot) slot = std::make_unique<Stream>(media_, media_.video(stream));
  return *slot;
}

void CasePlayback::expect(const VideoIndex& index, std::uint64_t piece) const {
  media_.expect(index, index.first_reaching(begin_of(piece)), begin_of(piece) + kPieceTicks);
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

Bytes CasePlayback::cached_piece(Stream& stream, std::uint64_t number) {
  if (!may_hold(stream.index, number)) return {};
  return cached(name_of("piece", stream.index, number), [&] {
    expect(stream.index, number);
    return stream.boxes.make_piece(stream.format, number);
  });
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
                [&] { return from.boxes.make_sound_piece(*from.sound, number); });
}

Bytes CasePlayback::thumbnail(const std::string& stream, std::uint64_t number) {
  Stream& from = prepared(stream);
  if (!may_hold(from.index, number)) return {};
  return cached(name_of("thumbnail", from.index, number), [&] { return from.boxes.make_thumbnail(number); });
}

std::optional<ArchivedStill> CasePlayback::archived_picture(const std::string& stream, std::int64_t at_ns,
                                                            Step step) {
  return prepared(stream).boxes.archived_picture(at_ns, step);
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
    slot = std::make_unique<CaseVitals>(media_, *cache_, stream, name_of("vitals-2", stream, segments));
  }
  return *slot;
}

std::string CasePlayback::name_of(const std::string& what, const std::string& stream,
                                  const std::vector<archive::SegmentEntry>& segments) const {
  crypto::Sha256 sources;
  for (const archive::SegmentEntry& segment : segments) sources.update(segment.file.sha256);
  return what + " " + stream + " " + crypto::to_hex(sources.finish()) + ending_;
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
