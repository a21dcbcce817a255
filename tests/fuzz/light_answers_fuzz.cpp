// What a box that decodes a stranger's pictures may say of the codes in them: a line of JSON with places,
// then a line for each picture. All numbers stay within bounds, and no place makes the finder look outside of
// a picture.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "archive/format/ledger_entry.h"
#include "light/ledger_lights.h"
#include "light/light_code.h"
#include "light/light_judge.h"
#include "light/picture_finder.h"
#include "media/light/box_answers.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

constexpr std::int64_t kBegin = 1'790'000'000;  // Unix time

void require(bool holds) {
  if (!holds) std::abort();
}

light::LedgerLights ledger_of_a_minute() {
  light::LedgerLights ledger;
  for (int i = 0; i < 60; ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::seconds(kBegin + i)), i * std::int64_t{1'000'000'000}};
    entry.body = archive::ClockEntry{true, i, 0, 0, 0};
    ledger.add_line(archive::to_line(entry));
  }
  ledger.finish();
  return ledger;
}

std::string_view next_line(std::string_view& rest) {
  const std::string_view line = rest.substr(0, rest.find('\n'));
  rest.remove_prefix(std::min(rest.size(), line.size() + 1));
  return line;
}

void look(const std::vector<light::Place>& places) {
  static const std::vector<std::uint8_t> samples(64 * 48, 90);
  const light::GreyView view{samples.data(), 64, 48, 64};
  light::PictureFinder finder(places);
  finder.search(view);
  require(finder.read(view).size() <= light::PictureFinder::kMostPlaces);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const light::LedgerLights ledger = ledger_of_a_minute();
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  const auto answer = nlohmann::json::parse(next_line(rest), nullptr, false);
  const std::vector<light::Place> places = media::places_of(answer);
  require(places.size() <= light::PictureFinder::kMostPlaces);
  for (const light::Place& place : places) {
    for (const light::Point& corner : place) require(std::abs(corner.x) <= 1e5 && std::abs(corner.y) <= 1e5);
  }
  require(media::places_of(media::json_of(places)).size() == places.size());
  look(places);
  light::LightJudge judge(ledger);
  std::uint64_t pictures = 0;
  while (!rest.empty()) {
    const auto picture = media::picture_of(next_line(rest));
    if (!picture) continue;
    require(std::abs(picture->stamp) <= media::kFurthestStamp);
    require(picture->sightings.size() <= light::PictureFinder::kMostPlaces);
    for (const light::Sighting& sighting : picture->sightings) {
      require(sighting.opposite >= 0 && sighting.opposite <= light::kCodeBits);
      require(sighting.clarity >= 0 && sighting.clarity <= 1);
      for (const std::uint64_t word : sighting.words) require(word <= light::kCodeMask);
    }
    const std::string line = media::line_of(*picture);
    const auto again = media::picture_of(std::string_view(line).substr(0, line.size() - 1));
    require(again && again->stamp == picture->stamp && media::line_of(*again) == line);
    judge.add(picture->stamp / 9 * 100'000, picture->sightings);
    ++pictures;
  }
  const light::LightReport report = judge.finish();
  require(report.pictures == pictures);
  require(report.seconds <= pictures);
  require(report.agreeing + report.old + report.foreign + report.unread == report.seconds);
  require(report.exact <= report.agreeing && report.crowded <= report.unread);
  require(report.delays_ns.size() <= pictures * light::PictureFinder::kMostPlaces);
  return 0;
}
