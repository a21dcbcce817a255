// Cases of all appliances by patient or procedure, with the site's search key
// (docs/explanation/fleet.md, "Search by patient or procedure").
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/search/search_note.h"
#include "archive/search/search_words.h"
#include "fleet/catalogue/fleet_catalogue.h"

namespace kiroku::apps {

/// What is asked for, as somebody wrote it; empty fields ask for anything.
struct SubjectAsked {
  std::string patient, authority, procedure, coding_system;
};
/// How whoever asks writes these fields: "--patient", "'patient'".
using SubjectNames = SubjectAsked;

/// Throws kiroku::UsageError in a sentence that names the field and not what stands in it, where nothing can
/// be searched by it.
search::SearchWords search_words(const SubjectAsked& asked, const SubjectNames& names);

struct Searched {
  std::vector<fleet::FleetCase> found;  // newest first
  bool is_all = true;                   // no more cases fit
  std::uint64_t looked_at = 0, without_note = 0, foreign = 0;
};

/// Cases that fit what is asked for, up to the query's limit. All notes are read, whatever is found: where
/// reading ended, or went on from, would tell the database which case it was. Throws DatabaseError.
Searched search_cases(fleet::FleetCatalogue& catalogue, fleet::CaseQuery query, search::NoteReader& reader,
                      const search::SearchWords& words);

}  // namespace kiroku::apps
