// What the box that looks for codes in pictures, or in sound, says of them, as text and JSON. Whoever sends
// the video may have taken the box over, so it says what it likes: all numbers are held within bounds here.
// Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "light/picture_finder.h"

namespace kiroku::media {

/// One picture, or one thing in sound that may be a code, as the box said.
struct ReadPicture {
  std::int64_t stamp = 0;  // in 1/90000 s, within kFurthestStamp either way
  std::vector<light::Sighting> sightings;
};
/// 25 years: no case lasts so long, and a wall clock's nanoseconds and these fit into 64 bits.
inline constexpr std::int64_t kFurthestStamp = std::int64_t{1} << 46;

/// With LF: numbers between spaces. `stamp`; then for each place that was looked at `opposite`, `clarity` in
/// thousandths and kViews words.
std::string line_of(const ReadPicture& picture);
/// Without LF; nothing of what is no such line, or tells of more than PictureFinder::kMostPlaces places.
std::optional<ReadPicture> picture_of(std::string_view line);

/// Phases of "phases" as light::SoundFinder takes them, at most kMostPhases; what is none is left out.
std::vector<int> sound_phases_of(const nlohmann::json& answer);

nlohmann::json json_of(const std::vector<light::Place>& places);
/// At most PictureFinder::kMostPlaces; what is no place is left out.
std::vector<light::Place> places_of(const nlohmann::json& all);

}  // namespace kiroku::media
