// Tokens of a case: each by itself, in order among each other, and against the case clock; and the brackets
// of outside time that they give (docs/reference/format.md, "Checkpoints and tokens"). Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/verify/brackets.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

class TokenRules {
 public:
  /// Everything referred to must outlive the object.
  TokenRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
             const CheckpointRules& checkpoints);

  /// The token entry at `entry`, written at `mono_ns` of the case clock.
  void take(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns);
  void take_missed(const TokenMissedEntry& missed, std::uint64_t entry);
  /// Across a crash the case clock is carried on by the wall clock: elapsed times across it prove nothing.
  void take_recovered();
  /// The rate of a clock entry: what the case clock is stated to have gained or lost is allowed for.
  void take_rate(std::int64_t rate_ppb, std::int64_t mono_ns);
  /// A clock entry's step of the machine's wall clock: tokens of an authority on this machine follow it.
  void take_step(std::int64_t step_ns, std::int64_t mono_ns) { steps_.push_back({mono_ns, step_ns}); }
  void take_close(std::uint64_t entry) { close_ = entry; }
  /// After the last entry. An excerpt may leave out the token over close.
  void finish(bool whole_case);

  /// What proves the time of a case whose last claim is in this entry.
  [[nodiscard]] TimeProof time(std::uint64_t last_claim) const;
  /// Entries, from 0 on, that a valid token of an outside authority covers.
  [[nodiscard]] std::uint64_t outside_entries() const { return outside_entries_; }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Valid ones under trusted roots: of outside authorities, and of the recorder's own.
  [[nodiscard]] std::uint64_t outside_count() const { return outside_.size(); }
  [[nodiscard]] std::uint64_t own_count() const { return valid_.size() - outside_.size(); }
  [[nodiscard]] std::vector<Bracket> brackets(std::uint64_t first, std::uint64_t entries) const;
  [[nodiscard]] const std::vector<AuthorityClock>& clocks() const { return clocks_; }
  /// Hashes of the entered token files, in order.
  [[nodiscard]] const std::map<std::uint64_t, crypto::Sha256Digest>& hashes() const { return hashes_; }
  /// Largest tree size that an entered token is over; 0 if there is none.
  [[nodiscard]] std::uint64_t largest_checkpoint() const { return largest_checkpoint_; }
  /// Whether each of the entries [first, end) stands behind close and enters a token, of whichever
  /// checkpoint, and states what that token says: then they say nothing that the token files do not.
  [[nodiscard]] bool restate_tokens(std::uint64_t first, std::uint64_t end) const;

 private:
  struct Judged {
    bool valid = false;
    bool external = false;
    bool restated = false;  // the entry states what the token says, and that is over its checkpoint
    bool ordering = false;  // the authority states that its tokens are in order by time alone
    std::string root{};     // StampedToken::root of a valid one
  };
  struct Earlier {
    std::uint64_t entry = 0, checkpoint = 0;
    std::int64_t mono_ns = 0;
    UtcTime gen_time;
    std::int64_t accuracy_ns = 0;
    bool external = false;
    // gen_time lies between these on the case clock, where the first is known
    std::optional<std::int64_t> earliest_ns;
    std::int64_t latest_ns = 0;
    std::int64_t slewed_ns = 0;    // slewed_until() then
    bool stands = false;           // after close the case clock stands: a token may come hours or years later
    std::uint64_t recoveries = 0;  // before it
    std::string root{};
    std::string file{};
  };
  /// Of an authority's clock with the case clock, between two tokens.
  struct Difference {
    Earlier before;
    std::int64_t elapsed_us = 0;                   // by the authority
    std::int64_t shortest_us = 0, longest_us = 0;  // by the case clock
    std::int64_t excess_us = 0;                    // beyond what is tolerated
  };
  /// How an authority's clock goes beside the case clock: of all tokens since the last difference those that
  /// leave the least to the next.
  struct Pace {
    std::optional<Earlier> last;
    // by how far the authority's clock is ahead of the case clock at least, and behind at least, in us, less
    // what the case clock may have drifted since
    std::optional<std::pair<std::int64_t, Earlier>> most_ahead, most_behind;

    void add(const Earlier& token);
    [[nodiscard]] std::optional<Difference> difference(const Earlier& now) const;
    /// How far the clocks differ, in words.
    static std::string text(const Difference& found, const Earlier& now);
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
  struct Untrusted {
    std::uint64_t checkpoint = 0, entry = 0;
    std::string file, explanation;
  };

  /// Valid tokens by entry, for the order rule.
  class Order {
   public:
    void add(StampedToken token);
    /// Of those whose entry a checkpoint of this size covers, the one with the latest lower bound; null:
    /// none.
    [[nodiscard]] const StampedToken* latest_below(std::uint64_t size) const;

   private:
    std::vector<StampedToken> tokens_;
    std::vector<std::size_t> latest_;  // index of the latest lower bound up to each
  };

  std::optional<std::string> read_token(const TokenEntry& token, std::uint64_t entry);
  Judged judge(const TokenEntry& token, std::uint64_t entry, const std::string& response);
  bool compare_entry(const TokenEntry& token, std::uint64_t entry, const timestamp::TokenInfo& info);
  /// Of a valid token of an outside authority; `agrees`: check_elapsed() found nothing.
  void check_order(const StampedToken& now, bool agrees, bool ordering);
  void compare_authorities();
  /// Authorities whose clock was set in the course of the case, as another one shows, prove no time of it.
  void leave_out(const std::set<std::string>& roots);
  void check_exchange(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns);
  /// False where the authority's clock and the case clock differ by more than is tolerated.
  bool check_elapsed(const TokenEntry& token, const Earlier& now);
  void compare_clocks(const TokenEntry& token, bool outside);
  /// Says which clock is wrong, as far as other outside authorities tell, and leaves out what is.
  void report_contradictions();
  /// Whether another outside authority's clock went on as the case clock did over that time.
  [[nodiscard]] bool is_confirmed(const Contradiction& one) const;
  /// Adds what no stated step of the wall clock explains.
  void report_disagreements();
  /// By how much the wall clock was stated to be set between two times of the case clock, either way. A step
  /// is stated within a second, so an entry may follow the token that shows it already.
  [[nodiscard]] double stepped_ns(std::int64_t from_ns, std::int64_t until_ns) const;
  /// How much slews may have moved the case clock, all in all, up to this time.
  [[nodiscard]] std::int64_t slewed_until(std::int64_t mono_ns) const;

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  const CheckpointRules* checkpoints_;

  std::vector<StampedToken> valid_;
  std::vector<StampedToken> outside_;      // those of valid_ that are of outside authorities
  std::vector<Earlier> outside_times_;     // of outside_
  std::map<std::string, Order> order_of_;  // of outside authorities, by root
  std::map<std::string, Pace> pace_of_;    // by root, else by name
  std::set<std::pair<std::uint64_t, std::string>> entered_;
  std::vector<Untrusted> untrusted_;
  std::set<std::uint64_t> valid_checkpoints_;
  std::set<std::uint64_t> restating_;  // entries behind close
  std::map<std::uint64_t, crypto::Sha256Digest> hashes_;
  std::vector<AuthorityClock> clocks_;
  std::map<std::pair<std::string, bool>, std::size_t> clock_of_;  // place in clocks_ by authority, `outside`
  struct Slew {
    std::int64_t total_ns = 0;  // up to since_ns
    std::int64_t since_ns = 0;
    std::int64_t rate_ppb = 0;  // since then; 0 while there is none
  };
  Slew slew_;
  std::vector<Step> steps_;
  std::vector<double> stepped_before_;  // finish(): by all steps in front of each, either way
  std::vector<Disagreement> disagreements_;
  std::vector<Contradiction> contradictions_;
  std::map<std::string, std::vector<Span>>
      agreeing_;  // by root of an outside authority: where its clock is as the case's
  std::uint64_t recoveries_ = 0;
  std::optional<std::uint64_t> close_;
  std::uint64_t largest_checkpoint_ = 0;
  bool missed_after_close_ = false;
  bool no_trust_ = false;
  std::uint64_t outside_entries_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace kiroku::archive
