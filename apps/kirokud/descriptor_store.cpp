#include "apps/kirokud/descriptor_store.h"

#include <array>
#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"

namespace kiroku::apps {
namespace {

constexpr const char* kProbe = "kiroku-probe";
constexpr std::uint64_t kPatience_us = 2'000'000;

void give(const std::string& name, int descriptor) {
  const std::string words = "FDSTORE=1\nFDPOLL=0\nFDNAME=" + name;
  static_cast<void>(::sd_pid_notify_with_fds(0, 0, words.c_str(), &descriptor, 1));
}

void take_back(const std::string& name) {
  static_cast<void>(::sd_notify(0, ("FDSTOREREMOVE=1\nFDNAME=" + name).c_str()));
}

/// A descriptor's name may hold no colon.
std::string name_of(const std::string& kind, const std::string& owner) {
  constexpr std::size_t kDigits = 32;
  return kind + "-" + crypto::to_hex(crypto::sha256(bytes_of(owner))).substr(0, kDigits);
}

std::string numbered(const std::string& name, std::size_t file) { return name + "-" + std::to_string(file); }

}  // namespace

DescriptorStore::DescriptorStore(std::function<void(const std::string& sentence)> tell)
    : tell_(std::move(tell)) {
  char** names = nullptr;
  const int count = ::sd_listen_fds_with_names(1, &names);
  for (int i = 0; i < count; ++i) {
    // Of two with one name one is closed.
    given_.insert_or_assign(names[i], Descriptor(SD_LISTEN_FDS_START + i));
    ::free(names[i]);  // NOLINT(cppcoreguidelines-no-malloc): systemd's
  }
  ::free(static_cast<void*>(names));  // NOLINT(cppcoreguidelines-no-malloc)
}

recorder::InboxMemory DescriptorStore::memory_of(const std::string& listen) {
  // What stands behind the address only says who may send.
  return memory(name_of("hl7", listen.substr(0, listen.find('?'))), "what HL7 messages say");
}

recorder::InboxMemory DescriptorStore::memory_of_room(const std::string& room) {
  return memory(name_of("room", room), "by which numbers monitors name the patient of room " + room);
}

recorder::InboxMemory DescriptorStore::memory(const std::string& name, const std::string& what) {
  std::array<Descriptor, recorder::KeptMemory::kFiles> earlier;
  std::array<bool, recorder::KeptMemory::kFiles> is_given{};
  for (std::size_t i = 0; i < earlier.size(); ++i) {
    auto node = given_.extract(numbered(name, i));
    if (!node) continue;
    earlier.at(i) = std::move(node.mapped());
    is_given.at(i) = true;
  }
  try {
    const auto memory = std::make_shared<recorder::KeptMemory>(std::move(earlier));
    for (std::size_t i = 0; i < is_given.size(); ++i) {
      if (!is_given.at(i)) give(numbered(name, i), memory->descriptor(i));
    }
    recorder::InboxMemory of_inbox;
    of_inbox.earlier = memory->take_earlier().value_or(Bytes());
    of_inbox.keep = [memory, what, tell = tell_, is_told = false](ByteView state) mutable {
      try {
        memory->keep(state);
        is_told = false;
      } catch (const std::exception& error) {
        if (!std::exchange(is_told, true)) tell(what + " would not outlive this process: " + error.what());
      }
    };
    return of_inbox;
  } catch (const std::exception& error) {
    tell_(what + " does not outlive this process: " + error.what());
    return {};
  }
}

void DescriptorStore::forget_rest() {
  for (const auto& [name, descriptor] : given_) take_back(name);
  given_.clear();
}

// The read end of a pipe tells whether anybody else holds the other one.
bool DescriptorStore::is_there() {
  std::array<int, 2> ends{};
  if (std::getenv("NOTIFY_SOCKET") == nullptr || ::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
    return false;
  const Descriptor reads(ends[0]);
  {
    const Descriptor writes(ends[1]);
    give(kProbe, writes.number());
    if (::sd_notify_barrier(0, kPatience_us) <= 0) return false;
  }
  pollfd asked{reads.number(), POLLIN, 0};
  const bool is_held = ::poll(&asked, 1, 0) == 0;
  take_back(kProbe);
  return is_held;
}

}  // namespace kiroku::apps
