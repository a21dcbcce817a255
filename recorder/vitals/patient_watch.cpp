#include "recorder/vitals/patient_watch.h"

#include <algorithm>
#include <utility>

namespace kiroku::recorder {
namespace {

std::string key_of(const std::vector<PatientNumber>& numbers) {
  std::string key;
  for (const PatientNumber& each : numbers)
    key += each.number + '\x1f' + each.issuer + '\x1f' + each.issuer_id + '\x1f' + each.type + '\x1e';
  return key;
}

}  // namespace

bool name_two_patients(const std::vector<PatientNumber>& of_case,
                       const std::vector<PatientNumber>& of_monitor) {
  const auto has = [](const std::vector<PatientNumber>& numbers, bool is_of_account) {
    return std::ranges::any_of(numbers, [&](const PatientNumber& each) {
      return each.is_of_account == is_of_account && !each.number.empty();
    });
  };
  const bool comparable =
      (has(of_case, false) && has(of_monitor, false)) || (has(of_case, true) && has(of_monitor, true));
  return comparable && !share_a_number(of_case, of_monitor) && !read_alike(of_case, of_monitor);
}

void PatientWatch::heard(const std::vector<PatientNumber>& numbers, std::int64_t time_ns) {
  if (numbers.empty()) return;
  const std::lock_guard guard(mutex_);
  const std::string key = key_of(numbers);
  auto found = heard_.find(key);
  if (found == heard_.end()) {
    if (heard_.size() >= kMostPatients)
      heard_.erase(
          std::ranges::min_element(heard_, {}, [](const auto& each) { return each.second.last_ns; }));
    found = heard_.emplace(key, Heard{numbers}).first;
  }
  found->second.last_ns = time_ns;
  compare(found->second);
}

void PatientWatch::expect(std::vector<PatientNumber> numbers, std::int64_t begins_ns) {
  const std::lock_guard guard(mutex_);
  expected_ = std::move(numbers);
  begins_ns_ = begins_ns;
  others_ = 0;
  for (auto& [key, one] : heard_) {
    one.is_counted = false;
    compare(one);
  }
}

std::size_t PatientWatch::take_others() {
  const std::lock_guard guard(mutex_);
  return std::exchange(others_, 0);
}

void PatientWatch::compare(Heard& one) {
  if (one.is_counted || expected_.empty() || one.last_ns < begins_ns_) return;
  if (!name_two_patients(expected_, one.numbers)) return;
  one.is_counted = true;
  ++others_;
}

}  // namespace kiroku::recorder
