// The numbers by which a patient goes in HL7 v2 messages (data type CX), and which of them may be one:
// senders write the same number with its issuer and without, with leading zeros and without. Pure,
// thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::recorder {

struct PatientNumber {
  std::string number;
  std::string issuer, issuer_id;  // CX-4: namespace and universal identifier ("H", "1.2.3" of "H&1.2.3&ISO")
  std::string type;               // CX-5: "MR", "PI"
  bool is_of_account = false;  // of an account or a visit (PID-18, AN, VN): another number than a patient's
  bool operator==(const PatientNumber&) const = default;
};

inline constexpr std::size_t kMostNumbers = 16;     // of one patient; further ones are not kept
inline constexpr std::size_t kLongestNumber = 256;  // with all that is said of it; HL7 gives it some 50

/// Whether they are the same number, and nothing says that two issuers gave it.
bool may_be_one(const PatientNumber& a, const PatientNumber& b);
/// Whether one of the numbers may be the same, and none says that they are two patients: two record numbers
/// that one issuer gave do. Accounts count only where one of them has nothing else: mother and child may
/// share one.
bool share_a_number(const std::vector<PatientNumber>& a, const std::vector<PatientNumber>& b);
/// Whether one of the numbers reads the same, whoever is said to have given it, and none says that they are
/// two patients. A patient's number and a visit's are two, where both say which they are: those of the case
/// do, and a monitor's by their field or CX-5; what a gateway puts into PID-3 without it may be either. For a
/// question where a wrong "no" is believed less each time.
bool read_alike(const std::vector<PatientNumber>& of_case, const std::vector<PatientNumber>& of_monitor);
/// Whether they read the same but for case and leading zeros.
bool read_alike(std::string_view a, std::string_view b);
/// Whether a CT in which these numbers stand, of one patient or of several, is of somebody else than a case
/// of these: both say whose they are, and no number of the CT reads as one of the patient's. A visit's is
/// none of those.
bool is_ct_of_another(const std::vector<std::string>& of_ct, const std::vector<PatientNumber>& of_case);
/// Those of `more` that are not there.
void add_numbers(std::vector<PatientNumber>& numbers, const std::vector<PatientNumber>& more);

}  // namespace kiroku::recorder
