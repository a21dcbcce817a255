// By what a ProcedureBook tells rooms, patients and messages apart. Functions; thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_message.h"

namespace kiroku::recorder {

bool is_of_room(const ProcedureRule& rule, const std::string& place);
/// Of what is kept by place: "" is of all places together.
bool is_meant_by(const ProcedureRule& rule, const std::string& place);
/// By which a room is known again by the process that starts next.
std::string name_of_room(const ProcedureRule& rule);
/// Whether that name is of the rule's room: it may be known by more, or fewer, spellings since.
bool is_named(const ProcedureRule& rule, std::string_view name);
/// What is not a part of another one of them: "SURGERY^OR1", not "OR1".
std::vector<std::string_view> whole_places(const std::vector<std::string>& places);
/// Whether a place of the one is a place of the other, as whole as it is written in one of them.
bool share_a_place(const std::vector<std::string>& one, const std::vector<std::string>& other);
/// Both are stated, and differ.
bool are_two_visits(const ProcedureMessage& one, const ProcedureMessage& other);
/// Both are stated by one sender, and differ.
bool are_two_accounts(const ProcedureMessage& one, const ProcedureMessage& other);
/// Not another one for a name that is written in another way.
bool is_another_name(const PersonName& one, const PersonName& other);
/// Born within so many days; of a year or month alone nobody knows.
bool is_newborn(const std::string& birth_date, UtcTime at);
bool is_of_appointment(const ProcedureMessage& message);
/// It corrects what is known of somebody, and is no event of theirs.
bool is_record(const ProcedureMessage& message);
/// As a message that named the patient by the earlier number.
ProcedureMessage before_merging(const ProcedureMessage& merging);
/// What is kept of a message only to know its patient again.
void leave_identity(ProcedureMessage& message);

}  // namespace kiroku::recorder
