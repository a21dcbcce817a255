#include "apps/quality/coding_options.h"

#include <algorithm>
#include <iterator>

#include "apps/common/format.h"
#include "apps/common/time_option.h"

namespace kiroku::apps {

void add_coding_options(Command& command, CodingOptions& options) {
  command.option("--coding", "WORD", options.codings,
                 "only this one: mpeg2, mpeg2-422, lossless, uncompressed, h264, h265");
  command.option("--rate", "RATE", options.rates,
                 "this rate instead of the usual ones: 4M, 800k bits a second");
}

std::vector<recorder::Coding> codings_of(const CodingOptions& options, std::vector<recorder::Coding> usual) {
  if (options.codings.empty() && options.rates.empty()) return usual;
  std::vector<recorder::CodingFamily> families;
  for (const std::string& word : options.codings) families.push_back(recorder::parse_coding(word));
  if (families.empty()) {
    using enum recorder::CodingFamily;
    families = {kMpeg2, kMpeg2Chroma422, kLossless, kUncompressed, kH264, kH265};
  }
  std::vector<std::int64_t> rates;
  for (const std::string& text : options.rates) rates.push_back(parse_bit_rate(text, "--rate"));
  std::vector<recorder::Coding> codings;
  for (const recorder::CodingFamily family : families) {
    if (!recorder::has_rate(family)) {
      codings.push_back({family, 0});
    } else if (rates.empty()) {
      std::ranges::copy_if(recorder::usual_codings(), std::back_inserter(codings),
                           [&](const recorder::Coding& one) { return one.family == family; });
    } else {
      for (const std::int64_t rate : rates) codings.push_back({family, rate});
    }
  }
  return codings;
}

void add_stretch_options(Command& command, StretchOptions& options) {
  command.option("--from", "T", options.from, duration_help("leaves out what comes before"), "the start");
  command.option("--duration", "T", options.duration, duration_help("leaves out what comes after"),
                 "the end");
}

recorder::ClipStretch stretch_of(const StretchOptions& options) {
  recorder::ClipStretch stretch;
  if (options.from) stretch.from_ns = parse_duration(*options.from, "--from").count();
  if (options.duration) stretch.duration_ns = parse_duration(*options.duration, "--duration").count();
  return stretch;
}

}  // namespace kiroku::apps
