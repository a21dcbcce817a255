// The plan's organ laid on the recorded pictures without a click: sim/align over a stretch of a case.
// Functions and objects belong to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/align/drawn_surface.h"
#include "sim/align/organ_track.h"
#include "sim/model/body_model.h"
#include "sim/render/lens.h"
#include "viewer/compare/organ_deformation.h"
#include "viewer/kept/provenance.h"

namespace kiroku::compare {

/// A calibration that was given, and the file that it was read from.
struct UsedLens {
  sim::Lens lens;
  NamedFile file;
};

struct AlignmentRequest {
  archive::Span span;    // of the recording
  double field_deg = 0;  // what the picture's lesser side covers; with a lens it is that of its ideal camera
  sim::SearchRange range;             // from where the organ may be seen
  bool deformed = false;              // whether it is also deformed to fit
  std::optional<UsedLens> lens = {};  // nothing: pictures are taken to have no distortion
  /// By which departures from the plan are told, of an organ that is deformed to fit; must outlive the call.
  const PlannedShapes* planned = nullptr;
};

struct Alignment {
  archive::Span span;
  double field_deg = 0;  // of the cameras of moments
  /// In order, kAlignedEveryNs apart at least. With a lens their cameras and pixels are of its ideal camera.
  std::vector<sim::AlignedMoment> moments;
  /// Of the recorded pictures, from that time on: the first moment's, and each other one after it.
  struct PictureSize {
    std::int64_t from_ns = 0;
    int width = 0, height = 0;
  };
  std::vector<PictureSize> sizes;
  sim::DrawnSurface surface;                  // the organ's, by which its outline can be drawn
  std::optional<DeformedAlignment> deformed;  // where that was asked for
  std::optional<UsedLens> lens = {};          // where one was given

  [[nodiscard]] std::size_t held() const;
  /// Where the organ was in the picture of that time. Between two moments in which it was held, evenly
  /// between them, with the larger of their errors; lost where one of them was. Nothing before the first
  /// moment, after the last, between two that are more than kAlignedMostNs apart, and between pictures of two
  /// shapes: there nobody looked.
  [[nodiscard]] std::optional<sim::AlignedMoment> at(std::int64_t case_ns) const;
  /// The organ's shape in the picture of that time, evenly between two moments in which it was deformed since
  /// the same one. Nothing elsewhere: there at() says where the rigid organ is.
  [[nodiscard]] std::optional<ShownDeformation> deformed_at(std::int64_t case_ns) const;
  /// Why it is not deformed in the picture of that time; nothing where it is, where nobody looked, and where
  /// that was not asked for.
  [[nodiscard]] std::optional<sim::WhyRigid> rigid_at(std::int64_t case_ns) const;
  /// Where the recording departs from the plan, in the picture of that time or the last one before it that
  /// was looked at. Where the organ was deformed in that one and is shown at rest since, the next one's, if
  /// it was at rest there. Nothing elsewhere, and where departures were not asked for.
  [[nodiscard]] const Departure* departure_at(std::int64_t case_ns) const;
  /// The organ as it is seen in the picture of that time, deformed or at rest, so that departures can be
  /// drawn.
  [[nodiscard]] std::optional<ShownDeformation> shape_at(std::int64_t case_ns) const;
  /// For each step of which a picture was looked at, in order.
  [[nodiscard]] std::vector<StepDeparture> step_departures() const;
  /// Successive moments that were lost for the same reason.
  struct Lost {
    archive::Span span;
    sim::WhyLost why = sim::WhyLost::kNoOrgan;
  };
  [[nodiscard]] std::vector<Lost> lost() const;
};

/// Why nothing is said of a picture, for people: "nothing in the picture has the organ's outline".
std::string sentence_of(sim::WhyLost why);

inline constexpr std::int64_t kAlignedEveryNs = 100'000'000, kAlignedMostNs = 300'000'000;
/// An hour: a longer stretch would take a day, and its document hundreds of megabytes.
inline constexpr std::int64_t kLongestAlignedNs = 3'600'000'000'000;

/// Of an organ that is deformed to fit: its pictures take some eight times as long, and say more each.
inline constexpr std::int64_t kLongestDeformedNs = 600'000'000'000;

/// More would make the document large and a browser slow, and its outline no better.
inline constexpr std::size_t kMostDrawnNodes = 10'000, kMostDeformedNodes = 2'000;

/// kiroku::UsageError for a stretch that is longer than kLongestAlignedNs, or kLongestDeformedNs.
void require_alignable(const archive::Span& span, bool deformed);

/// Aligns the organ with the pictures of the stretch, rigid, and deformed to fit where that is asked for.
/// kiroku::UsageError for a stretch that is too long or holds no picture, as sim::OrganTrack, and for
/// pictures of another shape than the lens's; kiroku::Error as playback::PictureSpan, and as
/// sim::DeformableOrgan where nothing holds the organ. `share` is told after each picture; what it throws
/// ends the alignment.
Alignment align_organ(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                      const std::string& stream, const sim::BodyModel& body, const AlignmentRequest& request,
                      const std::function<void(double share)>& share = {});

}  // namespace kiroku::compare
