#include "recorder/vitals/patient_number.h"

#include <algorithm>
#include <string_view>

#include "base/ascii.h"

namespace kiroku::recorder {
namespace {

std::string_view without_zeros(std::string_view number) {
  if (number.find_first_not_of("0123456789") != std::string_view::npos) return number;
  return number.substr(std::min(number.find_first_not_of('0'), number.size()));
}

/// Of one issuer and one type, of which a patient has one.
bool is_of_one_kind(const PatientNumber& a, const PatientNumber& b) {
  return !a.type.empty() && a.type == b.type && !a.issuer.empty() && same_but_for_case(a.issuer, b.issuer) &&
         !a.is_of_account && !b.is_of_account;
}

/// Whether `is_same` holds of a number of each, and none of `a` that the other lacks is of a kind of which a
/// patient has one.
template <typename IsSame>
bool is_one_patient(const std::vector<PatientNumber>& a, const std::vector<PatientNumber>& b,
                    const IsSame& is_same) {
  bool shared = false;
  for (const PatientNumber& one : a) {
    bool is_there = false, is_another = false;
    for (const PatientNumber& other : b) {
      is_there = is_there || is_same(one, other);
      is_another = is_another || is_of_one_kind(one, other);
    }
    if (!is_there && is_another) return false;
    shared = shared || is_there;
  }
  return shared;
}

}  // namespace

bool may_be_one(const PatientNumber& a, const PatientNumber& b) {
  const std::string_view number = without_zeros(a.number);
  if (number.empty() || a.is_of_account != b.is_of_account) return false;
  if (!same_but_for_case(number, without_zeros(b.number))) return false;
  if (!a.issuer_id.empty() && a.issuer_id == b.issuer_id) return true;
  if (!a.issuer.empty() && !b.issuer.empty()) return same_but_for_case(a.issuer, b.issuer);
  if (!a.issuer_id.empty() && !b.issuer_id.empty()) return false;
  // One of them does not say who gave it: a social security number is no record number then.
  return a.type.empty() || b.type.empty() || a.type == b.type;
}

bool read_alike(std::string_view a, std::string_view b) {
  return !without_zeros(a).empty() && same_but_for_case(without_zeros(a), without_zeros(b));
}

bool share_a_number(const std::vector<PatientNumber>& a, const std::vector<PatientNumber>& b) {
  const auto is_persons = [](const PatientNumber& each) { return !each.is_of_account; };
  const bool by_persons = std::ranges::any_of(a, is_persons) && std::ranges::any_of(b, is_persons);
  return is_one_patient(a, b, [&](const PatientNumber& one, const PatientNumber& other) {
    return (!by_persons || !one.is_of_account) && may_be_one(one, other);
  });
}

bool read_alike(const std::vector<PatientNumber>& of_case, const std::vector<PatientNumber>& of_monitor) {
  return is_one_patient(of_case, of_monitor, [](const PatientNumber& one, const PatientNumber& other) {
    const bool is_said_to_be_a_persons = !other.is_of_account && !other.type.empty();
    if (one.is_of_account ? is_said_to_be_a_persons : other.is_of_account) return false;
    return read_alike(one.number, other.number);
  });
}

bool is_ct_of_another(const std::vector<std::string>& of_ct, const std::vector<PatientNumber>& of_case) {
  bool is_known = false;
  for (const PatientNumber& one : of_case) {
    if (one.is_of_account || one.number.empty()) continue;
    is_known = true;
    if (std::ranges::any_of(of_ct, [&](const std::string& each) { return read_alike(each, one.number); }))
      return false;
  }
  return is_known && !of_ct.empty();
}

void add_numbers(std::vector<PatientNumber>& numbers, const std::vector<PatientNumber>& more) {
  for (const PatientNumber& each : more) {
    const bool is_there = std::ranges::any_of(numbers, [&](const PatientNumber& other) {
      return each.number == other.number && each.issuer == other.issuer &&
             each.issuer_id == other.issuer_id && each.type == other.type &&
             each.is_of_account == other.is_of_account;
    });
    const std::size_t length =
        each.number.size() + each.issuer.size() + each.issuer_id.size() + each.type.size();
    if (!is_there && length <= kLongestNumber && numbers.size() < kMostNumbers) numbers.push_back(each);
  }
}

}  // namespace kiroku::recorder
