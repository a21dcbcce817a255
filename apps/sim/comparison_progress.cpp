#include "apps/sim/comparison_progress.h"

#include <cstdint>
#include <iostream>

#include <nlohmann/json.hpp>

namespace kiroku::apps {
namespace {

void print_line(const std::string& doing, const nlohmann::ordered_json& share) {
  std::cerr << nlohmann::ordered_json{{"doing", doing}, {"share", share}}.dump() << std::endl;
}

}  // namespace

void ComparisonTold::begin(const std::string& step) {
  shares_.reset();
  doing_ = step;
  last_percent_ = 0;
  if (for_programs_) {
    print_line(step, nullptr);
    return;
  }
  steps_.emplace();
  steps_->show(step);
}

void ComparisonTold::update(double share) {
  constexpr int kPercent = 100;
  if (for_programs_) {
    const int percent = static_cast<int>(share * kPercent);
    if (percent == last_percent_) return;
    last_percent_ = percent;
    print_line(doing_, double(percent) / kPercent);
    return;
  }
  if (!shares_) {
    steps_.reset();
    shares_.emplace(doing_);
  }
  constexpr double kParts = 1000;
  shares_->update(static_cast<std::uint64_t>(share * kParts), static_cast<std::uint64_t>(kParts));
}

void ComparisonTold::clear() {
  shares_.reset();
  steps_.reset();
}

}  // namespace kiroku::apps
