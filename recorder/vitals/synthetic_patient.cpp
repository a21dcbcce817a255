#include "recorder/vitals/synthetic_patient.h"

#include <atomic>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include "base/error.h"
#include "media/vital_codes.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/patient_model.h"

namespace kiroku::recorder {
namespace {

constexpr int kStepsPerSecond = PatientModel::kStepsPerSecond;
constexpr std::int64_t kStepNs = 1'000'000'000 / kStepsPerSecond;
constexpr std::uint64_t kBlockSteps = 100;
constexpr std::uint64_t kPlethEverySteps = 2;
constexpr std::uint64_t kTemperatureEveryS = 10;
constexpr std::uint64_t kCuffEveryS = 180, kFirstCuffS = 10;

/// As a monitor shows it: to a multiple of 1 / `parts`, and never minus zero.
double rounded(double value, double parts = 1) { return std::round(value * parts) / parts + 0.0; }

class SyntheticPatient : public VitalSource {
 public:
  explicit SyntheticPatient(const SourceAddress& address)
      : SyntheticPatient(checked_seed(address),
                         static_cast<std::uint64_t>(integer_option(address, "flash", 0, 0, 86'400)),
                         integer_option(address, "waves", 1, 0, 1) == 1) {}

  std::optional<VitalLine> next() override {
    while (!interrupted_ && ready_.empty()) {
      advance();
    }
    if (interrupted_) {
      return std::nullopt;
    }
    VitalLine line = std::move(ready_.front());
    ready_.pop_front();
    return line;
  }
  void interrupt() noexcept override { interrupted_ = true; }

 private:
  SyntheticPatient(std::uint64_t seed, std::uint64_t flash_every_s, bool waves)
      : model_(seed, waves), flash_every_s_(flash_every_s), waves_(waves) {
    emit_second(0);
  }

  static std::uint64_t checked_seed(const SourceAddress& address) {
    address.require_options("seed,flash,waves,speed");
    return static_cast<std::uint64_t>(integer_option(address, "seed", 1, 0, std::numeric_limits<int>::max()));
  }

  void advance() {
    model_.step();
    ++step_;
    if (waves_) {
      collect_waves();
    }
    if (step_ % kStepsPerSecond == 0) {
      emit_second(step_ / kStepsPerSecond);
    }
  }

  void collect_waves() {
    ecg_.push_back(rounded(model_.ecg_mv(), 1000));
    if (step_ % kPlethEverySteps == 0) {
      pleth_.push_back(rounded(model_.pleth(), 1000));
    }
    if (step_ % kBlockSteps == 0) {
      emit_wave("MDC_ECG_ELEC_POTL_II", kStepsPerSecond, ecg_);
      emit_wave("MDC_PULS_OXIM_PLETH", static_cast<double>(kStepsPerSecond) / kPlethEverySteps, pleth_);
    }
  }

  void emit_second(std::uint64_t second) {
    if (flash_every_s_ > 0 && second % flash_every_s_ == 0) {
      emit(media::kFlashCode, 1);
    }
    const PatientNumbers numbers = model_.numbers();
    emit("MDC_ECG_HEART_RATE", rounded(numbers.heart_rate_per_min));
    emit("MDC_PULS_OXIM_PULS_RATE", rounded(numbers.heart_rate_per_min));
    emit("MDC_PULS_OXIM_SAT_O2", rounded(numbers.saturation_percent));
    emit("MDC_PRESS_BLD_ART_ABP_SYS", rounded(numbers.systolic_mmhg));
    emit("MDC_PRESS_BLD_ART_ABP_DIA", rounded(numbers.diastolic_mmhg));
    emit("MDC_PRESS_BLD_ART_ABP_MEAN", rounded(numbers.mean_mmhg));
    emit("MDC_RESP_RATE", rounded(numbers.respiration_per_min));
    emit("MDC_AWAY_CO2_ET", rounded(numbers.end_tidal_co2_mmhg));
    if (second % kTemperatureEveryS == 0) {
      emit("MDC_TEMP_BODY", rounded(numbers.temperature_celsius, 10));
    }
    if (second % kCuffEveryS == kFirstCuffS) {
      const auto cuff = model_.measure_cuff_mmhg();
      emit("MDC_PRESS_BLD_NONINV_SYS", rounded(cuff[0]));
      emit("MDC_PRESS_BLD_NONINV_DIA", rounded(cuff[1]));
      emit("MDC_PRESS_BLD_NONINV_MEAN", rounded(cuff[2]));
    }
  }

  VitalSample& emit(std::string_view code, std::optional<double> value) {
    VitalSample& sample = ready_.emplace_back();
    const media::VitalCode& known = *media::find_vital_code(code);
    sample.time_ns = static_cast<std::int64_t>(step_) * kStepNs;
    sample.code = known.code;
    sample.mdc = known.mdc;
    sample.value = value;
    sample.unit = known.unit;
    sample.source = "synthetic:patient";
    return sample;
  }

  void emit_wave(std::string_view code, double rate_hz, std::vector<double>& values) {
    VitalSample& sample = emit(code, std::nullopt);
    sample.rate_hz = rate_hz;
    sample.values = std::exchange(values, {});
  }

  PatientModel model_;
  std::uint64_t flash_every_s_;
  bool waves_;
  std::uint64_t step_ = 0;  // case clock in steps of the model
  std::vector<double> ecg_, pleth_;
  std::deque<VitalSample> ready_;
  std::atomic<bool> interrupted_ = false;
};

}  // namespace

std::unique_ptr<VitalSource> open_synthetic_patient(const SourceAddress& address) {
  return std::make_unique<SyntheticPatient>(address);
}

}  // namespace kiroku::recorder
