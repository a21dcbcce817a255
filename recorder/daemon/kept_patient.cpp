#include "recorder/daemon/kept_patient.h"

#include <nlohmann/json.hpp>

namespace kiroku::recorder {

using nlohmann::json;

Bytes kept_bytes(const KeptPatient& kept) {
  json numbers = json::array();
  for (const PatientNumber& each : kept.numbers)
    numbers.push_back({each.number, each.issuer, each.issuer_id, each.type, each.is_of_account});
  const json all{{"case", kept.case_id},
                 {"subject", kept.sealed_subject},
                 {"numbers", std::move(numbers)},
                 {"plan_patients", kept.plan_patients},
                 {"about", kept.about}};
  return to_bytes(all.dump(-1, ' ', false, json::error_handler_t::replace));
}

KeptPatient read_kept_patient(ByteView bytes) {
  try {
    const json all = json::parse(text_of(bytes));
    KeptPatient kept;
    kept.case_id = all.at("case");
    kept.sealed_subject = all.at("subject");
    for (const json& each : all.at("numbers"))
      kept.numbers.push_back({each.at(0), each.at(1), each.at(2), each.at(3), each.at(4)});
    kept.plan_patients = all.at("plan_patients").get<std::vector<std::string>>();
    kept.about = all.value("about", "");
    return kept;
  } catch (const json::exception&) {
    return {};
  }
}

}  // namespace kiroku::recorder
