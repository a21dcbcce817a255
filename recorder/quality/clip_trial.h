// A clip through one coding after the other, and what is left of it. One thread at a time; pictures are
// measured by more.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "recorder/quality/clip.h"
#include "recorder/quality/coding.h"

namespace kiroku::recorder {

struct TrialOptions {
  ClipStretch stretch;
  /// Every picture is coded and has its PSNR and SSIM; so many, evenly spread, have all else measured.
  std::size_t measured = 24;
  /// Of those, so many are kept as PNG files: the one with the most fine texture first.
  std::size_t shown = 0;
  /// Called as pictures of one coding are done: 0 of all at its beginning. Throwing ends the trial.
  std::function<void(const std::string& doing, std::uint64_t done, std::uint64_t total)> progress;
};

/// A clip shorter than this says nothing of a rate.
inline constexpr double kShortestClipSeconds = 1;

/// A clip's own facts, before it is coded.
struct ClipFacts {
  std::string pictures_are;  // "1280x720 yuv420p"
  SourceCoding coding;       // of the file
  int width = 0, height = 0, depth = 8;
  double rate = 0;     // pictures a second, nominal
  double seconds = 0;  // that its pictures last
  std::uint64_t pictures = 0;
  std::uint64_t file_bytes = 0;
  double tissue = 0;  // share of the measured pictures that is lit tissue (media/quality/fine_texture.h)
  bool whole_picture = false;        // there is hardly any, so texture is measured everywhere
  double fine_texture = 0;           // root mean square of the band of 4 pixels, in steps of 8-bit luma
  std::vector<std::uint64_t> shown;  // numbers of the kept pictures, from 0
  std::vector<Bytes> originals;      // as PNG, as many
};

struct CodingFigures {
  Coding coding;
  /// Why it was not tried; then there is nothing else.
  std::string refused;
  bool identical = false;  // every sample of every picture came back
  double bytes_per_hour = 0;
  std::optional<double> psnr;  // dB over all samples of all pictures; nothing where there is no error
  double ssim = 0, ms_ssim = 0;
  /// Shares of the original's energy in bands of periods of 4 and 8 pixels (media/quality/fine_texture.h).
  double fine_kept = 0, fine_foreign = 0, middle_kept = 0;
  double edges = 0;                          // media/quality/edges.h
  double colour_mean = 0, colour_worst = 0;  // CIEDE2000: the mean, and what 95 of 100 pixels stay below
  std::vector<Bytes> pictures;               // as PNG, the shown ones; empty where they are identical
};

struct TrialResult {
  ClipFacts facts;
  std::vector<CodingFigures> codings;
};

/// Throws kiroku::Error as Clip does; UsageError for a clip that is too short or too small.
TrialResult try_codings(const std::filesystem::path& clip, const std::vector<Coding>& codings,
                        const TrialOptions& options);

}  // namespace kiroku::recorder
