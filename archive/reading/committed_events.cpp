#include "archive/reading/committed_events.h"

#include <utility>
#include <variant>

#include "archive/format/event_line.h"

namespace kiroku::archive {

CommittedEvents::CommittedEvents(const CaseReader& recording) {
  recording.for_each([this](const CaseEntry& entry) {
    if (const auto* const mark = std::get_if<MarkEntry>(&entry.body)) left_.insert(mark->commitment);
  });
}

std::optional<std::string> CommittedEvents::take(std::string_view line) {
  std::optional<EventLine> read = parse_event_line(line);
  if (!read) return std::nullopt;
  const auto entry = left_.find(read->commitment);
  if (entry == left_.end()) return std::nullopt;
  left_.erase(entry);
  return std::move(read->event);
}

}  // namespace kiroku::archive
