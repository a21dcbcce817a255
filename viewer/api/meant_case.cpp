#include "viewer/api/meant_case.h"

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "viewer/http/request.h"
#include "viewer/people/json_fields.h"

namespace kiroku::viewer {

std::optional<std::string> meant_case(const nlohmann::json& asked, bool may_be_none) {
  if (!asked.contains("case")) return std::nullopt;
  std::string meant = take_text(asked, "case");
  if (!archive::is_case_id(meant) && !(may_be_none && meant.empty()))
    throw Refusal(400, "'case' must be the name of a case");
  return meant;
}

void refuse_meant(const std::string& room, const std::string& meant, const std::string& running) {
  if (meant.empty())
    throw Refusal(409, "room " + room + " has begun case " + running + " meanwhile: nothing was done");
  if (running.empty() || running == meant)
    throw Refusal(409, "room " + room + " is not recording case " + meant + ": nothing was done");
  throw Refusal(409, "room " + room + " is recording case " + running + ", and not case " + meant +
                         ": nothing was done");
}

}  // namespace kiroku::viewer
