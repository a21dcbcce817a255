#include "archive/verify/consent_rules.h"

#include "archive/format/age_layout.h"
#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "archive/format/line_reader.h"
#include "archive/verify/file_checker.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

Place in_ledger(std::uint64_t number) { return {std::string(kLedgerFile), number}; }

std::string at_entry(std::uint64_t number) { return "entry " + std::to_string(number) + " of the log"; }

/// Why the file is not the one that was entered; nothing where it is.
std::optional<std::string> why_another(const ReadableFile& file, const crypto::Sha256Digest& stated) {
  if (file.size() > kMaximumConsentBytes) {
    return "has " + std::to_string(file.size()) + " bytes, more than the 64 MiB that may be kept";
  }
  if (const std::optional<std::uint64_t> hole = file.first_hole()) {
    return "has a hole from byte " + std::to_string(*hole) + " on, where what is sealed has none";
  }
  const std::optional<std::string> bytes = read_small(file, kMaximumConsentBytes);
  return bytes && crypto::sha256(bytes_of(*bytes)) == stated
             ? std::nullopt
             : std::optional<std::string>("has another SHA-256 than its entry states");
}

}  // namespace

bool ConsentRules::concerns(const LogEntryBody& body) {
  const auto* access = std::get_if<AccessEntry>(&body);
  return std::holds_alternative<ConsentGivenEntry>(body) ||
         std::holds_alternative<ConsentWithdrawnEntry>(body) || (access != nullptr && access->purpose);
}

void ConsentRules::take(const LogEntryBody& body, std::uint64_t number, Standing standing) {
  if (const auto* given = std::get_if<ConsentGivenEntry>(&body)) {
    take_statement(*given, false, number, standing);
  } else if (const auto* withdrawn = std::get_if<ConsentWithdrawnEntry>(&body)) {
    take_statement(*withdrawn, true, number, standing);
  } else if (const auto* access = std::get_if<AccessEntry>(&body)) {
    if (standing.is_signed && standing.is_asked_for && access->purpose &&
        !standing_.contains({access->case_id, *access->purpose})) {
      findings_->add("access-without-consent", in_ledger(number),
                     at_entry(number) + " says that case " + access->case_id + " was used for " +
                         *access->purpose + " while no consent to that stood");
    }
  }
}

void ConsentRules::take_statement(const ConsentStatement& says, bool withdraws, std::uint64_t number,
                                  Standing standing) {
  name_file(says.statement, number, standing.is_asked_for);
  if (says.form) {
    name_file(*says.form, number, standing.is_asked_for);
  }
  if (!standing.is_asked_for) {
    return;
  }
  if (!standing.is_signed) {
    unsigned_.emplace(number, withdraws);
  } else if (!standing.is_opened) {
    findings_->add("consent-case-unknown", in_ledger(number),
                   at_entry(number) + " states a consent or its withdrawal for case " + says.case_id +
                       ", which the log does not say was opened before");
  }
  for (const std::string& purpose : says.purposes) {
    const Use key(says.case_id, purpose);
    if (withdraws && !standing.is_signed) {
      if (standing_.erase(key) > 0) {
        doubted_.insert(key);
      }
    } else if (withdraws) {
      // What was withdrawn by a line that nobody signed is entered again, signed.
      const bool was_doubted = doubted_.erase(key) > 0;
      if (standing_.erase(key) == 0 && !was_doubted) {
        findings_->add("consent-not-given", in_ledger(number),
                       at_entry(number) + " withdraws a consent of case " + says.case_id + " to " + purpose +
                           " that did not stand");
      }
    } else if (standing.is_signed) {
      doubted_.erase(key);
      if (!standing_.insert(key).second) {
        findings_->add("consent-given-twice", in_ledger(number),
                       at_entry(number) + " states a consent of case " + says.case_id + " to " + purpose +
                           " that stood already");
      }
    }
  }
}

void ConsentRules::followed() {
  if (!unsigned_) {
    return;
  }
  const auto [number, withdraws] = *unsigned_;
  unsigned_.reset();
  findings_->add("consent-doubted", in_ledger(number),
                 at_entry(number) + " states " +
                     (withdraws ? "that a consent was withdrawn, which forbids its use and erases nothing"
                                : "a consent, which counts for nothing") +
                     ": nobody signed it before another entry followed");
}

void ConsentRules::name_file(const crypto::Sha256Digest& hash, std::uint64_t number, bool is_asked_for) {
  std::optional<std::uint64_t>& entry = files_[consent_path(hash)];
  if (is_asked_for && !entry) {
    entry = number;
  }
}

std::set<std::string> ConsentRules::named_since(std::uint64_t entries) const {
  std::set<std::string> named;
  const FileOpening opening = folder_->open_file(kLedgerFile);
  if (!opening.file) {
    return named;
  }
  LineReader reader(*opening.file);
  std::uint64_t number = 0;
  for (LedgerLine line; reader.next(line) && !line.torn; ++number) {
    if (number < entries || line.too_long) {
      continue;
    }
    const LogEntryParse parse = parse_log_entry(line.text);
    const ConsentStatement* says = nullptr;
    if (parse.entry) {
      if (const auto* given = std::get_if<ConsentGivenEntry>(&parse.entry->body)) says = given;
      if (const auto* withdrawn = std::get_if<ConsentWithdrawnEntry>(&parse.entry->body)) says = withdrawn;
    }
    if (says != nullptr) {
      named.insert(consent_path(says->statement));
      if (says->form) named.insert(consent_path(*says->form));
    }
  }
  return named;
}

void ConsentRules::report_unnamed(const std::vector<ListedFile>& listing, std::uint64_t entries) {
  std::optional<std::set<std::string>> since;
  for (const ListedFile& each : listing) {
    if (!hash_of_consent_path(each.path) || each.kind != ListedFile::Kind::kRegular || names(each.path)) {
      continue;
    }
    if (!since) {
      since = named_since(entries);
    }
    if (!since->contains(each.path)) {
      findings_->add("consent-not-entered", {each.path},
                     each.path +
                         " is named by no entry of the log: the machine stopped before it was "
                         "entered, or its entry was removed");
    }
  }
}

void ConsentRules::finish(const std::vector<ListedFile>& listing, std::uint64_t entries, bool log_itself) {
  if (log_itself) {
    report_unnamed(listing, entries);
  }
  for (const auto& [path, entry] : files_) {
    if (entry) {
      check_file(path, *entry);
    }
  }
}

void ConsentRules::check_file(const std::string& path, std::uint64_t entry) {
  const FileOpening opening = folder_->open_file(path);
  if (!opening.file && opening.problem == FileProblem::kMissing) {
    findings_->add(
        "consent-file-missing", {path, entry},
        path + ", which " + at_entry(entry) + " names, is not there: who consented cannot be read any more");
    return;
  }
  if (!opening.file) {
    report_unopened(*findings_, {path, entry}, opening);
    return;
  }
  try {
    if (const auto why = why_another(*opening.file, hash_of_consent_path(path).value())) {
      findings_->add("file-hash-differs", {path, entry}, path + " " + *why);
    } else if (age_form(*opening.file) != AgeForm::kHolding) {
      findings_->add("consent-not-sealed", {path, entry},
                     path + ", which " + at_entry(entry) +
                         " names, is no sealed (age) file with anything in it: anybody can read what it has "
                         "of the person, or nobody");
    }
  } catch (const IoError& error) {
    findings_->add("file-unreadable", {path, entry}, error.what());
  }
}

}  // namespace kiroku::archive
