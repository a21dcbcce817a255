// A subject whose threshold is not put in: it follows from the steps of the forces, from how much they move
// the skin, from what of that the channels of touch feel, and from what fingers mask of each other.
//
//   forces held at a rate, less those that change all the time → the device → the skin of each finger
//     → level above what is just felt (psychophysics/vibration_sense.h) → less what other fingers mask →
//     answer
//
// What another finger masks: a vibration of one finger raises the threshold of another one of the same hand,
// the neighbour's more than that of one further away (Tamè, Moles and Holmes, "Within, but not between hands
// interactions in vibrotactile detection thresholds reflect somatosensory receptive field organization",
// Frontiers in Psychology 5:174, 2014), and the elevations by several maskers add up (Gilson, "Vibrotactile
// masking: Effects of multiple maskers", Perception & Psychophysics 5, 1969). How much depends on the masker:
// it is a parameter, and 0 if nobody says otherwise. Their maskers were felt clearly; here all fingers
// vibrate alike and weakly, so that an amount from there is more than what is to be expected.
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "trainer/haptic_rate/rate_subject.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/vibration_sense.h"

namespace kiroku::trainer {

enum class Manner : std::uint8_t {
  kPress,   // up and down between kLeastPressN and kMostPressN
  kStroke,  // to and fro along the plate under kStrokePressN, with friction
};
/// "press", "stroke"; kiroku::UsageError for others.
Manner manner_of(const std::string& name);
std::string name_of(Manner manner);

/// A stroke: 2 cm to both sides once a second. The force along the plate is that of dry friction, with the
/// plate giving way before a fingertip slides: contact is at nodes 1 cm apart, over which no fingertip could
/// glide evenly, so that it is reckoned from the plate's stiffness and not stepped.
inline constexpr double kStrokePressN = 0.75, kStrokeMetres = 0.02, kStrokeHz = 1, kStrokeFriction = 0.5;

struct SensingModel {
  Manner manner = Manner::kPress;
  TouchCurves curves;
  /// Of the device, which smooths forces as a low pass of the first order; infinite: it plays all of them.
  double device_hz = std::numeric_limits<double>::infinity();
  /// By how many dB a finger raises its neighbour's threshold; half as much for each finger further away.
  double masking_db = 0;
  /// Than the curves. Below 0 this subject is duller, or calls vibrating only what it feels by that much more
  /// than just.
  double keener_db = 0;
  double spread_db = 2;  // of its answers around its threshold
  double lapse_rate = 0;
};

/// How strongly the most sensitive of the fingers feels that forces are renewed at that rate, in dB above
/// what it just feels. Costs some 10 ms. The same call gives the same number. kiroku::UsageError for a model
/// without sense.
double felt_level_db(const Plate& plate, const Fingers& fingers, double rate_hz, const SensingModel& model);

/// By which rates of the series are felt: the threshold that the model predicts lies between the highest rate
/// that is felt and the one above it, to a tenth. Lower rates may be felt less: fewer steps a second come.
struct PredictedThreshold {
  std::optional<double> hz;   // their geometric mean; absent where all rates of the series are felt, or none
  bool all_are_felt = false;  // if absent: up to 100 Hz
  double level_at_100_hz_db = 0;  // above what is just felt
};
PredictedThreshold predicted_threshold(const Plate& plate, RateSeries series, const Fingers& fingers,
                                       const SensingModel& model);

/// What fingers would have to mask of each other, in dB of SensingModel::masking_db, for the model's
/// threshold to be that one. None where it is one finger, or where even without masking nothing is felt at
/// that rate.
std::optional<double> masking_for(const Plate& plate, const Fingers& fingers, double threshold_hz,
                                  const SensingModel& model);

/// SensingModel::keener_db with which the model's threshold is that one.
double keener_for(const Plate& plate, const Fingers& fingers, double threshold_hz, const SensingModel& model);

/// The curves of touch for which a conclusion is to hold: NP I less by 0, 5 or 10 dB an octave, NP III up to
/// 1, 3 or 10 Hz. P's level is not among them: it does what keener_db does.
std::vector<TouchCurves> touch_curves_to_try();

/// What a model predicts by each of touch_curves_to_try(), from the least to the most, Hz; where all rates of
/// the series are felt, or none, its highest or lowest one stands for it.
struct PredictedRange {
  double least_hz = 0, most_hz = 0;
};
/// With keener_db each time so that `anchor`, which presses, has `anchor_hz`: what is predicted of `fingers`
/// and the model's manner is how their threshold lies to that one, whatever the subject calls vibrating.
PredictedRange predicted_beside(const Plate& plate, RateSeries series, const Fingers& fingers,
                                const Fingers& anchor, double anchor_hz, const SensingModel& model);

/// So many subjects of that model, keener and duller by a normal distribution of that standard deviation. The
/// same seed gives the same.
std::vector<SensingModel> sensing_group(const SensingModel& model, std::size_t subjects, double between_db,
                                        std::uint32_t seed);

/// Answers "vibrating" the likelier the more of it is felt. The same seed gives the same answers.
class SensingSubject : public RateSubject {
 public:
  /// The plate must outlive it. kiroku::UsageError for a model without sense.
  SensingSubject(const Plate& plate, const SensingModel& model, std::uint32_t seed);
  bool feels_vibration(const Fingers& fingers, double rate_hz) override;

 private:
  const Plate& plate_;
  SensingModel model_;
  std::mt19937 random_;
  std::map<std::pair<Fingers, double>, double> levels_db_;  // of what was asked before
};

}  // namespace kiroku::trainer
