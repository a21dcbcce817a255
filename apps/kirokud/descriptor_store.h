// What systemd holds for the recorder from one start to the next (sd_notify(3), FDSTORE=): what messages said
// of patients, which must neither be forgotten by a start nor lie on a disk in the clear.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "base/descriptor.h"
#include "recorder/daemon/kept_memory.h"
#include "recorder/procedure/procedure_inbox.h"

namespace kiroku::apps {

/// One thread at a time, but for what memory_of() gives, of which each is its inbox's.
class DescriptorStore {
 public:
  /// Takes what systemd gave this process. Before any other thread is there: it changes the environment.
  /// `tell` hears what a person should see.
  explicit DescriptorStore(std::function<void(const std::string& sentence)> tell);

  /// Of the inbox at this address. Also where there is no systemd, or it keeps nothing: then nothing comes of
  /// it.
  recorder::InboxMemory memory_of(const std::string& listen);
  /// Likewise of what is known of the patient of a room's case.
  recorder::InboxMemory memory_of_room(const std::string& room);
  /// Lets go of what no inbox or room asked for since the start: its address left the configuration.
  void forget_rest();

  /// Asks systemd whether it keeps what it is given; waits for the answer a moment.
  [[nodiscard]] static bool is_there();

 private:
  /// `what` it holds, for people.
  recorder::InboxMemory memory(const std::string& name, const std::string& what);

  const std::function<void(const std::string& sentence)> tell_;
  std::map<std::string, Descriptor> given_;  // by name, until they are asked for
};

}  // namespace kiroku::apps
