#include "archive/format/segment_media.h"

#include <algorithm>
#include <array>
#include <utility>

#include "archive/format/case_layout.h"

namespace kiroku::archive {
namespace {

constexpr std::string_view kTransportStream = "video/mp2t";
constexpr std::string_view kMatroska = "video/x-matroska";
constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kProfiles{
    {{"mpeg2", kTransportStream}, {"uncompressed", kMatroska}, {"lossless", kMatroska}}};

std::string path_with(const StreamInfo& stream, const SegmentEntry& segment, std::string_view extension) {
  std::string path = segment_path(stream.name, segment.index, extension);
  if (!segment.complete) path += kPartSuffix;
  return path;
}

}  // namespace

std::optional<std::string_view> media_of_profile(std::string_view profile) {
  const auto* const found =
      std::ranges::find(kProfiles, profile, &std::pair<std::string_view, std::string_view>::first);
  return found == kProfiles.end() ? std::nullopt : std::optional(found->second);
}

MediaUnit unit_of_media(std::string_view media) {
  if (media == kTransportStream) return {"1/90000", 90'000};
  if (media == kMatroska) return {"1/1000", 1'000};
  return {"1/1000000000", 1'000'000'000};
}

bool is_of_the_format(const StreamInfo& stream) {
  if (stream.kind == "video") return media_of_profile(stream.profile) == stream.media;
  const bool has_lines = stream.kind == "vitals" || stream.kind == "events";
  return has_lines && stream.media == kLinesMedia && stream.profile == kLinesProfile;
}

std::vector<std::string> extensions_of(const StreamInfo& stream) {
  std::vector<std::string> extensions{stream.extension};
  if (stream.kind != "video") return extensions;
  for (const std::string_view media : {kTransportStream, kMatroska}) {
    const std::string_view extension = *extension_of_media(media);
    if (extension != stream.extension) extensions.emplace_back(extension);
  }
  return extensions;
}

std::string file_of(const StreamInfo& stream, const SegmentEntry& segment) {
  if (const auto media = media_of_profile(segment.profile))
    return path_with(stream, segment, *extension_of_media(*media));
  if (!segment.counted) {
    for (const std::string& extension : extensions_of(stream)) {
      if (std::string path = path_with(stream, segment, extension); path == segment.file.file) return path;
    }
  }
  return path_with(stream, segment, stream.extension);
}

std::string media_of(const StreamInfo& stream, const SegmentEntry& segment) {
  if (stream.kind != "video") return stream.media;
  for (const std::string_view media : {kTransportStream, kMatroska}) {
    const std::string ending = "." + std::string(*extension_of_media(media)) + ".age";
    const std::string& file = segment.file.file;
    if (file.ends_with(ending) || file.ends_with(ending + std::string(kPartSuffix)))
      return std::string(media);
  }
  return stream.media;
}

std::string profile_of(const StreamInfo& stream, const SegmentEntry& segment) {
  if (!segment.profile.empty()) return segment.profile;
  if (segment.counted) return stream.profile;
  const std::string media = media_of(stream, segment);
  if (media == kTransportStream) return "mpeg2";
  return "";
}

}  // namespace kiroku::archive
