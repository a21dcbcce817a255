#include "media/vital_codes.h"

#include <algorithm>
#include <array>

namespace kiroku::media {
namespace {

// IEEE 11073-10101 annex A, partition 2 (SCADA): the numeric code is 2 * 65536 + term.
constexpr std::array<VitalCode, 57> kCodes{{
    {kFlashCode, 0, "1", "picture flash"},
    {"MDC_AWAY_CO2_ET", 151728, "mm[Hg]", "end-tidal carbon dioxide"},
    {"MDC_BLD_PERF_INDEX", 150488, "%", "perfusion index"},
    {"MDC_CO2_RESP_RATE", 151594, "/min", "respiration rate, from carbon dioxide"},
    {"MDC_CONC_AWAY_CO2_ET", 151708, "mm[Hg]", "end-tidal carbon dioxide concentration"},
    {"MDC_CONC_AWAY_CO2_EXP", 151712, "mm[Hg]", "expired carbon dioxide"},
    {"MDC_CONC_AWAY_CO2_INSP", 151716, "mm[Hg]", "inspired carbon dioxide"},
    {"MDC_ECG_ELEC_POTL_AVF", 131392, "mV", "ECG lead aVF"},
    {"MDC_ECG_ELEC_POTL_AVL", 131391, "mV", "ECG lead aVL"},
    {"MDC_ECG_ELEC_POTL_AVR", 131390, "mV", "ECG lead aVR"},
    {"MDC_ECG_ELEC_POTL_I", 131329, "mV", "ECG lead I"},
    {"MDC_ECG_ELEC_POTL_II", 131330, "mV", "ECG lead II"},
    {"MDC_ECG_ELEC_POTL_III", 131389, "mV", "ECG lead III"},
    {"MDC_ECG_ELEC_POTL_V1", 131331, "mV", "ECG lead V1"},
    {"MDC_ECG_ELEC_POTL_V2", 131332, "mV", "ECG lead V2"},
    {"MDC_ECG_ELEC_POTL_V3", 131333, "mV", "ECG lead V3"},
    {"MDC_ECG_ELEC_POTL_V4", 131334, "mV", "ECG lead V4"},
    {"MDC_ECG_ELEC_POTL_V5", 131335, "mV", "ECG lead V5"},
    {"MDC_ECG_ELEC_POTL_V6", 131336, "mV", "ECG lead V6"},
    {"MDC_ECG_HEART_RATE", 147842, "/min", "heart rate"},
    {"MDC_FLOW_AWAY", 151764, "L/min", "airway flow"},
    {"MDC_PRESS_AWAY", 151792, "cm[H2O]", "airway pressure"},
    {"MDC_PRESS_BLD_ART", 150032, "mm[Hg]", "arterial pressure, unspecified"},
    {"MDC_PRESS_BLD_ART_ABP", 150036, "mm[Hg]", "arterial pressure"},
    {"MDC_PRESS_BLD_ART_ABP_DIA", 150038, "mm[Hg]", "arterial pressure, diastolic"},
    {"MDC_PRESS_BLD_ART_ABP_MEAN", 150039, "mm[Hg]", "arterial pressure, mean"},
    {"MDC_PRESS_BLD_ART_ABP_SYS", 150037, "mm[Hg]", "arterial pressure, systolic"},
    {"MDC_PRESS_BLD_ART_DIA", 150034, "mm[Hg]", "arterial pressure, unspecified, diastolic"},
    {"MDC_PRESS_BLD_ART_MEAN", 150035, "mm[Hg]", "arterial pressure, unspecified, mean"},
    {"MDC_PRESS_BLD_ART_PULM", 150044, "mm[Hg]", "pulmonary artery pressure"},
    {"MDC_PRESS_BLD_ART_PULM_DIA", 150046, "mm[Hg]", "pulmonary artery pressure, diastolic"},
    {"MDC_PRESS_BLD_ART_PULM_MEAN", 150047, "mm[Hg]", "pulmonary artery pressure, mean"},
    {"MDC_PRESS_BLD_ART_PULM_SYS", 150045, "mm[Hg]", "pulmonary artery pressure, systolic"},
    {"MDC_PRESS_BLD_ART_SYS", 150033, "mm[Hg]", "arterial pressure, unspecified, systolic"},
    {"MDC_PRESS_BLD_NONINV_DIA", 150022, "mm[Hg]", "cuff pressure, diastolic"},
    {"MDC_PRESS_BLD_NONINV_MEAN", 150023, "mm[Hg]", "cuff pressure, mean"},
    {"MDC_PRESS_BLD_NONINV_SYS", 150021, "mm[Hg]", "cuff pressure, systolic"},
    {"MDC_PRESS_BLD_VEN_CENT", 150084, "mm[Hg]", "central venous pressure"},
    {"MDC_PRESS_BLD_VEN_CENT_MEAN", 150087, "mm[Hg]", "central venous pressure, mean"},
    {"MDC_PRESS_CUFF_DIA", 150302, "mm[Hg]", "pressure in the cuff, diastolic"},
    {"MDC_PRESS_CUFF_MEAN", 150303, "mm[Hg]", "pressure in the cuff, mean"},
    {"MDC_PRESS_CUFF_SYS", 150301, "mm[Hg]", "pressure in the cuff, systolic"},
    {"MDC_PULS_OXIM_PLETH", 150452, "1", "plethysmogram"},
    {"MDC_PULS_OXIM_PULS_RATE", 149530, "/min", "pulse rate"},
    {"MDC_PULS_OXIM_SAT_O2", 150456, "%", "oxygen saturation"},
    {"MDC_PULS_RATE_NON_INV", 149546, "/min", "pulse rate, non-invasive"},
    {"MDC_RESP", 151556, "Ohm", "respiration"},
    {"MDC_RESP_RATE", 151562, "/min", "respiration rate"},
    {"MDC_TEMP", 150344, "Cel", "temperature"},
    {"MDC_TEMP_AXIL", 188496, "Cel", "axillary temperature"},
    {"MDC_TEMP_BODY", 150364, "Cel", "body temperature"},
    {"MDC_TEMP_CORE", 150368, "Cel", "core temperature"},
    {"MDC_TEMP_ESOPH", 150372, "Cel", "oesophageal temperature"},
    {"MDC_TEMP_RECT", 188420, "Cel", "rectal temperature"},
    {"MDC_TEMP_SKIN", 150388, "Cel", "skin temperature"},
    {"MDC_TTHOR_RESP_RATE", 151578, "/min", "respiration rate, transthoracic"},
    {"MDC_VOL_AWAY_TIDAL", 151868, "mL", "tidal volume"},
}};
static_assert(std::ranges::is_sorted(kCodes, {}, &VitalCode::code));

}  // namespace

std::span<const VitalCode> vital_codes() { return kCodes; }

const VitalCode* find_vital_code(std::string_view code) {
  const auto* const found = std::ranges::lower_bound(kCodes, code, {}, &VitalCode::code);
  return found != kCodes.end() && found->code == code ? found : nullptr;
}

const VitalCode* find_vital_code(std::uint32_t mdc) {
  const auto* const found = std::ranges::find(kCodes, mdc, &VitalCode::mdc);
  return mdc != 0 && found != kCodes.end() ? found : nullptr;
}

}  // namespace kiroku::media
