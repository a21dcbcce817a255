#include "archive/catalogue_json.h"

#include <nlohmann/json.hpp>

namespace kiroku::archive {

nlohmann::ordered_json catalogue_json(const CatalogueRow& row) {
  using nlohmann::ordered_json;
  return {{"opened", format_utc(row.opened)},
          {"duration_ns", row.duration_ns ? ordered_json(*row.duration_ns) : ordered_json(nullptr)},
          {"state", row.state},
          {"streams", row.streams},
          {"segments", row.segments},
          {"bytes", row.bytes},
          {"tokens", row.tokens},
          {"verdict", row.last_verdict ? ordered_json(*row.last_verdict) : ordered_json(nullptr)},
          {"verified", row.verified ? ordered_json(format_utc(*row.verified)) : ordered_json(nullptr)}};
}

}  // namespace kiroku::archive
