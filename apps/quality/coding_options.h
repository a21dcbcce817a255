// --coding and --rate: which codings a clip goes through. Functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "recorder/quality/clip.h"
#include "recorder/quality/coding.h"

namespace kiroku::apps {

struct CodingOptions {
  std::vector<std::string> codings, rates;
};
/// `options` must live until the program has run.
void add_coding_options(Command& command, CodingOptions& options);
/// Those that were named; `usual` where none was. kiroku::UsageError.
std::vector<recorder::Coding> codings_of(const CodingOptions& options, std::vector<recorder::Coding> usual);

struct StretchOptions {
  std::optional<std::string> from, duration;
};
void add_stretch_options(Command& command, StretchOptions& options);
recorder::ClipStretch stretch_of(const StretchOptions& options);

}  // namespace kiroku::apps
