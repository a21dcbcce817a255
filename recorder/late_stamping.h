// Time-stamps that did not come while their case was recorded: the stamping queue worked off, for closed
// cases. One thread at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer.h"
#include "recorder/authority_contact.h"
#include "recorder/stamping_queue.h"

namespace kiroku::recorder {

class LateStamping {
 public:
  struct Context {
    archive::FileSystem* files = nullptr;  // null: the real one
    std::filesystem::path archive;
    const crypto::SigningKey* key = nullptr;
    std::string device_name;
    archive::ApplianceLog* log = nullptr;  // may be null (tests)
    const timestamp::TrustStore* trust = nullptr;
    StampingQueue* queue = nullptr;
    const Clock* clock = &Clock::system();
  };

  struct Stamped {
    std::string case_id, authority;
    std::uint64_t checkpoint = 0;
    UtcTime gen_time;
    std::string path;  // over which it came, "" without a network, and where its file was found
  };
  struct Waiting {
    WantedToken wanted;
    std::string reason;  // one sentence
  };
  /// Wanted no more, although no token came now.
  struct Dropped {
    std::string case_id, authority, reason;
  };
  struct Result {
    std::vector<Stamped> stamped;
    std::vector<Waiting> waiting;
    std::vector<Dropped> dropped;
  };

  /// All that is referred to must outlive the object.
  LateStamping(const std::vector<NamedAuthority>& authorities, Context context);

  enum class Patience {
    kLimitsOnly,  // a person asks: what authorities demand is kept, pauses after failures are not
    kAllPauses    // a program asks again and again
  };
  /// Goes through the queue once, longest wanted first. For each closed case: a token of every authority that
  /// may be asked, its entry, a last checkpoint over it and that in the appliance log, in one go;
  /// one token over the newest state covers all that was wanted. A case that another process writes, or that
  /// was not closed, waits. Throws kiroku::Error if the queue or the log cannot be used; what goes wrong with
  /// one case is the reason why it waits.
  Result work_off(Patience patience);
  /// When work_off(kAllPauses) may get further with what waits for an authority's sake; nothing if no
  /// authority is waited for.
  [[nodiscard]] std::optional<AuthorityContact::Time> next() const;

  /// Has a token asked for from every authority, whatever the queue knows: for a case that recording did not
  /// bring to its end.
  void want(const std::string& case_id);

 private:
  struct Case;
  AuthorityContact* contact(const std::string& name) const;
  void work_off_case(const std::vector<WantedToken>& wanted, Patience patience, Result& result);
  void ask_for(Case& its, const WantedToken& wanted, Patience patience, Result& result);
  /// Why the authority is not asked now; "" if it may be.
  [[nodiscard]] std::string pause_of(AuthorityContact& contact, Patience patience) const;

  Context context_;
  std::vector<std::unique_ptr<AuthorityContact>> contacts_;
  std::vector<AuthorityContact*> waited_for_;
};

}  // namespace kiroku::recorder
