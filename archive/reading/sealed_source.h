// Where the sealed bytes of segments come from where they are no files in the case's folder, as where the
// case lies in a store.
#pragma once

#include <memory>

#include "archive/format/ledger_entry.h"
#include "crypto/byte_source.h"

namespace kiroku::archive {

/// Implementations are thread-safe.
class SealedSource {
 public:
  virtual ~SealedSource() = default;
  /// The bytes that are stored for the segment, of the size that its entry states; whoever reads them
  /// compares them with the entry's hash. Throws kiroku::Error in a sentence where there are none.
  [[nodiscard]] virtual std::unique_ptr<crypto::ByteSource> open(const SegmentEntry& segment) const = 0;
  /// The segment will be opened soon: where that takes a while, it is begun with. Returns at once; what fails
  /// open() tells.
  virtual void expect(const SegmentEntry& /*segment*/) const {}
};

}  // namespace kiroku::archive
