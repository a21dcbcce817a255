#include "tests/unit/trainer/made_object.h"

#include <map>
#include <utility>

namespace kiroku::trainer {

const OrganObject& made_object(ObjectKind kind, std::size_t vertices) {
  static std::map<std::pair<ObjectKind, std::size_t>, OrganObject> made;
  const std::pair key(kind, vertices);
  const auto found = made.find(key);
  return found != made.end() ? found->second : made.emplace(key, make_object(kind, vertices)).first->second;
}

}  // namespace kiroku::trainer
