#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>

#include <nlohmann/json.hpp>

#include "archive/catalogue/catalogue.h"
#include "archive/catalogue/catalogue_json.h"
#include "base/ascii.h"
#include "crypto/encoding.h"
#include "viewer/api/api.h"
#include "viewer/people/json_fields.h"
#include "viewer/people/subject_json.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

constexpr std::int64_t kUsualRows = 50;
constexpr std::int64_t kMostRows = 500;
/// For reading subjects that this session has not read yet; then the answer says how many are left.
constexpr std::chrono::milliseconds kReadingTime{1500};

ordered_json row_json(const archive::CatalogueRow& row) {
  ordered_json out{{"id", row.case_id}};
  out.update(archive::catalogue_json(row));
  return out;
}

/// What the list shows of the case to everybody who may see it, in lower case.
std::string shown_text(const archive::CatalogueRow& row) {
  std::string shown =
      row.case_id + " " + format_utc(row.opened) + " " + row.state + " " + row.last_verdict.value_or("");
  for (const std::string& stream : row.streams) shown += " " + stream;
  return lower_case(shown);
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream stream(lower_case(text));
  for (std::string word; stream >> word;) out.push_back(word);
  return out;
}

struct ListQuestion {
  std::vector<std::string> words;
  std::int64_t limit = kUsualRows;
  std::optional<std::string> before;
};

void check_limit(std::int64_t limit) {
  if (limit < 1 || limit > kMostRows)
    throw Refusal(400, "'limit' must be from 1 to " + std::to_string(kMostRows));
}

/// A page of the list for one question. Subjects are read as long as there is time, newest cases first; what
/// was read stays with the session, so that whoever asks again gets further.
class CaseList {
 public:
  CaseList(const ViewerContext& context, ListQuestion question, std::shared_ptr<SubjectShelf> shelf)
      : context_(context), question_(std::move(question)), shelf_(std::move(shelf)) {}

  /// `shows`: whether a subject is among the rows.
  ordered_json rows(const std::vector<archive::CatalogueRow>& all, bool& shows, std::size_t& unread) {
    ordered_json out = ordered_json::array();
    bool begun = !question_.before;
    for (const archive::CatalogueRow& row : all) {
      if (std::ssize(out) == question_.limit) break;
      const bool follows = begun;
      begun = begun || row.case_id == *question_.before;
      if (!follows) continue;
      const SubjectShelf::Entry subject = subject_of(row);
      if (shelf_ && !subject && row.state != "unreadable") ++unread;
      if (!is_found(row, subject)) continue;
      shows = shows || (subject && subject->state == ShelvedSubject::State::kShown);
      out.push_back(row_json(row));
      if (shelf_) put_subject(out.back(), subject);
    }
    return out;
  }

 private:
  /// Null where it may not be seen, or there was no time to read it.
  [[nodiscard]] SubjectShelf::Entry subject_of(const archive::CatalogueRow& row) const {
    if (!shelf_ || row.state == "unreadable") return nullptr;
    const std::filesystem::path folder = context_.home().archive / row.case_id;
    if (std::chrono::steady_clock::now() < enough_) return shelf_->of(folder);
    return shelf_->known(folder);
  }
  /// Whether every word stands in what the list shows of the case.
  [[nodiscard]] bool is_found(const archive::CatalogueRow& row, const SubjectShelf::Entry& subject) const {
    const std::string shown = shown_text(row);
    return std::ranges::all_of(question_.words, [&](const std::string& word) {
      return shown.find(word) != std::string::npos || (subject && subject->has(word));
    });
  }
  static void put_subject(ordered_json& row, const SubjectShelf::Entry& subject) {
    row["subject_state"] = subject ? subject_state_name(subject->state) : "not-read";
    // What stood at the end.
    if (subject && !subject->subjects.empty()) row["subject"] = subject_json(subject->subjects.back());
  }

  const ViewerContext& context_;
  const ListQuestion question_;
  const std::shared_ptr<SubjectShelf> shelf_;
  const std::chrono::steady_clock::time_point enough_ = std::chrono::steady_clock::now() + kReadingTime;
};

Response list_cases(ViewerContext& context, const Request& request,
                    const std::vector<archive::CatalogueRow>& rows, ListQuestion question,
                    std::shared_ptr<SubjectShelf> shelf) {
  bool shows = false;
  std::size_t unread = 0;
  ordered_json cases = CaseList(context, std::move(question), std::move(shelf)).rows(rows, shows, unread);
  if (shows) {
    context.enter_access_once(request, ViewerContext::kEveryCase,
                              "listed patients, procedures and staff of cases");
  }
  return Response::json(
      {{"cases", std::move(cases)}, {"subjects", subjects_word(request)}, {"unread", unread}});
}

ListQuestion question_of_address(const Request& request) {
  ListQuestion question{words_of(request.query_text("search").value_or("")),
                        request.query_integer("limit").value_or(kUsualRows), request.query_text("before")};
  check_limit(question.limit);
  return question;
}

ListQuestion question_of_body(const Request& request) {
  const nlohmann::json asked = request.json();
  ListQuestion question;
  question.words = words_of(take_text(asked, "search"));
  if (const auto limit = asked.find("limit"); limit != asked.end()) {
    if (!limit->is_number_integer()) throw Refusal(400, "'limit' must be a whole number");
    question.limit = limit->get<std::int64_t>();
  }
  check_limit(question.limit);
  if (asked.contains("before")) question.before = take_text(asked, "before");
  return question;
}

Response case_subjects(ViewerContext& context, const Request& request) {
  const std::shared_ptr<SubjectShelf> shelf = subjects_for(request);
  if (!shelf)
    throw Refusal(423, "patient, procedure and staff are sealed: unlock them with an identity first");
  const SubjectShelf::Entry found = shelf->of(context.case_place(request));
  if (found->state == ShelvedSubject::State::kProblem) throw Refusal(422, found->problem);
  ordered_json subjects = ordered_json::array();
  for (const playback::CaseSubject& each : found->subjects) subjects.push_back(subject_json(each));
  if (!subjects.empty()) {
    context.enter_access_once(request, request.parameter("case"), "read patient, procedure and staff");
  }
  return Response::json({{"state", subject_state_name(found->state)}, {"subjects", std::move(subjects)}});
}

/// Where each stream's recording begins and ends on the case clock.
std::map<std::string, archive::Span> spans_of(const archive::CaseReader& recording) {
  std::map<std::string, archive::Span> spans;
  for (const archive::SegmentEntry& segment : recording.segments()) {
    const auto [at, is_new] = spans.try_emplace(segment.stream, segment.span);
    at->second.start_ns = std::min(at->second.start_ns, segment.span.start_ns);
    at->second.end_ns = std::max(at->second.end_ns, segment.span.end_ns);
  }
  return spans;
}

/// `name`: as its address has it.
Response describe_case(const std::string& name, const archive::CaseReader& recording) {
  const archive::OpenEntry& opening = recording.opening();
  const std::map<std::string, archive::Span> spans = spans_of(recording);
  ordered_json streams = ordered_json::array();
  for (const archive::StreamInfo& stream : opening.streams) {
    const auto span = spans.find(stream.name);
    const bool recorded = span != spans.end();
    streams.push_back({{"name", stream.name},
                       {"kind", stream.kind},
                       {"media", stream.media},
                       {"purpose", stream.purpose},
                       {"profile", stream.profile},
                       {"start_ns", recorded ? ordered_json(span->second.start_ns) : ordered_json(nullptr)},
                       {"end_ns", recorded ? ordered_json(span->second.end_ns) : ordered_json(nullptr)}});
  }
  ordered_json clock_steps = ordered_json::array();
  for (const archive::WallClock::Step& step : recording.wall_clock().steps())
    clock_steps.push_back({{"time_ns", step.mono_ns}, {"step_ns", step.step_ns}});
  return Response::json(
      {{"id", name},
       {"opened", format_utc(recording.opened_at().utc)},
       {"opened_ns", recording.opened_at().mono_ns},  // what was recorded ahead lies before
       {"clock_steps", std::move(clock_steps)},
       {"state", recording.closing() ? "closed" : "open"},
       {"duration_ns", recording.duration_ns()},
       {"begins_ns", opening.begins_ns},
       {"device", opening.device},
       {"streams", std::move(streams)},
       {"plan", opening.plan ? ordered_json(crypto::to_hex(*opening.plan)) : ordered_json(nullptr)}});
}

}  // namespace

void add_case_list_routes(Router& router, ViewerContext& context) {
  struct SharedCatalogue {
    std::mutex mutex;
    std::unique_ptr<archive::Catalogue> catalogue;
  };
  const auto shared = std::make_shared<SharedCatalogue>();
  shared->catalogue = archive::Catalogue::open(context.home().catalogue_file);
  const auto rows = [shared, &context] {
    const std::lock_guard guard(shared->mutex);
    return shared->catalogue->list(context.home().archive);
  };
  // By its address nobody is searched for by name: addresses stand in the logs of whatever lies between.
  router.add("GET", "api/cases", Right::kListCases, [rows, &context](const Request& request) {
    return list_cases(context, request, rows(), question_of_address(request), nullptr);
  });
  router.add("POST", "api/cases/search", Right::kListCases, [rows, &context](const Request& request) {
    return list_cases(context, request, rows(), question_of_body(request), subjects_for(request));
  });
}

void add_case_routes(Router& router, ViewerContext& context) {
  router.add("GET", "api/cases/{case:case}/subject", Right::kWatch,
             [&context](const Request& request) { return case_subjects(context, request); });
  router.add("GET", "api/cases/{case:case}", Right::kReadCase, [&context](const Request& request) {
    return describe_case(request.parameter("case"), context.open_case(request));
  });
}

}  // namespace kiroku::viewer
