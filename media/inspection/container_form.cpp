#include "media/inspection/container_form.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

extern "C" {
#include <libavformat/avformat.h>
}

#include "media/segment_input.h"

namespace kiroku::media {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw MediaError("the media of " + name + " " + what);
}

std::uint64_t as_number(std::byte byte) { return std::to_integer<std::uint64_t>(byte); }

// ISO 13818-1, 2.4.3.2.
constexpr std::size_t kPacketBytes = 188;
constexpr std::uint64_t kSyncByte = 0x47;
/// Tables of programs, of networks and of services, and what fills up.
constexpr std::array<std::uint64_t, 4> kCommonIdentifiers{0x00, 0x10, 0x11, 0x1fff};

CarriedNumbers identifiers_of(const crypto::ByteSource& source, bool complete, const std::string& name) {
  const std::uint64_t whole = source.size() - source.size() % kPacketBytes;
  if (complete && whole != source.size())
    refuse(name, "is no MPEG transport stream: it ends within a packet of 188 bytes");
  constexpr std::size_t kPacketsAtOnce = 1'394;  // of four chunks of age
  std::vector<std::byte> buffer(kPacketsAtOnce * kPacketBytes);
  CarriedNumbers carried;
  for (std::uint64_t at = 0; at < whole;) {
    const std::size_t got = source.read_at(at, buffer);
    if (got < kPacketBytes) break;  // it became shorter, which the decoder tells
    const std::span packets(buffer.data(), got - got % kPacketBytes);
    for (std::size_t begin = 0; begin < packets.size(); begin += kPacketBytes) {
      if (as_number(packets[begin]) != kSyncByte)
        refuse(name,
               "is no MPEG transport stream: at byte " + std::to_string(at + begin) + " no packet begins");
      constexpr std::uint64_t kWithPayload = 0x10;
      if ((as_number(packets[begin + 3]) & kWithPayload) != 0)
        carried.insert((as_number(packets[begin + 1]) & 0x1f) << 8U | as_number(packets[begin + 2]));
    }
    at += packets.size();
  }
  return carried;
}

/// Identifiers of Matroska's elements (RFC 9559), and of EBML's (RFC 8794).
enum Element : std::uint64_t {
  kHeader = 0x1a45dfa3,
  kSegment = 0x18538067,
  kSeekHead = 0x114d9b74,
  kInfo = 0x1549a966,
  kTracks = 0x1654ae6b,
  kTrackEntry = 0xae,
  kTrackNumber = 0xd7,
  kCluster = 0x1f43b675,
  kCues = 0x1c53bb6b,
  kTags = 0x1254c367,
  kVoid = 0xec,
  kChecksum = 0xbf,
  kTimestamp = 0xe7,
  kPosition = 0xa7,
  kPreviousSize = 0xab,
  kSimpleBlock = 0xa3,
  kBlockGroup = 0xa0,
  kBlock = 0xa1,
  kDuration = 0x9b,
  kReference = 0xfb,
  kDiscard = 0x75a2,
};

/// Of what is neither pictures nor sound none is larger.
constexpr std::uint64_t kLargestBeside = 64U << 10;
/// Space that is left for something: nothing is hidden in so little.
constexpr std::uint64_t kLargestVoid = 4'096;
/// All of it together: pieces of a film are no film, either.
constexpr std::uint64_t kMostBeside = 256U << 10;
/// A recorder writes some thousands.
constexpr std::uint64_t kMostElements = 1'000'000;

/// Walks over elements without reading what is in them.
class MatroskaWalk {
 public:
  MatroskaWalk(const crypto::ByteSource& source, bool complete, const std::string& name)
      : source_(source), end_(source.size()), complete_(complete), name_(name) {}

  CarriedNumbers run() {
    try {
      walk();
    } catch (const Ended&) {
      if (complete_) wrong("ends within an element");
    }
    return std::move(tracks_);
  }

 private:
  /// The file ends where more must come.
  struct Ended {};
  struct Head {
    std::uint64_t id = 0, at = 0, begin = 0;
    std::optional<std::uint64_t> size;  // nothing: until its parent's end
    [[nodiscard]] std::uint64_t end() const { return begin + *size; }
  };

  [[noreturn]] void wrong(const std::string& what) const {
    refuse(name_, "is no Matroska of a recorder: it " + what);
  }
  [[noreturn]] void unknown(const Head& head) const {
    wrong("has an element at byte " + std::to_string(head.at) + " that none writes there");
  }

  std::uint64_t number(std::uint64_t& at, std::size_t most, bool keeps_marker) {
    std::array<std::byte, 8> bytes{};
    const std::size_t got = peek(at, bytes);
    if (got == 0) throw Ended();
    std::size_t length = 1;
    while (length <= 8 && (as_number(bytes[0]) & (0x80U >> (length - 1))) == 0) ++length;
    if (length > most) wrong("has no element at byte " + std::to_string(at));
    if (got < length) throw Ended();
    std::uint64_t value = as_number(bytes[0]);
    if (!keeps_marker) value &= 0xffU >> length;
    for (std::size_t i = 1; i < length; ++i) value = value << 8U | as_number(bytes[i]);
    at += length;
    length_ = length;
    return value;
  }

  /// Each question to the source goes out of the box: what stands close together is asked for at once.
  std::size_t peek(std::uint64_t at, std::span<std::byte> into) {
    if (at < window_at_ || at + into.size() > window_at_ + window_.size()) {
      window_.resize(kWindow);
      window_at_ = at;
      window_.resize(source_.read_at(at, window_));
    }
    const std::size_t from = at - window_at_, got = std::min(into.size(), window_.size() - from);
    std::copy_n(window_.begin() + static_cast<std::ptrdiff_t>(from), got, into.begin());
    return got;
  }

  Head head(std::uint64_t at) {
    if (++elements_ > kMostElements) wrong("has more than " + std::to_string(kMostElements) + " elements");
    Head of;
    of.at = at;
    of.id = number(at, 4, true);
    const std::uint64_t size = number(at, 8, false);
    const bool is_unknown = size == (std::uint64_t{1} << (7 * length_)) - 1;
    of.begin = at;
    if (is_unknown) return of;
    of.size = size;
    if (size > end_ - at) {
      if (complete_) wrong("ends within an element");
      of.size = end_ - at;
    }
    return of;
  }

  void require_small(const Head& of) {
    if (!of.size || *of.size > (of.id == kVoid ? kLargestVoid : kLargestBeside)) unknown(of);
    beside_ += *of.size;
    if (beside_ > kMostBeside) wrong("has more than 256 KiB beside its pictures and its sound");
  }

  void walk() {
    const Head header = head(0);
    if (header.id != kHeader) wrong("does not begin with a header");
    require_small(header);
    const Head segment = head(header.end());
    if (segment.id != kSegment) unknown(segment);
    if (segment.size && segment.end() != end_) wrong("goes on behind its segment");
    bool in_cluster = false, has_tracks = false;
    for (std::uint64_t at = segment.begin; at < end_;) {
      const Head of = head(at);
      switch (of.id) {
        case kCluster:
          in_cluster = !of.size;
          if (of.size) cluster(of);
          break;
        case kTracks:
          if (has_tracks) wrong("states its tracks twice");
          has_tracks = true;
          require_small(of);
          tracks(of);
          break;
        case kSeekHead:
        case kInfo:
        case kTags:
        case kCues:
        case kVoid:
        case kChecksum:
          require_small(of);
          break;
        default:
          if (!in_cluster) unknown(of);
          in_cluster_element(of);
      }
      at = of.size ? of.end() : of.begin;
    }
  }

  /// Numbers of tracks, which blocks state.
  void tracks(const Head& parent) {
    for (std::uint64_t at = parent.begin; at < parent.end();) {
      const Head of = head(at);
      if (!of.size || of.end() > parent.end()) unknown(of);
      if (of.id == kTrackEntry) track(of);
      at = of.end();
    }
  }

  void track(const Head& parent) {
    for (std::uint64_t at = parent.begin; at < parent.end();) {
      const Head of = head(at);
      if (!of.size || of.end() > parent.end()) unknown(of);
      if (of.id == kTrackNumber) {
        std::array<std::byte, 8> bytes{};
        if (*of.size == 0 || *of.size > bytes.size()) unknown(of);
        const std::size_t length = peek(of.begin, std::span(bytes).first(*of.size));
        std::uint64_t value = 0;
        for (const std::byte byte : std::span(bytes).first(length)) value = value << 8U | as_number(byte);
        tracks_.insert(value);
      }
      at = of.end();
    }
  }

  void cluster(const Head& parent) {
    for (std::uint64_t at = parent.begin; at < parent.end();) {
      const Head of = head(at);
      in_cluster_element(of);
      at = of.end();
      if (at > parent.end()) unknown(of);
    }
  }

  void in_cluster_element(const Head& of) {
    if (!of.size) unknown(of);
    switch (of.id) {
      case kSimpleBlock:
        block(of);
        return;
      case kBlockGroup:
        for (std::uint64_t at = of.begin; at < of.end();) {
          const Head part = head(at);
          if (!part.size) unknown(part);
          if (part.id == kBlock) {
            block(part);
          } else if (part.id != kDuration && part.id != kReference && part.id != kDiscard) {
            unknown(part);
          }
          at = part.end();
          if (at > of.end()) unknown(part);
        }
        return;
      case kTimestamp:
      case kPosition:
      case kPreviousSize:
      case kVoid:
      case kChecksum:
        require_small(of);
        return;
      default:
        unknown(of);
    }
  }

  void block(const Head& of) {
    std::uint64_t at = of.begin;
    const std::uint64_t track = number(at, 8, false);
    if (!tracks_.contains(track))
      wrong("has a block of a track that it does not state, at byte " + std::to_string(of.at));
  }

  const crypto::ByteSource& source_;
  const std::uint64_t end_;
  const bool complete_;
  const std::string& name_;
  static constexpr std::size_t kWindow = 4'096;
  std::vector<std::byte> window_;
  std::uint64_t window_at_ = 0;
  std::uint64_t elements_ = 0, beside_ = 0;
  std::size_t length_ = 0;  // of the last number
  CarriedNumbers tracks_;
};

}  // namespace

CarriedNumbers numbers_carried(const crypto::ByteSource& source, const std::string& media, bool complete,
                               const std::string& name) {
  return media == "video/mp2t" ? identifiers_of(source, complete, name)
                               : MatroskaWalk(source, complete, name).run();
}

void require_one_film(const AVFormatContext& found, const CarriedNumbers& carried, const std::string& name) {
  std::size_t films = 0, sounds = 0, others = 0;
  CarriedNumbers known;
  for (const AVStream* stream : std::span(found.streams, found.nb_streams)) {
    const AVMediaType type = stream->codecpar->codec_type;
    ++(type == AVMEDIA_TYPE_VIDEO ? films : type == AVMEDIA_TYPE_AUDIO ? sounds : others);
    known.insert(static_cast<std::uint64_t>(stream->id));
  }
  if (films != 1 || sounds > 1 || others > 0 || found.nb_programs > 1)
    refuse(name, "has " + std::to_string(films) + " streams of pictures, " + std::to_string(sounds) +
                     " of sound and " + std::to_string(others) + " of something else in " +
                     std::to_string(found.nb_programs) +
                     " programs, where a recorder writes one of pictures and at most one of sound");
  if (found.nb_programs == 0) {  // Matroska's demuxer gives streams no numbers
    if (carried.size() == found.nb_streams) return;
    refuse(name, "states " + std::to_string(carried.size()) + " tracks, of which " +
                     std::to_string(found.nb_streams) + " can be read");
  }
  known.insert(kCommonIdentifiers.begin(), kCommonIdentifiers.end());
  known.insert(static_cast<std::uint64_t>(found.programs[0]->pmt_pid));
  const auto beside =
      std::ranges::find_if(carried, [&](std::uint64_t each) { return !known.contains(each); });
  if (beside != carried.end())
    refuse(name, "carries something beside its pictures and its sound, under the number " +
                     std::to_string(*beside));
}

}  // namespace kiroku::media
