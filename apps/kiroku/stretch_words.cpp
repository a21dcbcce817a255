#include "apps/kiroku/stretch_words.h"

#include <array>
#include <cstdio>
#include <utility>

#include <nlohmann/json.hpp>

#include "archive/reading/case_reader.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostTold = 3;

std::string seconds(double ns, const char* form) {
  constexpr double kNsPerSecond = 1e9;
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), form, ns / kNsPerSecond);
  return text.data();
}

/// Joined; of many the first ones, and how many more there are.
std::string listed(const std::vector<std::string>& all) {
  std::string out;
  for (std::size_t i = 0; i < all.size() && i < kMostTold; ++i) out += (i == 0 ? "" : ", ") + all[i];
  if (all.size() > kMostTold) out += " and " + std::to_string(all.size() - kMostTold) + " more";
  return out;
}

}  // namespace

std::string clock_set_words(const archive::WallClock& clock, std::int64_t begins_ns) {
  if (clock.steps().empty()) return "";
  std::vector<std::string> all;
  for (const archive::WallClock::Step& step : clock.steps()) {
    all.push_back("at " + archive::case_time_text(step.mono_ns, begins_ns) + " by " +
                  seconds(static_cast<double>(step.step_ns), "%+.3f s"));
  }
  return "The recorder's clock was set in the course of the case, " + listed(all) +
         ": times by it are as it showed them then. Time from the start of the case goes on evenly.\n";
}

ordered_json clock_set_json(const archive::WallClock& clock) {
  ordered_json all = ordered_json::array();
  for (const archive::WallClock::Step& step : clock.steps())
    all.push_back({{"case_ns", step.mono_ns}, {"step_ns", step.step_ns}});
  return all;
}

std::vector<archive::GapEntry> gaps_within(std::vector<archive::GapEntry> gaps,
                                           const archive::Span& stretch) {
  std::erase_if(gaps, [&](const archive::GapEntry& gap) {
    return !archive::meets(gap.span, stretch.start_ns, stretch.end_ns);
  });
  return gaps;
}

std::string gap_words(const std::vector<archive::GapEntry>& gaps, std::int64_t begins_ns) {
  if (gaps.empty()) return "";
  double all_ns = 0;
  std::vector<std::string> told;
  for (const archive::GapEntry& gap : gaps) {
    const double length_ns = static_cast<double>(gap.span.end_ns) - static_cast<double>(gap.span.start_ns);
    all_ns += length_ns;
    told.push_back("at " + archive::case_time_text(gap.span.start_ns, begins_ns) + " for " +
                   seconds(length_ns, "%.1f s") + " (" + std::string(archive::gap_cause_name(gap.cause)) +
                   ")");
  }
  return std::to_string(gaps.size()) + (gaps.size() == 1 ? " stated gap, " : " stated gaps, ") +
         seconds(all_ns, "%.1f s") + " in all: " + listed(told);
}

ordered_json gaps_json(const std::vector<archive::GapEntry>& gaps) {
  ordered_json all = ordered_json::array();
  for (const archive::GapEntry& gap : gaps) {
    all.push_back({{"start_ns", gap.span.start_ns},
                   {"end_ns", gap.span.end_ns},
                   {"cause", archive::gap_cause_name(gap.cause)}});
  }
  return all;
}

}  // namespace kiroku::apps
