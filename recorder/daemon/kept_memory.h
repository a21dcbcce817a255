// Memory that outlives the process: two nameless files in memory alone, whose descriptors somebody else holds
// meanwhile (systemd). Whoever is cut off while it writes one leaves the other as it was. One thread at a
// time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "base/bytes.h"
#include "base/descriptor.h"

namespace kiroku::recorder {

class KeptMemory {
 public:
  static constexpr std::size_t kFiles = 2;
  static constexpr std::size_t kMostBytes = 256U << 20;

  /// Takes the files of an earlier process, as far as they are there, and makes the others. Throws
  /// kiroku::IoError where none can be made.
  explicit KeptMemory(std::array<Descriptor, kFiles> earlier);

  /// What the earlier process kept last; nothing where it kept nothing, or none of the files holds what was
  /// written to it. Once: it is not held any longer than that.
  [[nodiscard]] std::optional<Bytes> take_earlier();
  /// Throws kiroku::IoError; what was kept before is there still then.
  void keep(ByteView bytes);
  [[nodiscard]] int descriptor(std::size_t file) const { return files_.at(file).number(); }

 private:
  std::array<Descriptor, kFiles> files_;
  std::uint64_t generation_ = 0;  // of what was kept last
  std::size_t newest_ = 0;        // where that lies
  std::optional<Bytes> earlier_;
};

}  // namespace kiroku::recorder
