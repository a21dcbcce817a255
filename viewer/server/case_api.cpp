#include <algorithm>
#include <map>
#include <mutex>

#include <nlohmann/json.hpp>

#include "archive/catalogue.h"
#include "archive/catalogue_json.h"
#include "crypto/encoding.h"
#include "viewer/server/api.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

constexpr std::int64_t kUsualRows = 50;
constexpr std::int64_t kMostRows = 500;

ordered_json row_json(const archive::CatalogueRow& row) {
  ordered_json out{{"id", row.case_id}};
  out.update(archive::catalogue_json(row));
  return out;
}

/// Whether every word stands somewhere in what the list shows of the case.
bool is_found(const archive::CatalogueRow& row, const std::vector<std::string>& words) {
  std::string shown =
      row.case_id + " " + format_utc(row.opened) + " " + row.state + " " + row.last_verdict.value_or("");
  for (const std::string& stream : row.streams) shown += " " + stream;
  return std::ranges::all_of(words,
                             [&](const std::string& word) { return shown.find(word) != std::string::npos; });
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream stream(text);
  for (std::string word; stream >> word;) out.push_back(word);
  return out;
}

Response list_cases(const Request& request, const std::vector<archive::CatalogueRow>& rows) {
  const std::vector<std::string> words = words_of(request.query_text("search").value_or(""));
  const std::int64_t limit = request.query_integer("limit").value_or(kUsualRows);
  if (limit < 1 || limit > kMostRows)
    throw Refusal(400, "'limit' must be from 1 to " + std::to_string(kMostRows));
  const std::optional<std::string> before = request.query_text("before");
  ordered_json cases = ordered_json::array();
  bool begun = !before;
  for (const archive::CatalogueRow& row : rows) {
    if (std::ssize(cases) == limit) break;
    if (begun && is_found(row, words)) cases.push_back(row_json(row));
    begun = begun || row.case_id == *before;
  }
  return Response::json({{"cases", std::move(cases)}});
}

/// Where each stream's recording begins and ends on the case clock.
std::map<std::string, archive::Span> spans_of(const archive::CaseReader& recording) {
  std::map<std::string, archive::Span> spans;
  recording.for_each([&](const archive::CaseEntry& entry) {
    const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body);
    if (segment == nullptr) return;
    const auto [at, is_new] = spans.try_emplace(segment->stream, segment->span);
    at->second.start_ns = std::min(at->second.start_ns, segment->span.start_ns);
    at->second.end_ns = std::max(at->second.end_ns, segment->span.end_ns);
  });
  return spans;
}

Response describe_case(const archive::CaseReader& recording) {
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
  return Response::json(
      {{"id", opening.case_id},
       {"opened", format_utc(recording.opened_at().utc)},
       {"state", recording.closing() ? "closed" : "open"},
       {"duration_ns", recording.duration_ns()},
       {"begins_ns", opening.begins_ns},
       {"device", opening.device},
       {"streams", std::move(streams)},
       {"plan", opening.plan ? ordered_json(crypto::to_hex(*opening.plan)) : ordered_json(nullptr)}});
}

}  // namespace

void add_case_routes(Router& router, ViewerContext& context) {
  struct SharedCatalogue {
    std::mutex mutex;
    std::unique_ptr<archive::Catalogue> catalogue;
  };
  const auto shared = std::make_shared<SharedCatalogue>();
  shared->catalogue = archive::Catalogue::open(context.home().catalogue_file);
  router.add("GET", "api/cases", Right::kListCases, [shared, &context](const Request& request) {
    const std::lock_guard guard(shared->mutex);
    return list_cases(request, shared->catalogue->list(context.home().archive));
  });
  router.add("GET", "api/cases/{case:case}", Right::kReadCase,
             [&context](const Request& request) { return describe_case(context.open_case(request)); });
}

}  // namespace kiroku::viewer
