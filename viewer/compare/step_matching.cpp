#include "viewer/compare/step_matching.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

#include "base/ascii.h"
#include "base/error.h"

namespace kiroku::compare {
namespace {

constexpr std::array<std::string_view, 6> kEnds{"end", "ends", "ended", "done", "finished", "over"};
constexpr std::array<std::string_view, 5> kBegins{"begin", "begins", "start", "starts", "started"};
constexpr std::array<std::string_view, 3> kFillers{"now", "of", "the"};
constexpr std::array<std::string_view, 4> kResumes{"resume", "resumed", "continue", "go on"};
constexpr std::array<std::string_view, 2> kPauses{"pause", "paused"};

/// Lower case, words apart by one blank, none but letters and digits; bytes of other scripts as they are.
std::string words_of(std::string_view text) {
  std::string words;
  bool apart = false;
  for (const char c : text) {
    const bool upper = c >= 'A' && c <= 'Z';
    const bool kept =
        upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || static_cast<unsigned char>(c) >= 0x80;
    if (!kept) {
      apart = true;
      continue;
    }
    if (apart && !words.empty()) words += ' ';
    apart = false;
    words += ascii_lower(c);
  }
  return words;
}

/// Where the words stand among the others; npos if they do not.
std::size_t find_words(const std::string& text, std::string_view words) {
  if (words.empty()) return std::string::npos;
  const std::string padded = " " + text + " ";
  return padded.find(" " + std::string(words) + " ");
}

/// The text without the words at `at`, as words again.
std::string without(const std::string& text, std::size_t at, std::size_t length) {
  return words_of(text.substr(0, at) + " " + text.substr(std::min(at + length, text.size())));
}

template <std::size_t kCount>
bool is_one_of(const std::string& text, const std::array<std::string_view, kCount>& words) {
  return std::ranges::find(words, text) != words.end();
}

/// What words beside a name say of the step; kNothing: anything else, or both.
enum class Says { kBeginning, kEnding, kNothing };
Says said_by(const std::string& words) {
  bool begins = false, ends = false;
  std::size_t at = 0;
  while (at < words.size()) {
    const std::size_t end = std::min(words.find(' ', at), words.size());
    const std::string word = words.substr(at, end - at);
    at = end + 1;
    if (is_one_of(word, kEnds)) {
      ends = true;
    } else if (is_one_of(word, kBegins)) {
      begins = true;
    } else if (!is_one_of(word, kFillers)) {
      return Says::kNothing;
    }
  }
  if (begins && ends) return Says::kNothing;
  return ends ? Says::kEnding : Says::kBeginning;
}

/// "step 3 …": its number from 0 and the rest of the text.
std::optional<std::pair<std::size_t, std::string>> numbered_step(const std::string& text, std::size_t count) {
  constexpr std::string_view kWord = "step ";
  const std::size_t at = find_words(text, "step");
  if (at == std::string::npos) return {};
  const char* const begin = text.data() + at + kWord.size();
  if (begin >= text.data() + text.size()) return {};
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), number);
  if (error != std::errc() || (end != text.data() + text.size() && *end != ' ')) return {};
  if (number < 1 || number > count) return {};
  return std::pair(number - 1, without(text, at, static_cast<std::size_t>(end - text.data()) - at));
}

/// Whom a mark means: the name, and what it says of it.
struct Meaning {
  std::optional<std::size_t> step;  // where it was told by its number
  std::string name;                 // else
  Says says = Says::kNothing;
};

/// Nothing where it names no step. Of several readings the one that says something, and of these the one by
/// the longest name.
std::optional<Meaning> meaning_of(const std::string& text, const std::vector<std::string>& names) {
  std::optional<Meaning> best;
  const auto consider = [&](Meaning meaning) {
    const auto rank = [](const Meaning& each) {
      return std::pair(each.says != Says::kNothing, each.name.size());
    };
    if (!best || rank(meaning) > rank(*best)) best = std::move(meaning);
  };
  for (const std::string& name : names) {
    const std::size_t at = find_words(text, name);
    if (at != std::string::npos) consider({{}, name, said_by(without(text, at, name.size()))});
  }
  if (best && best->says != Says::kNothing) return best;
  if (const auto numbered = numbered_step(text, names.size())) {
    const auto& [step, rest] = *numbered;
    // "step 3: hold" says the same twice.
    const std::size_t at = find_words(rest, names[step]);
    const Says says = said_by(at == std::string::npos ? rest : without(rest, at, names[step].size()));
    if (says != Says::kNothing || !best) return Meaning{step, {}, says};
  }
  return best;
}

bool open_ended(const archive::Span& span) { return span.end_ns < span.start_ns; }

/// Ends that nobody stated, and what was not found.
StepMatching completed(std::span<const PlannedStep> steps, std::vector<StepMatch> matches,
                       std::int64_t recording_end_ns) {
  std::ranges::stable_sort(matches, {}, [](const StepMatch& match) { return match.span.start_ns; });
  StepMatching matching;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    StepMatch& match = matches[i];
    if (open_ended(match.span)) {
      const bool last = i + 1 == matches.size();
      match.end_from = last ? KnownFrom::kRecordingEnd : KnownFrom::kNextStep;
      match.span.end_ns =
          std::max(match.span.start_ns, last ? recording_end_ns : matches[i + 1].span.start_ns);
    }
    // Marks may have been made after the last picture.
    for (archive::Span& pause : match.pauses) {
      pause.start_ns = std::clamp(pause.start_ns, match.span.start_ns, match.span.end_ns);
      pause.end_ns = std::clamp(pause.end_ns, pause.start_ns, match.span.end_ns);
    }
    std::erase_if(match.pauses, [](const archive::Span& pause) { return pause.end_ns <= pause.start_ns; });
  }
  for (std::size_t step = 0; step < steps.size(); ++step) {
    if (std::ranges::find(matches, step, &StepMatch::step) == matches.end()) matching.missing.push_back(step);
  }
  matching.matches = std::move(matches);
  return matching;
}

/// Takes marks in order of time and keeps the step that runs.
class MarkReader {
 public:
  explicit MarkReader(std::span<const PlannedStep> steps) : begun_(steps.size(), false) {
    for (const PlannedStep& step : steps) names_.push_back(words_of(step.name));
  }

  void take(const Mark& mark) {
    const std::string text = words_of(mark.text);
    const auto meaning = meaning_of(text, names_);
    if (!meaning) {
      take_bare(mark, text);
    } else if (meaning->says == Says::kNothing) {
      ambiguous.push_back(mark);
    } else if (meaning->says == Says::kEnding) {
      end(mark, *meaning);
    } else {
      begin(mark, *meaning);
    }
  }

  void finish(std::int64_t recording_end_ns) {
    if (!matches.empty() && open_ended(matches.back().span)) resume(recording_end_ns);
  }

  std::vector<StepMatch> matches;
  std::vector<Mark> repeated, ambiguous, unmatched;

 private:
  /// Of steps of that name the first that has not begun.
  [[nodiscard]] std::optional<std::size_t> next_of(const Meaning& meaning) const {
    for (std::size_t step = 0; step < names_.size(); ++step) {
      const bool meant = meaning.step ? *meaning.step == step : names_[step] == meaning.name;
      if (meant && !begun_[step]) return step;
    }
    return {};
  }

  void begin(const Mark& mark, const Meaning& meaning) {
    const auto step = next_of(meaning);
    if (!step) {
      repeated.push_back(mark);
      return;
    }
    resume(mark.time_ns);
    begun_[*step] = true;
    StepMatch& match = matches.emplace_back();
    match.step = *step;
    match.span = {mark.time_ns, mark.time_ns - 1};
    match.mark = mark.text;
  }

  /// The latest of that name, if it is not ended yet.
  void end(const Mark& mark, const Meaning& meaning) {
    const auto meant = [&](const StepMatch& match) {
      return meaning.step ? *meaning.step == match.step : names_[match.step] == meaning.name;
    };
    const auto found = std::find_if(matches.rbegin(), matches.rend(), meant);
    if (found == matches.rend() || !open_ended(found->span) || &*found != &matches.back()) {
      unmatched.push_back(mark);
      return;
    }
    end_running(mark.time_ns);
  }

  void take_bare(const Mark& mark, const std::string& text) {
    const bool running = !matches.empty() && open_ended(matches.back().span);
    if (running && is_one_of(text, kEnds)) {
      end_running(mark.time_ns);
    } else if (running && !paused_ns_ && is_one_of(text, kPauses)) {
      paused_ns_ = mark.time_ns;
    } else if (running && paused_ns_ && is_one_of(text, kResumes)) {
      resume(mark.time_ns);
    } else {
      unmatched.push_back(mark);
    }
  }

  /// A pause that nobody ended ends with its step, and is then no part of it.
  void end_running(std::int64_t time_ns) {
    StepMatch& match = matches.back();
    match.span.end_ns = paused_ns_.value_or(time_ns);
    match.end_from = KnownFrom::kMark;
    paused_ns_.reset();
  }

  void resume(std::int64_t time_ns) {
    if (!paused_ns_) return;
    matches.back().pauses.push_back({*paused_ns_, time_ns});
    paused_ns_.reset();
  }

  std::vector<std::string> names_;
  std::vector<bool> begun_;
  std::optional<std::int64_t> paused_ns_;
};

std::string number_of(std::size_t step) { return "step " + std::to_string(step + 1); }

void require_pauses_inside(const StepMatch& match) {
  std::int64_t from_ns = match.span.start_ns;
  for (const archive::Span& pause : match.pauses) {
    if (pause.start_ns < from_ns || pause.end_ns < pause.start_ns || pause.end_ns > match.span.end_ns)
      throw UsageError("a pause of " + number_of(match.step) +
                       " does not lie within it, or before the pause that follows; give pauses in order");
    from_ns = pause.end_ns;
  }
}

}  // namespace

const char* name_of(KnownFrom from) {
  switch (from) {
    case KnownFrom::kMark:
      return "mark";
    case KnownFrom::kHand:
      return "hand";
    case KnownFrom::kNextStep:
      return "next-step";
    case KnownFrom::kRecordingEnd:
      break;
  }
  return "recording-end";
}

const StepMatch* StepMatching::match_of(std::size_t step) const {
  const auto found = std::ranges::find(matches, step, &StepMatch::step);
  return found == matches.end() ? nullptr : &*found;
}

bool StepMatching::in_planned_order() const { return std::ranges::is_sorted(matches, {}, &StepMatch::step); }

StepMatching match_by_marks(std::span<const PlannedStep> steps, std::span<const Mark> marks,
                            std::int64_t recording_end_ns) {
  std::vector<Mark> sorted(marks.begin(), marks.end());
  std::ranges::stable_sort(sorted, {}, &Mark::time_ns);
  MarkReader reader(steps);
  for (const Mark& mark : sorted) reader.take(mark);
  reader.finish(recording_end_ns);
  StepMatching matching = completed(steps, std::move(reader.matches), recording_end_ns);
  matching.repeated = std::move(reader.repeated);
  matching.ambiguous = std::move(reader.ambiguous);
  matching.unmatched = std::move(reader.unmatched);
  return matching;
}

StepMatching match_by_hand(std::span<const PlannedStep> steps, std::vector<StepMatch> said,
                           std::int64_t recording_end_ns) {
  std::vector<bool> named(steps.size(), false);
  for (const StepMatch& match : said) {
    if (match.step >= steps.size())
      throw UsageError(number_of(match.step) + " is matched, and the plan has only " +
                       std::to_string(steps.size()));
    if (named[match.step]) throw UsageError(number_of(match.step) + " is matched twice; it is done once");
    named[match.step] = true;
  }
  StepMatching matching = completed(steps, std::move(said), recording_end_ns);
  for (std::size_t i = 0; i < matching.matches.size(); ++i) {
    const StepMatch& match = matching.matches[i];
    require_pauses_inside(match);
    if (i > 0 && matching.matches[i - 1].span.end_ns > match.span.start_ns)
      throw UsageError(number_of(match.step) + " begins before " + number_of(matching.matches[i - 1].step) +
                       " ends; one is done after the other");
  }
  return matching;
}

}  // namespace kiroku::compare
