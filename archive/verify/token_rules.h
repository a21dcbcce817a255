// Tokens of a case, each by itself, and the brackets of outside time that they give
// (docs/reference/format.md, "Checkpoints and tokens"). How they fit the case clock and each other is for
// CaseClockRules. Not thread-safe.
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
#include "archive/verify/case_clock_rules.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "timestamp/certificate_pool.h"

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
  // Of a clock entry, as CaseClockRules has them.
  void take_rate(std::int64_t rate_ppb, std::int64_t mono_ns) { clock_rules_.take_rate(rate_ppb, mono_ns); }
  void take_step(std::int64_t step_ns, std::int64_t mono_ns) { clock_rules_.take_step(step_ns, mono_ns); }
  void take_close(std::uint64_t entry, std::int64_t mono_ns) {
    close_ = entry;
    clock_rules_.take_close(mono_ns);
  }
  /// After the last entry. An excerpt may leave out the token over close; `from_open`: it has what is before.
  void finish(bool whole_case, bool from_open);

  /// What proves the time of a case whose claims are in the entries from `first_claim` to `last_claim`.
  [[nodiscard]] TimeProof time(std::uint64_t first_claim, std::uint64_t last_claim) const;
  /// Entries, from 0 on, that a valid token of an outside authority covers, over the entries that are here.
  [[nodiscard]] std::uint64_t outside_entries() const { return outside_entries_; }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Valid ones under trusted roots over the entries that are here: of outside authorities, and of the
  /// recorder's own.
  [[nodiscard]] std::uint64_t outside_count() const { return proving_outside_.size(); }
  [[nodiscard]] std::uint64_t own_count() const { return proving_.size() - proving_outside_.size(); }
  [[nodiscard]] std::vector<ProvingToken> proving() const;
  /// Valid ones, also over other entries than are here.
  [[nodiscard]] const std::vector<StampedToken>& valid() const { return valid_; }
  [[nodiscard]] const std::vector<StampedToken>& outside() const { return outside_; }
  [[nodiscard]] std::vector<Bracket> brackets(std::uint64_t first, std::uint64_t entries) const;
  [[nodiscard]] const std::vector<AuthorityClock>& clocks() const { return clocks_; }
  /// After finish(): of the tokens that prove time.
  [[nodiscard]] std::vector<StampingAuthority> authorities() const;
  /// Of each outside authority the first valid token whose time on the case clock is bounded, by its
  /// exchange, or else by its checkpoint and its entry.
  [[nodiscard]] const std::map<std::string, ClockComparison>& first_outside() const { return first_outside_; }
  /// After finish(): the earliest token of an outside authority, where all of them are over close.
  [[nodiscard]] std::optional<StampedToken> first_after_close() const;
  /// After finish(): the token of an outside authority that is entered first. Nothing older than it is
  /// entered behind it.
  [[nodiscard]] std::optional<StampedToken> first_entered() const;
  /// On which signatures the valid tokens rest, each kind once.
  [[nodiscard]] const std::vector<timestamp::SignatureUse>& signatures() const { return signatures_; }
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
    std::string subject{};  // of that root
  };
  struct Untrusted {
    std::uint64_t checkpoint = 0, entry = 0;
    std::string file, explanation;
  };

  std::optional<std::string> read_token(const TokenEntry& token, std::uint64_t entry);
  Judged judge(const TokenEntry& token, std::uint64_t entry, const std::string& response);
  bool compare_entry(const TokenEntry& token, std::uint64_t entry, const timestamp::TokenInfo& info);
  /// Authorities whose clock was set in the course of the case prove no time of it.
  void leave_out(const std::set<std::string>& roots);
  void check_exchange(const TokenEntry& token, std::uint64_t entry, std::int64_t mono_ns);
  void compare_clocks(const TokenEntry& token, const TimedToken& timed);

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  const CheckpointRules* checkpoints_;
  CaseClockRules clock_rules_;
  timestamp::CertificatePool pool_;

  std::vector<StampedToken> valid_;
  std::vector<StampedToken> outside_;          // those of valid_ that are of outside authorities
  std::vector<StampedToken> proving_;          // those of valid_ that are over entries that are here,
  std::vector<StampedToken> proving_outside_;  // and of these those that are of outside authorities
  std::set<std::pair<std::uint64_t, std::string>> entered_;
  std::vector<Untrusted> untrusted_;
  std::set<std::uint64_t> valid_checkpoints_;
  std::set<std::uint64_t> restating_;  // entries behind close
  std::map<std::uint64_t, crypto::Sha256Digest> hashes_;
  std::vector<timestamp::SignatureUse> signatures_;
  std::vector<AuthorityClock> clocks_;
  std::map<std::pair<std::string, bool>, std::size_t> clock_of_;  // place in clocks_ by authority, `outside`
  std::map<std::string, ClockComparison> first_outside_;          // by authority
  std::map<std::string, StampingAuthority> authorities_;          // by root, without tokens and names
  bool recovered_ = false;
  std::optional<std::uint64_t> close_;
  std::uint64_t largest_checkpoint_ = 0;
  bool missed_after_close_ = false;
  bool no_trust_ = false;
  std::uint64_t strangers_ = 0;  // tokens that were judged and do not hold
  std::uint64_t outside_entries_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace kiroku::archive
