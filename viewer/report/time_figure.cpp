#include "viewer/report/time_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "viewer/report/document.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/texts.h"

namespace kiroku::report {
namespace {

constexpr double kLabels = 96, kRow = 17, kBar = 9, kLeastGap = 2.5;
constexpr double kSmall = 7.5;

/// Ticks at most this many, at the finest of these steps in seconds that allows it.
constexpr int kMostTicks = 8;
constexpr auto kSteps = std::to_array<std::int64_t>(
    {1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1'800, 3'600, 7'200, 14'400, 28'800, 86'400});
constexpr std::int64_t kSecond = 1'000'000'000;

class TimeFigure {
 public:
  /// `zero_ns`: where the case begins, from which its times are told. Of an excerpt what lies outside of
  /// [begin_ns, end_ns] is not drawn: at an edge it would be told of a time that is not its own.
  TimeFigure(std::int64_t zero_ns, std::int64_t begin_ns, std::int64_t end_ns, bool is_part, double width)
      : zero_(zero_ns), begin_(begin_ns), end_(std::max(end_ns, begin_ns + 1)), is_part_(is_part) {
    figure_.width = width;
  }

  /// `gaps` by their beginnings. Those that could not be told apart are drawn as one, so that a ledger of
  /// gaps makes no endless drawing.
  void add_stream(const archive::StreamReport& stream, const std::vector<archive::Span>& gaps) {
    label(stream.info.name);
    if (stream.span.end_ns > stream.span.start_ns) bar(stream.span);
    std::optional<archive::Span> drawn;
    for (const archive::Span& gap : gaps) {
      if (is_part_ && !archive::meets(gap, begin_, end_)) continue;
      if (drawn && x_of(gap.start_ns) < std::max(x_of(drawn->end_ns), x_of(drawn->start_ns) + kLeastGap)) {
        drawn->end_ns = std::max(drawn->end_ns, gap.end_ns);
        continue;
      }
      if (drawn) cross(*drawn);
      drawn = gap;
    }
    if (drawn) cross(*drawn);
    y_ += kRow;
  }

  /// Of the tokens those that hold, in the ledger's order: anybody can make one of any time.
  void add_tokens(const std::string& name, const std::vector<StatedToken>& tokens,
                  const std::vector<archive::ProvingToken>& proving) {
    label(name);
    constexpr double kWidth = 0.8;
    std::set<long> drawn;  // by place, as wide as a line
    for (const StatedToken& token : tokens) {
      if (!token.token.exchange ||
          !std::ranges::binary_search(proving, token.entry, {}, &archive::ProvingToken::entry))
        continue;
      const std::int64_t at = token.token.exchange->answered_ns;
      if (is_part_ && (at < begin_ || at > end_)) continue;
      const double x = x_of(at);
      if (!drawn.insert(std::lround(x / kWidth)).second) continue;
      figure_.shapes.emplace_back(Stroke{x, y_, x, y_ + kBar, Ink::kBlue, kWidth});
    }
    y_ += kRow;
  }

  Figure finish(std::string description) {
    const double axis = y_ + 2;
    figure_.shapes.emplace_back(Stroke{kLabels, axis, figure_.width, axis, Ink::kGrey, 0.5});
    const std::int64_t seconds = (end_ - begin_) / kSecond;
    const auto* step =
        std::ranges::find_if(kSteps, [&](std::int64_t each) { return seconds / each < kMostTicks; });
    const std::int64_t every = (step == kSteps.end() ? kSteps.back() : *step) * kSecond;
    const std::int64_t before_first = (begin_ - zero_) % every;  // an excerpt begins anywhere
    for (std::int64_t at = begin_ - zero_ + (before_first == 0 ? 0 : every - before_first);
         zero_ + at <= end_; at += every) {
      const double x = x_of(zero_ + at);
      figure_.shapes.emplace_back(Stroke{x, axis, x, axis + 3, Ink::kGrey, 0.5});
      const auto anchor = x > figure_.width - 20 ? Lettering::Anchor::kEnd : Lettering::Anchor::kMiddle;
      figure_.shapes.emplace_back(Lettering{x, axis + 11, case_time(at, false), kSmall, anchor});
    }
    figure_.height = axis + 14;
    figure_.description = std::move(description);
    return std::move(figure_);
  }

 private:
  [[nodiscard]] double x_of(std::int64_t at) const {
    const double share = static_cast<double>(at - begin_) / static_cast<double>(end_ - begin_);
    return kLabels + std::clamp(share, 0.0, 1.0) * (figure_.width - kLabels);
  }
  void label(const std::string& text) {
    figure_.shapes.emplace_back(
        Lettering{0, y_ + kBar - 1, plain_text(text), 8, Lettering::Anchor::kStart, kLabels - 8});
  }
  void bar(const archive::Span& span) {
    const double x = x_of(span.start_ns);
    figure_.shapes.emplace_back(Area{x, y_, x_of(span.end_ns) - x, kBar, Ink::kBlue});
  }
  void cross(const archive::Span& span) {
    const double x = x_of(span.start_ns);
    const double wide = std::max(x_of(span.end_ns) - x, kLeastGap);
    figure_.shapes.emplace_back(Area{x, y_, wide, kBar, Ink::kWhite});
    const double right = x + wide, bottom = y_ + kBar;
    for (const Stroke& side :
         {Stroke{x, y_, right, y_}, Stroke{right, y_, right, bottom}, Stroke{right, bottom, x, bottom},
          Stroke{x, bottom, x, y_}, Stroke{x, y_, right, bottom}, Stroke{x, bottom, right, y_}}) {
      figure_.shapes.emplace_back(side);
    }
  }

  std::int64_t zero_, begin_, end_;
  bool is_part_;
  double y_ = 2;
  Figure figure_;
};

}  // namespace

Figure time_figure(const archive::VerificationReport& verification, const CaseFacts& facts, Language language,
                   double width) {
  const std::int64_t zero = facts.opening ? facts.opening->begins_ns : 0;
  std::int64_t begin = zero;
  std::int64_t end = facts.last_ns;
  if (verification.excerpt) {
    begin = verification.excerpt->from_ns;
    end = verification.excerpt->to_ns;
    for (const auto& stream : verification.streams) {
      if (stream.segments == 0) continue;
      begin = std::min(begin, stream.span.start_ns);
      end = std::max(end, stream.span.end_ns);
    }
  }
  TimeFigure figure(zero, begin, end, verification.excerpt.has_value(), width);
  std::map<std::string, std::vector<archive::Span>> gaps;
  for (const archive::GapEntry& gap : facts.gaps) {
    if (!gap.of_sound) gaps[gap.stream].push_back(gap.span);
  }
  for (auto& [stream, its] : gaps) std::ranges::sort(its, {}, &archive::Span::start_ns);
  std::size_t rows = 0;
  for (const auto& stream : verification.streams) {
    if (rows++ < kMostStreamsDrawn) figure.add_stream(stream, gaps[stream.info.name]);
  }
  figure.add_tokens(say(language, "figure.tokens"), facts.tokens, verification.proving_tokens);
  return figure.finish(say(language, "figure.time"));
}

}  // namespace kiroku::report
