// Why an appliance's request is not answered: a status of HTTP, and half a sentence for the appliance.
#pragma once

#include <string>

namespace kiroku::apps {

struct DeskRefusal {
  int status;
  std::string why;
};

}  // namespace kiroku::apps
