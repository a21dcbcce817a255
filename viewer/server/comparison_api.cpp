#include <functional>
#include <memory>

#include <nlohmann/json.hpp>

#include "crypto/age_error.h"
#include "viewer/kept/kept_comparison.h"
#include "viewer/server/api.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

template <typename Value>
ordered_json or_null(const std::optional<Value>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json checks_json(const std::vector<Check>& checks) {
  ordered_json all = ordered_json::array();
  for (const Check& check : checks) {
    all.push_back({{"about", check.what},
                   {"answer", answer_name(check.answer)},
                   {"text", check.text},
                   {"entry", or_null(check.entry)},
                   {"size", or_null(check.size)},
                   {"time", check.time ? ordered_json(format_utc(*check.time)) : ordered_json(nullptr)},
                   {"by", check.by.empty() ? ordered_json(nullptr) : ordered_json(check.by)}});
  }
  return all;
}

ordered_json judged(const std::vector<Check>& checks) {
  return {{"verdict", answer_name(verdict_of(checks))}, {"checks", checks_json(checks)}};
}

ordered_json comparison_json(const compare::KeptComparison& kept) {
  return {{"name", kept.name},
          {"plan", kept.made.plan},
          {"made_by", kept.made.made_by},
          {"entered_by", kept.entered_by.empty() ? ordered_json(nullptr) : ordered_json(kept.entered_by)},
          {"made_at", format_utc(kept.made.made_at)},
          {"program", kept.made.program},
          {"replay", kept.has_replay},
          {"whole", judged(kept.checks)},
          {"sealed_before", judged(kept.plan_checks)}};
}

/// Of the sealed files alone: nothing is simulated here.
class ComparisonApi {
 public:
  explicit ComparisonApi(ViewerContext& context) : context_(context) {}

  [[nodiscard]] Response list(const Request& request) {
    return opened(request, [&](const crypto::AgeIdentities& identities) {
      const std::string& case_id = request.parameter("case");
      const std::vector<std::string> names = compare::kept_names(folder(), case_id);
      ordered_json comparisons = ordered_json::array(), unreadable = ordered_json::array();
      if (!names.empty()) {
        const archive::CaseReader recording = context_.open_case(request);
        const compare::LogOfCase log =
            compare::read_log_of_case(context_.home().log_folder, recording.opening());
        const compare::KeptEvidence evidence{&recording, &log, context_.home().device.to_string(),
                                             context_.home().trust};
        for (const std::string& name : names) {
          try {
            comparisons.push_back(comparison_json(
                compare::read_kept(compare::kept_place(folder(), case_id, name), identities, evidence)));
          } catch (const Error& error) {
            // One that was changed, or is another's, hides none of the others.
            unreadable.push_back({{"name", name}, {"problem", error.what()}});
          }
        }
        if (!comparisons.empty()) context_.enter_access_once(request, case_id, "read comparisons");
      }
      return Response::json({{"comparisons", std::move(comparisons)}, {"unreadable", std::move(unreadable)}});
    });
  }

  [[nodiscard]] Response document(const Request& request) {
    return file(request, &compare::KeptPlace::sealed_document, compare::kLargestDocument, "application/json",
                "read comparison ");
  }
  [[nodiscard]] Response replay(const Request& request) {
    return file(request, &compare::KeptPlace::sealed_replay, compare::kLargestReplay, "video/mp4",
                "watched the plan of comparison ");
  }

 private:
  [[nodiscard]] const std::filesystem::path& folder() const { return context_.home().comparisons_folder; }

  Response file(const Request& request, std::filesystem::path (compare::KeptPlace::*which)() const,
                std::uint64_t most_bytes, const std::string& type, const std::string& deed) {
    const std::string& case_id = request.parameter("case");
    const std::string& name = request.parameter("comparison");
    const std::filesystem::path sealed = (compare::kept_place(folder(), case_id, name).*which)();
    return opened(request, [&](const crypto::AgeIdentities& identities) {
      std::error_code failed;
      if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(sealed, failed)))
        throw Refusal(404, "the case has no such file of a comparison '" + name + "'");
      Bytes bytes = compare::open_kept(sealed, identities, most_bytes);
      context_.enter_access_once(request, case_id, deed + name);
      return Response::bytes(std::move(bytes), type);
    });
  }

  Response opened(const Request& request, const std::function<Response(const crypto::AgeIdentities&)>& give) {
    const Session::Identities identities = ViewerContext::require_unlocked(request);
    (void)context_.case_folder(request);  // 404 where there is none
    try {
      return give(*identities);
    } catch (const Refusal&) {
      throw;
    } catch (const crypto::AgeError& error) {
      throw Refusal(error.failure() == crypto::AgeFailure::kNoMatch ? 403 : 422, error.what());
    } catch (const Error& error) {
      throw Refusal(422, error.what());
    }
  }

  ViewerContext& context_;
};

}  // namespace

void add_comparison_routes(Router& router, ViewerContext& context) {
  const auto api = std::make_shared<ComparisonApi>(context);
  const auto add = [&](const std::string& pattern, Response (ComparisonApi::*answer)(const Request&)) {
    router.add("GET", "api/cases/{case:case}/" + pattern, Right::kCompare,
               [api, answer](const Request& request) { return (*api.*answer)(request); });
  };
  add("comparisons", &ComparisonApi::list);
  add("comparisons/{comparison:name}", &ComparisonApi::document);
  add("comparisons/{comparison:name}/replay.mp4", &ComparisonApi::replay);
}

}  // namespace kiroku::viewer
