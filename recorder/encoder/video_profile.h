// How pictures are archived.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace kiroku::recorder {

/// Archived form of pictures: MPEG-2 in MPEG-TS; the source's pixels as they are, or losslessly packed with
/// FFV1, in Matroska.
enum class Profile { kMpeg2, kUncompressed, kLossless };
std::string_view profile_name(Profile profile);  // "mpeg2", "uncompressed", "lossless"
std::optional<Profile> parse_profile(std::string_view name);
/// The name of the stream that archives the pictures of `stream` a second time: "endoscope-lossless".
std::string second_name(const std::string& stream, Profile profile);

struct VideoProfile {
  Profile profile = Profile::kMpeg2;
  std::int64_t bit_rate = 4'000'000;  // bit/s, mpeg2 only
  bool chroma_422 = false;            // mpeg2 only: 4:2:2 instead of 4:2:0
  bool deinterlace = false;
  bool audio = false;  // record sound where the source has it: layer II beside MPEG-2, else FLAC

  [[nodiscard]] bool in_transport_stream() const { return profile == Profile::kMpeg2; }
  [[nodiscard]] std::string_view media() const {
    return in_transport_stream() ? "video/mp2t" : "video/x-matroska";
  }
};

}  // namespace kiroku::recorder
