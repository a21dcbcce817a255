// Whether the monitors speak of the patient whom the case is about: what their messages name is compared with
// what is known of the case. Numbers are kept in memory alone, and are never told. Thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

class PatientWatch {
 public:
  /// Patients who are told apart; of more the oldest are forgotten.
  static constexpr std::size_t kMostPatients = 64;

  /// A message names its patient by these numbers; `time_ns` by the case clock.
  void heard(const std::vector<PatientNumber>& numbers, std::int64_t time_ns);
  /// The case that began at `begins_ns`, or where it goes on, is about whoever has these numbers from now on;
  /// none: nobody knows. What was heard since it began counts.
  void expect(std::vector<PatientNumber> numbers, std::int64_t begins_ns);
  /// Of how many patients messages were since the last call who are others than the case's.
  std::size_t take_others();

 private:
  struct Heard {
    std::vector<PatientNumber> numbers;
    std::int64_t last_ns = 0;
    bool is_counted = false;
  };
  void compare(Heard& one);

  std::mutex mutex_;
  std::vector<PatientNumber> expected_;
  std::int64_t begins_ns_ = 0;
  std::map<std::string, Heard> heard_;  // by all their numbers
  std::size_t others_ = 0;
};

/// Whether the numbers of a case and a monitor's name two patients: both name one, by numbers of one kind (a
/// person's, or an account's), and none of them may be one of the other's.
bool name_two_patients(const std::vector<PatientNumber>& of_case,
                       const std::vector<PatientNumber>& of_monitor);

}  // namespace kiroku::recorder
