#include "recorder/encoder/video_profile.h"

namespace kiroku::recorder {

std::string_view profile_name(Profile profile) {
  switch (profile) {
    case Profile::kMpeg2:
      return "mpeg2";
    case Profile::kUncompressed:
      return "uncompressed";
    case Profile::kLossless:
      return "lossless";
  }
  return "unknown";
}

std::optional<Profile> parse_profile(std::string_view name) {
  for (const Profile profile : {Profile::kMpeg2, Profile::kUncompressed, Profile::kLossless}) {
    if (profile_name(profile) == name) return profile;
  }
  return {};
}

std::string second_name(const std::string& stream, Profile profile) {
  return stream + "-" + std::string(profile_name(profile));
}

}  // namespace kiroku::recorder
