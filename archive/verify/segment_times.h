// Whether the time stamps that a stream's entries state run as their times do (docs/reference/format.md,
// "Time stamps of a stream"). Nothing here throws but std::bad_alloc. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "archive/format/ledger_entry.h"
#include "archive/verify/finding_list.h"

namespace kiroku::archive {

/// A recorder stamps a picture of a burst at most 1 s after it came. A tenth of that is added. Recorders from
/// before that bound spread a burst by half the time between two pictures at the rate that the source stated,
/// whatever that was: so stamps that are too late accuse nobody.
inline constexpr std::int64_t kLatestStampNs = 1'100'000'000;

/// Takes the segments of one stream in their order.
class SegmentTimes {
 public:
  /// The list must outlive the object.
  SegmentTimes(StreamInfo info, FindingList& findings);
  /// `interrupted`: a gap of the stream, `recovered` or an excerpt's beginning stands before it, so that its
  /// recorder may have begun anew. Adds a finding of the first entry that does not fit, one of each code.
  void take(const SegmentEntry& segment, std::uint64_t entry, bool interrupted);

 private:
  struct Stated {
    std::int64_t offset = 0;  // time stamp less the time that is stated, in the unit
    std::uint64_t entry = 0;
  };
  /// All of one container. Numbers in its unit.
  struct Container {
    bool is_begun = false;
    Stated lowest;
    /// The constant is no lower than this: else that entry's picture would have been stamped too late.
    Stated floor;
    std::int64_t latest = 0;                // where the last picture may have been stamped, less the constant
    std::int64_t first_pts = 0, start = 0;  // of the last segment
    std::int64_t pictures = 0;              // in it
  };

  void compare(Container& of, std::int64_t per_second, const SegmentEntry& segment, std::uint64_t entry,
               bool interrupted);
  void differ(const SegmentEntry& segment, std::uint64_t entry, const std::string& how);
  void tell_late(const Stated& early, const Stated& late, std::int64_t per_second);

  StreamInfo info_;
  FindingList* findings_;
  std::map<std::string, Container, std::less<>> containers_;  // by media
  bool told_differ_ = false, told_late_ = false;
};

}  // namespace kiroku::archive
