#include "trainer/psychophysics/threshold_method.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {
namespace {

std::optional<double> geometric_mean(std::span<const double> logs) {
  if (logs.empty()) return std::nullopt;
  return std::pow(10, std::accumulate(logs.begin(), logs.end(), 0.0) / static_cast<double>(logs.size()));
}

class Search : public ThresholdMethod {
 public:
  explicit Search(RateSeries series) : series_(series) {}
  std::size_t next_rate() override { return middle(); }
  void answer(bool vibrating) override {
    // Rates fall with i: where it vibrates, the threshold is above, at a lesser i.
    (vibrating ? greatest_ : least_) = middle();
    if (greatest_ - least_ > 1) return;
    found_.push_back((std::log10(rate_hz(series_, std::max<std::size_t>(least_, 1))) +
                      std::log10(rate_hz(series_, std::min(greatest_, rates_of(series_))))) /
                     2);
    least_ = 0;
    greatest_ = rates_of(series_) + 1;
  }
  std::optional<double> own_estimate_hz() const override { return geometric_mean(found_); }

 private:
  [[nodiscard]] std::size_t middle() const { return (least_ + greatest_) / 2; }

  RateSeries series_;
  // Continuous at the first, vibrating at the second.
  std::size_t least_ = 0, greatest_ = rates_of(series_) + 1;
  std::vector<double> found_;
};

class Staircase : public ThresholdMethod {
 public:
  explicit Staircase(RateSeries series) : series_(series) {}
  std::size_t next_rate() override { return nearest_rate(series_, std::pow(10, log_hz_)); }
  void answer(bool vibrating) override {
    const double log_given = std::log10(rate_hz(series_, next_rate()));
    if (last_ && *last_ != vibrating) {
      if (step_ <= kLeastStep) turns_.push_back(log_given);
      step_ = std::max(step_ / 2, kLeastStep);
    }
    last_ = vibrating;
    log_hz_ = std::clamp(log_hz_ + (vibrating ? step_ : -step_),
                         std::log10(rate_hz(series_, rates_of(series_))), std::log10(rate_hz(series_, 1)));
  }
  std::optional<double> own_estimate_hz() const override {
    const std::size_t odd = turns_.size() % 2;
    return geometric_mean(std::span(turns_).subspan(odd));
  }

 private:
  static constexpr double kFirstStep = 0.32, kLeastStep = 0.04;
  RateSeries series_;
  double log_hz_ = 1, step_ = kFirstStep;
  std::optional<bool> last_;
  std::vector<double> turns_;
};

class Bayesian : public ThresholdMethod {
 public:
  explicit Bayesian(RateSeries series) : posterior_(series) {}
  std::size_t next_rate() override {
    if (!next_) next_ = posterior_.most_telling_rate();
    return *next_;
  }
  void answer(bool vibrating) override {
    posterior_.add(next_rate(), vibrating);
    next_.reset();
  }
  std::optional<double> own_estimate_hz() const override { return posterior_.estimate().hz; }

 private:
  ThresholdPosterior posterior_;
  std::optional<std::size_t> next_;
};

constexpr std::array<const char*, 3> kNames{"search", "staircase", "bayesian"};

}  // namespace

MethodKind method_kind(const std::string& name) {
  const auto found = std::ranges::find(kNames, name);
  if (found == kNames.end())
    throw UsageError("'" + name + "' is no method: it must be search, staircase or bayesian");
  return static_cast<MethodKind>(found - kNames.begin());
}

std::string name_of(MethodKind kind) { return kNames[static_cast<std::size_t>(kind)]; }

std::unique_ptr<ThresholdMethod> make_method(MethodKind kind, RateSeries series) {
  if (kind == MethodKind::kSearch) return std::make_unique<Search>(series);
  if (kind == MethodKind::kStaircase) return std::make_unique<Staircase>(series);
  return std::make_unique<Bayesian>(series);
}

}  // namespace kiroku::trainer
