#include "recorder/vitals/mdc_terms.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>
#include <vector>

#include "base/ascii.h"
#include "media/vital_codes.h"

namespace kiroku::recorder {
namespace {

using Pair = std::pair<std::string_view, std::string_view>;

/// IEEE 11073-10101 units of measure (MDC_DIM_…, the prefix left out) in UCUM.
constexpr std::array<Pair, 58> kDimensions{{
    {"BEAT_PER_MIN", "/min"},
    {"CENTI_M", "cm"},
    {"CM_H2O", "cm[H2O]"},
    {"DECI_L", "dL"},
    {"DEGC", "Cel"},
    {"DEG", "deg"},
    {"DIMLESS", "1"},
    {"DYNE_SEC_PER_CM5", "dyn.s/cm5"},
    {"FAHR", "[degF]"},
    {"HR", "h"},
    {"HZ", "Hz"},
    {"KELVIN", "K"},
    {"KG_PER_M_SQ", "kg/m2"},
    {"KILO_G", "kg"},
    {"KILO_PASCAL", "kPa"},
    {"L", "L"},
    {"L_PER_MIN", "L/min"},
    {"L_PER_MIN_PER_M_SQ", "L/min/m2"},
    {"L_PER_SEC", "L/s"},
    {"MICRO_G", "ug"},
    {"MICRO_G_PER_KG_PER_MIN", "ug/kg/min"},
    {"MICRO_SEC", "us"},
    {"MICRO_VOLT", "uV"},
    {"MICRO_WATT", "uW"},
    {"MILLI_AMPS", "mA"},
    {"MILLI_BAR", "mbar"},
    {"MILLI_G", "mg"},
    {"MILLI_G_PER_DL", "mg/dL"},
    {"MILLI_G_PER_HR", "mg/h"},
    {"MILLI_G_PER_ML", "mg/mL"},
    {"MILLI_L", "mL"},
    {"MILLI_L_PER_CM_H2O", "mL/cm[H2O]"},
    {"MILLI_L_PER_HR", "mL/h"},
    {"MILLI_L_PER_KG", "mL/kg"},
    {"MILLI_L_PER_MIN", "mL/min"},
    {"MILLI_L_PER_M_SQ", "mL/m2"},
    {"MILLI_M", "mm"},
    {"MILLI_MOLE_PER_L", "mmol/L"},
    {"MILLI_SEC", "ms"},
    {"MILLI_VOLT", "mV"},
    {"MIN", "min"},
    {"MMHG", "mm[Hg]"},
    {"MMHG_PER_SEC", "mm[Hg]/s"},
    {"NANO_WATT", "nW"},
    {"OHM", "Ohm"},
    {"PASCAL", "Pa"},
    {"PERCENT", "%"},
    {"PER_MIN", "/min"},
    {"PER_SEC", "/s"},
    {"PULS_PER_MIN", "/min"},
    {"RESP_PER_MIN", "/min"},
    {"SEC", "s"},
    {"VOLT", "V"},
    {"WATT", "W"},
    {"X_G", "g"},
    {"X_L", "L"},
    {"X_L_PER_MIN", "L/min"},
    {"YR", "a"},
}};

/// By number alone, where a device leaves out the name.
constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kDimensionNumbers{{
    {"262656", "1"},
    {"262688", "%"},
    {"263441", "cm"},
    {"263762", "mL"},
    {"263875", "kg"},
    {"264320", "s"},
    {"264338", "ms"},
    {"264608", "/s"},
    {"264864", "/min"},
    {"264928", "/min"},
    {"266016", "mm[Hg]"},
    {"266048", "cm[H2O]"},
    {"266418", "mV"},
    {"268160", "[degF]"},
    {"268192", "Cel"},
}};

/// As people and files write them; compared without case and blanks.
constexpr std::array<Pair, 62> kSpellings{{
    {"%", "%"},
    {"percent", "%"},
    {"pct", "%"},
    {"1", "1"},
    {"nd", "1"},
    {"nu", "1"},
    {"adu", "1"},
    {"unitless", "1"},
    {"mmhg", "mm[Hg]"},
    {"mm[hg]", "mm[Hg]"},
    {"cmh2o", "cm[H2O]"},
    {"cm[h2o]", "cm[H2O]"},
    {"kpa", "kPa"},
    {"hpa", "hPa"},
    {"mbar", "mbar"},
    {"bpm", "/min"},
    {"/min", "/min"},
    {"1/min", "/min"},
    {"beats/min", "/min"},
    {"{beats}/min", "/min"},
    {"{beat}/min", "/min"},
    {"{breath}/min", "/min"},
    {"{resp}/min", "/min"},
    {"rpm", "/min"},
    {"resp/min", "/min"},
    {"breaths/min", "/min"},
    {"brpm", "/min"},
    {"/s", "/s"},
    {"hz", "Hz"},
    {"c", "Cel"},
    {"cel", "Cel"},
    {"degc", "Cel"},
    {"deg_c", "Cel"},
    {"\xC2\xB0"
     "c",
     "Cel"},
    {"f", "[degF]"},
    {"degf", "[degF]"},
    {"[degf]", "[degF]"},
    {"\xC2\xB0"
     "f",
     "[degF]"},
    {"v", "V"},
    {"uv", "uV"},
    {"\xC2\xB5v", "uV"},
    {"nv", "nV"},
    {"ohm", "Ohm"},
    {"ml", "mL"},
    {"l", "L"},
    {"l/min", "L/min"},
    {"lpm", "L/min"},
    {"l/s", "L/s"},
    {"ml/min", "mL/min"},
    {"ml/h", "mL/h"},
    {"ml/hr", "mL/h"},
    {"s", "s"},
    {"sec", "s"},
    {"ms", "ms"},
    {"msec", "ms"},
    {"min", "min"},
    {"cm", "cm"},
    {"mm", "mm"},
    {"kg", "kg"},
    {"mg/dl", "mg/dL"},
    {"mmol/l", "mmol/L"},
    {"g/dl", "g/dL"},
}};

/// Labels of signals in files that leave no doubt.
constexpr std::array<Pair, 41> kLabels{{
    {"I", "MDC_ECG_ELEC_POTL_I"},
    {"II", "MDC_ECG_ELEC_POTL_II"},
    {"III", "MDC_ECG_ELEC_POTL_III"},
    {"AVR", "MDC_ECG_ELEC_POTL_AVR"},
    {"AVL", "MDC_ECG_ELEC_POTL_AVL"},
    {"AVF", "MDC_ECG_ELEC_POTL_AVF"},
    {"V1", "MDC_ECG_ELEC_POTL_V1"},
    {"V2", "MDC_ECG_ELEC_POTL_V2"},
    {"V3", "MDC_ECG_ELEC_POTL_V3"},
    {"V4", "MDC_ECG_ELEC_POTL_V4"},
    {"V5", "MDC_ECG_ELEC_POTL_V5"},
    {"V6", "MDC_ECG_ELEC_POTL_V6"},
    {"ECG I", "MDC_ECG_ELEC_POTL_I"},
    {"ECG II", "MDC_ECG_ELEC_POTL_II"},
    {"ECG III", "MDC_ECG_ELEC_POTL_III"},
    {"ECG AVR", "MDC_ECG_ELEC_POTL_AVR"},
    {"ECG AVL", "MDC_ECG_ELEC_POTL_AVL"},
    {"ECG AVF", "MDC_ECG_ELEC_POTL_AVF"},
    {"ECG V1", "MDC_ECG_ELEC_POTL_V1"},
    {"ECG V2", "MDC_ECG_ELEC_POTL_V2"},
    {"ECG V3", "MDC_ECG_ELEC_POTL_V3"},
    {"ECG V4", "MDC_ECG_ELEC_POTL_V4"},
    {"ECG V5", "MDC_ECG_ELEC_POTL_V5"},
    {"ECG V6", "MDC_ECG_ELEC_POTL_V6"},
    {"ECG_II", "MDC_ECG_ELEC_POTL_II"},
    {"ABP", "MDC_PRESS_BLD_ART_ABP"},
    {"ART", "MDC_PRESS_BLD_ART_ABP"},
    {"PAP", "MDC_PRESS_BLD_ART_PULM"},
    {"CVP", "MDC_PRESS_BLD_VEN_CENT"},
    {"PLETH", "MDC_PULS_OXIM_PLETH"},
    {"PLETHYSMOGRAM", "MDC_PULS_OXIM_PLETH"},
    {"SPO2", "MDC_PULS_OXIM_SAT_O2"},
    {"SAO2", "MDC_PULS_OXIM_SAT_O2"},
    {"RESP", "MDC_RESP"},
    {"HR", "MDC_ECG_HEART_RATE"},
    {"PULSE", "MDC_PULS_OXIM_PULS_RATE"},
    {"RR", "MDC_RESP_RATE"},
    {"NBP SYS", "MDC_PRESS_BLD_NONINV_SYS"},
    {"NBP DIAS", "MDC_PRESS_BLD_NONINV_DIA"},
    {"NBP MEAN", "MDC_PRESS_BLD_NONINV_MEAN"},
    {"TEMP", "MDC_TEMP"},
}};

template <typename Table>
std::string_view find(const Table& table, std::string_view key) {
  const auto found = std::ranges::find(table, key, &Table::value_type::first);
  return found == table.end() ? std::string_view() : found->second;
}

std::string lower_without_blanks(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c != ' ') {
      result += ascii_lower(c);
    }
  }
  return result;
}

/// 0 for anything but a number of 32 bits.
std::uint32_t number_in(std::string_view text) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && !text.empty() ? number : 0;
}

bool is_number(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

bool names_term(std::string_view text) { return text.starts_with("MDC_") || text.starts_with("MDCX_"); }

/// The MDC term of one triplet, its code empty if it is none.
Quantity term_of(const std::string& first, const std::string& second, const std::string& system) {
  Quantity quantity;
  if (names_term(second)) {
    quantity = {second, number_in(first), ""};
  } else if (names_term(first)) {
    quantity = {first, number_in(second), ""};
  } else if (system == "MDC" && is_number(first)) {
    quantity.mdc = number_in(first);
    const media::VitalCode* const known = media::find_vital_code(quantity.mdc);
    quantity.code = known != nullptr ? std::string(known->code) : "MDC:" + first;
    return quantity;
  } else {
    return {};
  }
  if (const media::VitalCode* const known = media::find_vital_code(quantity.code)) {
    if (quantity.mdc != 0 && quantity.mdc != known->mdc) {
      quantity.remark = "the number " + std::to_string(quantity.mdc) + " is not that of " + quantity.code +
                        "; the name was taken";
    }
    quantity.mdc = known->mdc;
  }
  return quantity;
}

std::string ucum_of_dimension(std::string_view name) {
  constexpr std::string_view kPrefix = "MDC_DIM_";
  return name.starts_with(kPrefix) ? std::string(find(kDimensions, name.substr(kPrefix.size()))) : "";
}

}  // namespace

Quantity quantity_of(const Hl7Field& field) {
  std::array<std::string, 6> parts;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    parts[i] = field.component(i + 1).text();
  }
  for (const std::size_t triplet : {std::size_t{0}, std::size_t{3}}) {
    Quantity quantity = term_of(parts[triplet], parts[triplet + 1], parts[triplet + 2]);
    if (!quantity.code.empty()) {
      return quantity;
    }
  }
  std::string code = parts[0] + "^" + parts[1] + "^" + parts[2];
  code.erase(code.find_last_not_of('^') + 1);
  return {std::move(code), 0, ""};
}

Unit unit_of(std::string_view text) {
  if (text.empty()) {
    return {"", true};
  }
  // mV and MV differ, so what differs in case alone from a prefix of another size is not among the spellings.
  if (text == "mV") {
    return {"mV", true};
  }
  const std::string_view known = find(kSpellings, lower_without_blanks(text));
  return known.empty() ? Unit{std::string(text), false} : Unit{std::string(known), true};
}

Unit unit_of(const Hl7Field& field) {
  std::array<std::string, 6> parts;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    parts[i] = field.component(i + 1).text();
  }
  if (std::ranges::all_of(parts, &std::string::empty)) {
    return {};
  }
  for (const std::size_t triplet : {std::size_t{0}, std::size_t{3}}) {
    if (parts[triplet + 2] == "UCUM" && !parts[triplet].empty()) {
      const Unit spelled = unit_of(parts[triplet]);  // {beats}/min and /min are one
      return {spelled.unit, true};
    }
    for (const std::size_t i : {triplet, triplet + 1}) {
      if (const std::string unit = ucum_of_dimension(parts[i]); !unit.empty()) {
        return {unit, true};
      }
    }
  }
  if (const std::string_view unit = find(kDimensionNumbers, parts[0]); !unit.empty()) {
    return {std::string(unit), true};
  }
  for (const std::string& part : parts) {
    if (const Unit unit = unit_of(part); unit.known && !part.empty()) {
      return unit;
    }
  }
  return {*std::ranges::find_if_not(parts, &std::string::empty), false};
}

Quantity quantity_of_label(std::string_view label) {
  std::string upper;
  for (const char c : label) {
    upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  }
  const std::string_view code = find(kLabels, upper);
  if (code.empty()) {
    return {std::string(label), 0, ""};
  }
  return {std::string(code), media::find_vital_code(code)->mdc, ""};
}

}  // namespace kiroku::recorder
