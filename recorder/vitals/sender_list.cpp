#include "recorder/vitals/sender_list.h"

#include <algorithm>

#include "base/error.h"
#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

SenderList SenderList::parse(std::string_view text, const std::string& source) {
  SenderList list;
  for (;;) {
    const std::size_t comma = text.find(',');
    const std::string_view item = text.substr(0, comma);
    const std::size_t slash = item.find('/');
    const bool has_facility = slash != std::string_view::npos;
    Entry entry{std::string(item.substr(0, slash)), has_facility ? std::string(item.substr(slash + 1)) : ""};
    if (entry.application.empty() || (has_facility && entry.facility.empty())) {
      throw UsageError("source '" + source +
                       "': sender names who may send, as MSH-3 or MSH-3/MSH-4 of their messages; separate "
                       "several with commas");
    }
    list.entries_.push_back(std::move(entry));
    if (comma == std::string_view::npos) return list;
    text.remove_prefix(comma + 1);
  }
}

bool SenderList::takes(const Hl7Message& message) const {
  if (entries_.empty()) return true;
  const Hl7Field application = message.header().field(3);
  const std::string name = application.component(1).text();
  const std::string with_identifier = name + "^" + application.component(2).text();
  const std::string facility = message.header().field(4).component(1).text();
  return std::ranges::any_of(entries_, [&](const Entry& entry) {
    return (entry.application == name || entry.application == with_identifier) &&
           (entry.facility.empty() || entry.facility == facility);
  });
}

}  // namespace kiroku::recorder
