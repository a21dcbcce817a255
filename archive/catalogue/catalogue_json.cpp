#include "archive/catalogue/catalogue_json.h"

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"

namespace kiroku::archive {

nlohmann::ordered_json catalogue_json(const CatalogueRow& row) {
  using nlohmann::ordered_json;
  return {{"opened", format_utc(row.opened)},
          {"duration_ns", or_null(row.duration_ns)},
          {"state", row.state},
          {"streams", row.streams},
          {"segments", row.segments},
          {"bytes", row.bytes},
          {"tokens", row.tokens},
          {"verdict", or_null(row.last_verdict)},
          {"verified", or_null(row.verified)}};
}

}  // namespace kiroku::archive
