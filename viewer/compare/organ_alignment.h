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

namespace kiroku::compare {

struct AlignmentRequest {
  archive::Span span;      // of the recording
  double field_deg = 0;    // what the picture's lesser side covers
  sim::SearchRange range;  // from where the organ may be seen
};

struct Alignment {
  archive::Span span;
  double field_deg = 0;
  std::vector<sim::AlignedMoment> moments;  // in order, kAlignedEveryNs apart at least
  /// Of the recorded pictures, from that time on: the first moment's, and each other one after it.
  struct PictureSize {
    std::int64_t from_ns = 0;
    int width = 0, height = 0;
  };
  std::vector<PictureSize> sizes;
  sim::DrawnSurface surface;  // the organ's, by which its outline can be drawn

  [[nodiscard]] std::size_t held() const;
  /// Where the organ was in the picture of that time. Between two moments in which it was held, evenly
  /// between them, with the larger of their errors; lost where one of them was. Nothing before the first
  /// moment, after the last, between two that are more than kAlignedMostNs apart, and between pictures of two
  /// shapes: there nobody looked.
  [[nodiscard]] std::optional<sim::AlignedMoment> at(std::int64_t case_ns) const;
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

/// More would make the document large and a browser slow, and its outline no better.
inline constexpr std::size_t kMostDrawnNodes = 10'000;

/// kiroku::UsageError for a stretch that is longer than kLongestAlignedNs.
void require_alignable(const archive::Span& span);

/// Aligns the mesh, at rest and rigid, with the pictures of the stretch. kiroku::UsageError for a stretch
/// that is longer than kLongestAlignedNs or holds no picture, and as sim::OrganTrack; kiroku::Error as
/// playback::PictureSpan. `share` is told after each picture; what it throws ends the alignment.
Alignment align_organ(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                      const std::string& stream, const sim::TetMesh& mesh, const AlignmentRequest& request,
                      const std::function<void(double share)>& share = {});

}  // namespace kiroku::compare
