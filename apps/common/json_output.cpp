#include "apps/common/json_output.h"

#include <iostream>

#include <nlohmann/json.hpp>

namespace kiroku::apps {

void print_json(const nlohmann::ordered_json& object) {
  std::cout << object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
}

}  // namespace kiroku::apps
