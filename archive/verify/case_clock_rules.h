// The case clock beside the clocks of the authorities that stamped the case, and those beside each other
// (docs/reference/format.md, "Clocks" and "Checkpoints and tokens"). All is judged when the ledger was read,
// since an entry says what the clocks did before it. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/verify/brackets.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/stated_slews.h"

namespace kiroku::archive {

/// A token that the ledger enters. Times are of the case clock, in ns.
struct TimedToken {
  StampedToken stamped;  // without a root where none that is trusted vouches for it
  std::string file;
  std::int64_t written_ns = 0;  // its entry
  // gen_time lies between these, where the first is known
  std::optional<std::int64_t> earliest_ns;
  std::int64_t latest_ns = 0;
  bool external = false;  // valid, and of an outside authority
  bool ordering = false;  // the authority states that its tokens are in order by time alone
  // Over the end, and the recorder does not say when by the case clock: it may come hours or years later.
  bool stands = false;
  bool is_over_end = false;  // its checkpoint covers close
};

class CaseClockRules {
 public:
  /// `findings` must outlive the object.
  explicit CaseClockRules(FindingList& findings) : findings_(&findings) {}

  // In the ledger's order.
  void take(TimedToken token);
  /// The rate of a clock entry: what the case clock is stated to have gained or lost is allowed for.
  void take_rate(std::int64_t rate_ppb, std::int64_t mono_ns);
  /// A clock entry's step of the machine's wall clock: tokens of an authority on this machine follow it.
  void take_step(std::int64_t step_ns, std::int64_t mono_ns) { steps_.push_back({mono_ns, step_ns}); }
  /// Across a crash the case clock is carried on by the wall clock: elapsed times across it prove nothing.
  void take_recovered();
  /// When recording ended, as `close` says.
  void take_close(std::int64_t mono_ns) { closed_ns_ = mono_ns; }

  /// After the last entry: says what the clocks contradict. Returns the roots of those authorities whose
  /// clock was set in the course of the case, as another one shows: they prove no time of it.
  /// `from_open`: no entry between `open` and the first one taken is left out, which might state a slew.
  std::set<std::string> finish(bool from_open = true);

 private:
  struct Timed : TimedToken {
    std::uint64_t recoveries = 0;                    // before it
    std::int64_t slewed_from_ns = 0, slewed_ns = 0;  // up to earliest_ns and up to latest_ns
  };
  /// Of an authority's clock with the case clock, between two tokens.
  struct Difference {
    const Timed* before = nullptr;
    std::int64_t elapsed_us = 0;                   // by the authority
    std::int64_t shortest_us = 0, longest_us = 0;  // by the case clock
    std::int64_t too_fast_us = 0;                  // went the authority's clock, beyond what is tolerated
    std::int64_t excess_us = 0;  // beyond what is tolerated, either way, where that contradicts anything
  };
  /// How an authority's clock goes beside the case clock: of all tokens since the last difference those that
  /// leave the least to the next.
  struct Pace {
    const Timed* last = nullptr;
    // by how far the authority's clock is ahead of the case clock at least, and behind at least, in us, less
    // what the case clock may have drifted since
    std::optional<std::pair<std::int64_t, const Timed*>> most_ahead, most_behind;

    /// Keeps the address.
    void add(const Timed& token);
    [[nodiscard]] std::optional<Difference> difference(const Timed& now) const;
    /// By how much `now` is later than the case clock explains, at least; nothing where it has no token.
    [[nodiscard]] std::optional<std::int64_t> late_us(const Timed& now) const;
    [[nodiscard]] std::array<const Timed*, 3> strictest() const;  // null where there is none
    static Difference compare(const Timed& before, const Timed& now);
    /// How far the clocks differ, in words.
    static std::string text(const Difference& found, const Timed& now);
  };
  struct Step {
    std::int64_t mono_ns = 0, step_ns = 0;
  };
  /// Of two tokens' clock, which is not vouched for from outside, with the case clock.
  struct Disagreement {
    Place place;
    std::string text;
    std::int64_t from_ns = 0, until_ns = 0;  // the entries of both
    std::int64_t excess_us = 0;              // beyond what is tolerated
  };
  /// Of two tokens' clock, which is vouched for from outside, with the case clock.
  struct Contradiction {
    Place place;
    std::string text, root;
    Span span;           // the entries of both
    bool ahead = false;  // the authority's clock went on by more than the case clock
    std::int64_t excess_us = 0;
  };
  class SharedTimes;
  /// Tokens of one authority, one after the other, whose clock goes on as the case clock does.
  class AgreeingRun {
   public:
    /// In the ledger's order.
    void add(const Timed& token);
    /// After the last one.
    void finish();
    [[nodiscard]] const Span& span() const { return span_; }  // the entries of its first and its last one
    /// By how much the authority's clock may at most have gone on more than the case clock (`ahead`), or less
    /// than it, from a token that is entered no later than `over` begins to one that is entered no earlier
    /// than it ends; of all such pairs the one that says the most. Nothing where there is none.
    [[nodiscard]] std::optional<std::int64_t> at_most_us(const Span& over, bool ahead) const;

   private:
    /// How far a clock is from the case clock, either way, in us, and less or more by what is allowed for.
    struct Bounds {
      std::int64_t written_ns = 0, ahead_us = 0, behind_us = 0;
    };
    Span span_;
    std::vector<Bounds> until_;  // up to each token: the latest entry, and the largest of what it is at least
    std::vector<Bounds> from_;   // from each token on: the earliest entry, the smallest of what it is at most
  };

  /// Valid tokens by entry, for the order rule.
  class Order {
   public:
    void add(const StampedToken& token);
    /// Of those whose entry a checkpoint of this size covers, the one with the latest lower bound; null:
    /// none.
    [[nodiscard]] const StampedToken* latest_below(std::uint64_t size) const;

   private:
    std::vector<const StampedToken*> tokens_;
    std::vector<std::size_t> latest_;  // index of the latest lower bound up to each
  };

  /// Of a token of an outside authority; `agrees`: check_elapsed() found nothing.
  void check_order(const Timed& now, bool agrees);
  /// False where the authority's clock and the case clock differ by more than is tolerated.
  bool check_elapsed(const Timed& now);
  void compare_authorities(const std::set<std::string>& left_out);
  /// Says which clock is wrong, as far as other outside authorities tell; the roots of those that were set.
  std::set<std::string> report_contradictions(bool from_open);
  /// Whether another outside authority's clock went on as the case clock did over that time, and cannot have
  /// gone on as the one that contradicts it.
  [[nodiscard]] bool is_confirmed(const Contradiction& one) const;
  /// Whether a slew that is stated before the entries that are here may explain all of it.
  [[nodiscard]] bool may_be_slewed_unseen(const Contradiction& one) const;
  /// Says by how much the first token over the end came after `close`, whatever the ledger states of it.
  void report_late_end(const std::set<std::string>& left_out);
  /// Adds what no stated step of the wall clock explains.
  void report_disagreements();
  void report_slews();
  /// By how much the wall clock was stated to be set between two times of the case clock, either way. A step
  /// is stated within a second, so an entry may follow the token that shows it already.
  [[nodiscard]] double stepped_ns(std::int64_t from_ns, std::int64_t until_ns) const;
  /// Keeps the first and the latest time of anything that was taken.
  void see(std::int64_t mono_ns);

  FindingList* findings_;
  std::vector<Timed> tokens_;
  StatedSlews slews_;
  std::optional<Span> seen_;
  std::vector<Step> steps_;
  std::vector<double> stepped_before_;  // finish(): by all steps in front of each, either way
  std::uint64_t recoveries_ = 0;

  std::map<std::string, Order> order_of_;  // of outside authorities, by root
  std::map<std::string, Pace> pace_of_;    // by root, else by name
  std::vector<Disagreement> disagreements_;
  std::optional<std::int64_t> closed_ns_;
  std::vector<Contradiction> contradictions_;
  std::set<std::string> contradicting_;  // the roots of contradictions_
  // by root of an outside authority: where its clock is as the case's
  std::map<std::string, std::vector<AgreeingRun>> agreeing_;
  std::optional<std::int64_t> first_rate_ns_;  // the first clock entry that states a rate
};

}  // namespace kiroku::archive
