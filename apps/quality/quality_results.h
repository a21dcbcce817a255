// What trials of clips found, as a table, as JSON, as plots and as a page. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "recorder/quality/clip_trial.h"

namespace kiroku::apps {

struct ClipResult {
  std::string name;    // of the file, without its folder
  std::string prefix;  // of the files that are made of it: fit for a file's name, and its own
  recorder::TrialResult trial;
};

/// Sentences on the clip itself.
std::string quality_facts(const ClipResult& clip);
/// A row for each coding that was tried; the first is the head.
std::vector<std::vector<std::string>> quality_table(const ClipResult& clip);
/// A sentence for each coding that was refused, with the reason.
std::vector<std::string> not_tried(const ClipResult& clip);
/// All of that for a terminal.
std::string quality_text(const ClipResult& clip);
/// Everything but pictures: what 'quality.json' holds.
nlohmann::ordered_json quality_json(const std::vector<ClipResult>& clips);

/// A file of its own each.
struct NamedPlot {
  std::string name;  // "endo-fine-texture.svg"
  Bytes svg;
};
std::vector<NamedPlot> quality_plots(const ClipResult& clip);
/// Tables and plots of all clips, on A4.
Bytes quality_pdf(const std::vector<ClipResult>& clips);
/// One HTML page that needs nothing else: tables, plots, and pictures side by side that move and grow
/// together.
std::string quality_page(const std::vector<ClipResult>& clips);

}  // namespace kiroku::apps
