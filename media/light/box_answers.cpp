#include "media/light/box_answers.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <nlohmann/json.hpp>

#include "light/light_code.h"
#include "light/sound_finder.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

constexpr std::size_t kNumbersOfSighting = 2 + light::kViews;
constexpr std::size_t kMostNumbers = 1 + light::PictureFinder::kMostPlaces * kNumbersOfSighting;
constexpr std::int64_t kThousand = 1'000;

}  // namespace

std::string line_of(const ReadPicture& picture) {
  std::string line = std::to_string(picture.stamp);
  for (const light::Sighting& sighting : picture.sightings) {
    line += " " + std::to_string(sighting.opposite) + " " +
            std::to_string(std::lround(sighting.clarity * kThousand));
    for (const std::uint64_t word : sighting.words) line += " " + std::to_string(word);
  }
  return line + "\n";
}

std::optional<ReadPicture> picture_of(std::string_view line) {
  std::vector<std::int64_t> numbers;
  while (!line.empty()) {
    std::int64_t number = 0;
    const auto [end, failed] = std::from_chars(line.data(), line.data() + line.size(), number);
    if (failed != std::errc() || numbers.size() == kMostNumbers) return std::nullopt;
    numbers.push_back(number);
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    if (line.empty()) break;
    if (line.front() != ' ') return std::nullopt;
    line.remove_prefix(1);
  }
  if (numbers.size() % kNumbersOfSighting != 1) return std::nullopt;
  ReadPicture picture{std::clamp(numbers[0], -kFurthestStamp, kFurthestStamp), {}};
  for (std::size_t at = 1; at < numbers.size(); at += kNumbersOfSighting) {
    light::Sighting sighting;
    sighting.opposite = static_cast<int>(std::clamp<std::int64_t>(numbers[at], 0, light::kCodeBits));
    sighting.clarity =
        static_cast<double>(std::clamp<std::int64_t>(numbers[at + 1], 0, kThousand)) / kThousand;
    for (std::size_t view = 0; view < light::kViews; ++view)
      sighting.words[view] = static_cast<std::uint64_t>(numbers[at + 2 + view]) & light::kCodeMask;
    picture.sightings.push_back(sighting);
  }
  return picture;
}

std::vector<int> sound_phases_of(const json& answer) {
  std::vector<int> phases;
  const auto all = answer.find("phases");
  if (all == answer.end() || !all->is_array()) return phases;
  for (const json& one : *all) {
    if (phases.size() == light::SoundFinder::kMostPhases) break;
    if (one.is_number_integer())
      phases.push_back(static_cast<int>(
          std::clamp<std::int64_t>(one.get<std::int64_t>(), 0, light::SoundFinder::kPeriodSamples - 1)));
  }
  return phases;
}

json json_of(const std::vector<light::Place>& places) {
  json all = json::array();
  for (const light::Place& place : places) {
    json one = json::array();
    for (const light::Point& corner : place) one.insert(one.end(), {corner.x, corner.y});
    all.push_back(std::move(one));
  }
  return all;
}

std::vector<light::Place> places_of(const json& all) {
  std::vector<light::Place> places;
  if (!all.is_array()) return places;
  for (const json& one : all) {
    light::Place place;
    if (!one.is_array() || one.size() != 2 * place.size()) continue;
    if (!std::all_of(one.begin(), one.end(), [](const json& number) { return number.is_number(); })) continue;
    for (std::size_t i = 0; i < place.size(); ++i)
      place[i] = {std::clamp(one[2 * i].get<double>(), -1e5, 1e5),
                  std::clamp(one[2 * i + 1].get<double>(), -1e5, 1e5)};
    places.push_back(place);
    if (places.size() == light::PictureFinder::kMostPlaces) break;
  }
  return places;
}

}  // namespace kiroku::media
