#include "recorder/late_stamping.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/found_files.h"
#include "base/error.h"
#include "recorder/clock/whole_seconds.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;

}  // namespace

/// One closed case, open for writing.
struct LateStamping::Case {
  explicit Case(const Context& context, const fs::path& folder)
      : writer(archive::CaseWriter::resume(
            context.files == nullptr ? archive::real_file_system() : *context.files, folder, *context.key,
            context.device_name, context.log, [this](const archive::CaseEntry& entry) { take(entry); })),
        clock(*context.clock) {}

  void take(const archive::CaseEntry& entry) {
    last_mono_ns = entry.at.mono_ns;
    if (std::holds_alternative<archive::CloseEntry>(entry.body)) {
      close = entry.seq;
    } else if (const auto* token = std::get_if<archive::TokenEntry>(&entry.body)) {
      entered.emplace(token->checkpoint, token->authority);
    }
  }
  /// Whether there is a token of the authority over the end.
  [[nodiscard]] bool has_token_of(const std::string& authority) const {
    return std::any_of(entered.begin(), entered.end(),
                       [&](const auto& token) { return token.second == authority && token.first > *close; });
  }
  /// After close the case clock stands.
  [[nodiscard]] archive::Moment now() const { return {clock.utc(), last_mono_ns}; }

  /// Tokens over the end whose entry a crash kept from being written.
  void adopt_tokens(const archive::FileReading& files, const timestamp::TrustStore* trust, Result& result) {
    const archive::CaseFolder folder = archive::CaseFolder::open(writer->folder(), files);
    std::vector<archive::TokenName> found = archive::found_tokens(writer->folder(), files);
    std::erase_if(found, [&](const archive::TokenName& name) {
      return name.size <= *close || name.size > writer->size() ||
             entered.contains({name.size, name.authority});
    });
    std::size_t left = 0;
    for (const archive::TokenName& name :
         archive::tokens_to_judge(std::move(found), writer->folder(), files, left)) {
      // Another form of one that was taken just now.
      if (entered.contains({name.size, name.authority})) continue;
      const std::optional<archive::TokenEntry> facts = archive::token_in_folder(folder, name, trust);
      if (!facts) continue;
      writer->adopt_token(name, *facts, now());
      entered.emplace(name.size, name.authority);
      result.stamped.push_back({writer->case_id(), name.authority, name.size, facts->gen_time, {}});
    }
  }

  std::optional<std::uint64_t> close;
  std::set<std::pair<std::uint64_t, std::string>> entered;
  std::int64_t last_mono_ns = 0;
  std::unique_ptr<archive::CaseWriter> writer;  // reading it fills the members above
  const Clock& clock;
};

LateStamping::LateStamping(const std::vector<NamedAuthority>& authorities, Context context)
    : context_(std::move(context)) {
  for (const NamedAuthority& authority : authorities) {
    contacts_.push_back(
        std::make_unique<AuthorityContact>(authority, context_.trust, context_.queue, *context_.clock));
  }
}

AuthorityContact* LateStamping::contact(const std::string& name) const {
  const auto found = std::find_if(contacts_.begin(), contacts_.end(),
                                  [&](const auto& each) { return each->name() == name; });
  return found == contacts_.end() ? nullptr : found->get();
}

std::string LateStamping::pause_of(AuthorityContact& contact, Patience patience) const {
  const auto allowed = patience == Patience::kLimitsOnly ? contact.limit() : contact.next();
  const Clock::Time now = context_.clock->now();
  if (allowed <= now) return {};
  const std::string error = contact.status().last_error;
  return contact.name() + " is left alone for another " + whole_seconds(allowed - now) +
         (error.empty() ? "" : ": " + error);
}

LateStamping::Result LateStamping::work_off(Patience patience) {
  Result result;
  waited_for_.clear();
  std::vector<std::vector<WantedToken>> cases;
  for (WantedToken& wanted : context_.queue->list()) {
    const auto same = std::find_if(cases.begin(), cases.end(),
                                   [&](const auto& each) { return each.front().case_id == wanted.case_id; });
    if (same == cases.end()) {
      cases.push_back({std::move(wanted)});
    } else {
      same->push_back(std::move(wanted));
    }
  }
  for (const auto& wanted : cases) work_off_case(wanted, patience, result);
  return result;
}

// A case is only opened where there is something to do in it: opening reads its whole ledger.
void LateStamping::work_off_case(const std::vector<WantedToken>& all_wanted, Patience patience,
                                 Result& result) {
  const std::string& case_id = all_wanted.front().case_id;
  const fs::path folder = context_.archive / case_id;
  const auto drop = [&](const WantedToken& wanted, const std::string& reason) {
    context_.queue->drop(case_id, wanted.authority);
    result.dropped.push_back({case_id, wanted.authority, reason});
  };
  std::vector<WantedToken> possible;
  for (const WantedToken& wanted : all_wanted) {
    AuthorityContact* its = contact(wanted.authority);
    if (!archive::is_case_id(case_id) || !fs::is_directory(folder)) {
      drop(wanted, "the case is not in the archive any more");
    } else if (its == nullptr) {
      drop(wanted, "no authority of that name is configured any more");
    } else if (std::string pause = pause_of(*its, patience); !pause.empty()) {
      waited_for_.push_back(its);
      result.waiting.push_back({wanted, std::move(pause)});
    } else {
      possible.push_back(wanted);
    }
  }
  if (possible.empty()) return;
  std::size_t done = 0;
  try {
    Case its(context_, folder);
    if (!its.close) throw Error("the case was not closed: recovery does that first");
    its.adopt_tokens(context_.files == nullptr ? archive::real_reading() : *context_.files, context_.trust,
                     result);
    for (; done < possible.size(); ++done) ask_for(its, possible[done], patience, result);
    if (its.writer->covered() < its.writer->size()) its.writer->finish(its.now());
    // Only now: a case that is left in the middle is taken up again.
    for (const WantedToken& wanted : possible) {
      if (its.has_token_of(wanted.authority)) context_.queue->drop(case_id, wanted.authority);
    }
  } catch (const Error& error) {
    for (; done < possible.size(); ++done) result.waiting.push_back({possible[done], error.what()});
  }
}

void LateStamping::ask_for(Case& its, const WantedToken& wanted, Patience patience, Result& result) {
  if (its.has_token_of(wanted.authority)) return;
  AuthorityContact& asked = *contact(wanted.authority);
  // Again: it may have been asked for another case just now.
  if (std::string pause = pause_of(asked, patience); !pause.empty()) {
    waited_for_.push_back(&asked);
    result.waiting.push_back({wanted, std::move(pause)});
    return;
  }
  const AuthorityAnswer answer = asked.ask(its.writer->checkpoint(its.now()));
  if (!answer.valid()) {
    context_.queue->failed(wanted.case_id, wanted.authority, answer.cause);
    waited_for_.push_back(&asked);
    result.waiting.push_back({wanted, answer.cause});
    return;
  }
  if (const auto missed = its.writer->token_in_the_way(answer.checkpoint.size, wanted.authority)) {
    its.writer->append({*missed}, its.now());  // the next checkpoint, and its token, has another name
    context_.queue->failed(wanted.case_id, wanted.authority, missed->cause);
    waited_for_.push_back(&asked);
    result.waiting.push_back({wanted, missed->cause});
    return;
  }
  its.writer->store_authority_chain(wanted.authority, answer.judgement.chain);
  its.writer->add_token(answer.checkpoint, wanted.authority, answer.response, token_facts(answer), its.now());
  its.entered.emplace(answer.checkpoint.size, wanted.authority);
  result.stamped.push_back({wanted.case_id, wanted.authority, answer.checkpoint.size,
                            answer.judgement.info->gen_time, answer.path});
}

std::optional<AuthorityContact::Time> LateStamping::next() const {
  std::optional<AuthorityContact::Time> earliest;
  for (AuthorityContact* each : waited_for_) {
    const AuthorityContact::Time time = each->next();
    earliest = earliest ? std::min(*earliest, time) : time;
  }
  return earliest;
}

void LateStamping::want(const std::string& case_id) {
  for (const auto& each : contacts_) context_.queue->want(case_id, each->name(), 0, context_.clock->utc());
}

}  // namespace kiroku::recorder
