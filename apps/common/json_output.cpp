#include "apps/common/json_output.h"

#include <iostream>

#include <nlohmann/json.hpp>

#include "base/printable.h"

namespace kiroku::apps {

void print_json(const nlohmann::ordered_json& object) {
  std::cout << printable_json(object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace)) << "\n";
}

}  // namespace kiroku::apps
