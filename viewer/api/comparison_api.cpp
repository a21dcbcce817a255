#include <functional>
#include <memory>

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"
#include "crypto/age_error.h"
#include "viewer/api/api.h"
#include "viewer/kept/kept_comparison.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

ordered_json checks_json(const std::vector<Check>& checks) {
  ordered_json all = ordered_json::array();
  for (const Check& check : checks) {
    all.push_back({{"about", check.what},
                   {"answer", answer_name(check.answer)},
                   {"text", check.text},
                   {"entry", or_null(check.entry)},
                   {"size", or_null(check.size)},
                   {"time", or_null(check.time)},
                   {"by", or_null(check.by)},
                   {"kind", or_null(check.kind)}});
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
          {"entered_by", or_null(kept.entered_by)},
          {"made_at", format_utc(kept.made.made_at)},
          {"program", kept.made.program},
          {"replay", kept.has_replay},
          {"radiographs", kept.has_radiographs},
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
        const compare::LogOfCase log = compare::read_log_of_case(context_.home().log_folder,
                                                                 recording.opening(), context_.home().device);
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
    return file(request, &compare::KeptPlace::sealed_document, "read comparison ",
                [](const compare::KeptPlace& place, const crypto::AgeIdentities& identities) {
                  return Response::bytes(
                      compare::open_kept(place.sealed_document(), identities, compare::kLargestDocument),
                      "application/json");
                });
  }
  [[nodiscard]] Response replay(const Request& request) {
    return file(request, &compare::KeptPlace::sealed_replay, "watched the plan of comparison ",
                film("replay"));
  }
  [[nodiscard]] Response radiographs(const Request& request) {
    return file(request, &compare::KeptPlace::sealed_radiographs,
                "watched the plan's radiographs of comparison ", film("radiographs"));
  }

 private:
  [[nodiscard]] const std::filesystem::path& folder() const { return context_.home().comparisons_folder; }

  using Open = std::function<Response(const compare::KeptPlace&, const crypto::AgeIdentities&)>;

  Open film(const std::string& role) {
    return [this, role](const compare::KeptPlace& place, const crypto::AgeIdentities& identities) {
      const auto opened = std::make_shared<const compare::KeptFilm>(place, role, identities, hashed_films_);
      return Response::read(
          {[opened](std::uint64_t offset, std::span<std::byte> into) { opened->read_at(offset, into); }, 0,
           opened->size()},
          "video/mp4");
    };
  }

  Response file(const Request& request, std::filesystem::path (compare::KeptPlace::*which)() const,
                const std::string& deed, const Open& open) {
    const std::string& case_id = request.parameter("case");
    const std::string& name = request.parameter("comparison");
    const compare::KeptPlace place = compare::kept_place(folder(), case_id, name);
    const std::filesystem::path sealed = (place.*which)();
    return opened(request, [&](const crypto::AgeIdentities& identities) {
      std::error_code failed;
      if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(sealed, failed)))
        throw Refusal(404, "the case has no such file of a comparison '" + name + "'");
      Response opened = open(place, identities);
      context_.enter_access_once(request, case_id, deed + name);
      return opened;
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
  crypto::HashTrails hashed_films_;
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
  add("comparisons/{comparison:name}/radiographs.mp4", &ComparisonApi::radiographs);
}

}  // namespace kiroku::viewer
